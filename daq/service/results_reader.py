"""Results of recorded runs, computed from their files in worker processes."""

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, TypeVar

import numpy as np
from pydantic import BaseModel

from analysis.live.summary import RunSummary
from analysis.signals.header import RunHeader
from analysis.signals.units import RPM
from daq.errors import ConfigError
from daq.reports.errors import (
    ArrowUnavailableError,
    DataNotFoundError,
    InsufficientDataError,
    RequestTooLargeError,
)
from daq.reports.export import encode_samples
from daq.reports.parameters import SampleFormat, SamplesQuery
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.results import ComparisonSchema, PredictionSchema
from daq.schemas.summary import speed_row_schema
from daq.schemas.units import degrees, finite, rpm
from daq.service import rendering
from daq.service.problem_types import ProblemType
from daq.service.problems import JobHint, ProblemError
from daq.service.uploads import ColumnsSchema, columns_schema
from daq.session.processes import WorkerPool, WorkerStoppedError, WorkerTimeoutError
from model.errors import ModelError
from model.prediction.prediction_map import Prediction
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.incoming_run import require_intact
from recordings.errors import DamagedError, ForeignFormatError, UnknownFormatError
from recordings.exchange.formats import read_table

ResultT = TypeVar("ResultT")
TIME_LIMIT = 30.0  # s for one result
NICENESS = 15  # increase, of the worker processes: below the acquisition and the live view
MAX_SPEED_DIFFERENCE = 300.0 * RPM  # rad/s, between the requested speed and a measured bin


class PredictionProvider(Protocol):
    """Source of the model's predictions for a run's rig."""

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s; None if not computed yet, ModelError outside its range."""
        ...


PROBLEMS_BY_ERROR: dict[type[Exception], ProblemType] = {
    DataNotFoundError: ProblemType.NO_DATA,
    RequestTooLargeError: ProblemType.RESPONSE_TOO_LARGE,
    ArrowUnavailableError: ProblemType.NOT_ACCEPTABLE,
    WorkerStoppedError: ProblemType.BUSY,
    WorkerTimeoutError: ProblemType.TIME_LIMIT_EXCEEDED,
    InsufficientDataError: ProblemType.INSUFFICIENT_DATA,
}
VERIFICATION_TIME_LIMIT = 3600.0  # s for the check of an uploaded recording


def result_job_request(run: str, path: str, query: BaseModel | None) -> JobHint:
    """Return the job request for the result of a path."""
    parameters = {} if query is None else query.model_dump(mode="json", exclude_defaults=True)
    return {"kind": "result", "run": run, "path": path, "parameters": parameters}


def read_columns(path: Path, name: str) -> ColumnsSchema:
    """Return the columns of another program's file with this name."""
    return columns_schema(name, read_table(path))


class ResultsReader:
    """Computes results of runs in worker processes, so that no request delays acquisition or live view.

    Parameters
    ----------
    models : PredictionProvider
        The model's predictions.
    processes : int
        Number of worker processes.
    time_limit : float
        Time limit of one result, s; a job has none.
    """

    def __init__(self, models: PredictionProvider, processes: int = 1, time_limit: float = TIME_LIMIT) -> None:
        self._models = models
        self._pool = WorkerPool(processes, NICENESS, time_limit)

    def result(self, run: RunEntry, requested_path: str, query: BaseModel | None, *, gzipped: bool) -> bytes:
        """Return the response body of a path (see `daq.service.rendering`), gzipped if wanted."""
        job = result_job_request(run.id, rendering.result_path(requested_path), query)
        return self._run_in_worker(rendering.result_response, run.path, requested_path, query, gzipped, job=job)

    def samples(self, run: RunEntry, query: SamplesQuery, form: SampleFormat, *, gzipped: bool) -> bytes:
        """Return the samples of a time range."""
        return self._run_in_worker(encode_samples, run.path, query, form, gzipped)

    def summary(self, path: Path) -> RunSummary:
        """Return the summary of the run in a file."""
        return self._run_in_worker(rendering.summary, path, job=result_job_request(path.stem, "summary", None))

    def columns(self, path: Path, name: str) -> ColumnsSchema:
        """Return the columns of another program's file; ProblemError if it cannot be read."""
        try:
            return self._run_in_worker(read_columns, path, name)
        except ForeignFormatError as error:
            raise ProblemError(ProblemType.UNREADABLE_UPLOAD, str(error).replace(str(path), name)) from error

    def require_intact(self, temporary: Path) -> None:
        """Raise ProblemError if an uploaded file is not a complete recording."""
        try:
            self._run_in_worker(require_intact, temporary, time_limit=VERIFICATION_TIME_LIMIT)
        except (DamagedError, UnknownFormatError) as error:
            raise ProblemError(
                ProblemType.INVALID_RECORDING, str(error).replace(str(temporary), "the content")
            ) from error

    def prediction(self, run: RunEntry, speed: float) -> PredictionSchema:
        """Return the model's prediction for a run's rig at a speed, rad/s."""
        return PredictionSchema(run=run.id, predicted=predicted_vibration_schema(self._predicted(run, speed)))

    def comparison(self, run: RunEntry, speed: float) -> ComparisonSchema:
        """Return the measurement nearest to a speed, rad/s, and the prediction at the measured speed."""
        rows = self.summary(run.path).rows
        row = min(rows, key=lambda row: abs(row.speed - speed), default=None)
        if row is None or abs(row.speed - speed) > MAX_SPEED_DIFFERENCE:
            raise ProblemError(
                ProblemType.NO_DATA,
                f"no measurement within {rpm(MAX_SPEED_DIFFERENCE):.0f} r/min of {rpm(speed):,.0f} r/min",
            )
        prediction = self._predicted(run, row.speed)
        measured, predicted = row.motion[0], prediction.vectors[0]
        is_predicted = np.abs(predicted) > 0.0
        ratio = np.where(is_predicted, np.abs(measured) / np.where(is_predicted, np.abs(predicted), 1.0), np.nan)
        lag_difference = np.where(is_predicted, -np.angle(measured * np.conj(predicted)), np.nan)
        return ComparisonSchema(
            run=run.id,
            measured=speed_row_schema(row),
            predicted=predicted_vibration_schema(prediction),
            amplitude_ratio_x=finite(ratio[0]),
            amplitude_ratio_y=finite(ratio[1]),
            lag_difference_x_deg=degrees(lag_difference[0]),
            lag_difference_y_deg=degrees(lag_difference[1]),
        )

    def _predicted(self, run: RunEntry, speed: float) -> Prediction:
        if run.header is None:
            raise ProblemError(
                ProblemType.MODEL_NOT_READY, f"run {run.id}: the header with its rig cannot be read: {run.fault}"
            )
        try:
            prediction = self._models.prediction_for(run.header, speed)
        except (ModelError, ConfigError) as error:  # outside the map's speeds, or a rig without a model
            raise ProblemError(ProblemType.NO_DATA, str(error)) from error
        if prediction is None:
            raise ProblemError(ProblemType.MODEL_NOT_READY, "the model's map of this rig is being computed")
        return prediction

    def _run_in_worker(
        self,
        function: Callable[..., ResultT],
        *arguments: object,
        time_limit: float | None = None,
        job: JobHint | None = None,
    ) -> ResultT:
        try:
            return self._pool.run(function, *arguments, time_limit=time_limit)
        except tuple(PROBLEMS_BY_ERROR) as error:
            is_timeout = isinstance(error, WorkerTimeoutError)
            detail = f"{error}; POST `job` to /api/v1/jobs" if is_timeout and job else str(error)
            raise ProblemError(PROBLEMS_BY_ERROR[type(error)], detail, job=job if is_timeout else None) from error

    def close(self) -> None:
        """Stop the worker processes."""
        self._pool.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
