"""What is asked of recorded runs, answered from their files by processes of their own."""

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, TypeVar

import numpy as np
from pydantic import BaseModel

from analysis.live.summary import RunSummary
from analysis.signals.header import RunHeader
from daq.errors import RigError
from daq.reports.errors import (
    ArrowUnavailableError,
    DataNotFoundError,
    InsufficientDataError,
    PngUnavailableError,
    RequestTooLargeError,
)
from daq.reports.parameters import SampleFormat, SamplesQuery
from daq.reports.sample_export import encode_samples
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.results import ComparisonSchema, PredictionSchema
from daq.schemas.summary import speed_row_schema
from daq.schemas.units import degrees, finite, rpm
from daq.service import rendering as answers
from daq.service.problem_types import ProblemType
from daq.service.problems import JobHint, ProblemError
from daq.service.schemas.uploads import ColumnsSchema, columns_schema
from daq.service.worker_pool import TIME_LIMIT, WorkerPool, WorkerStoppedError, WorkerTimeoutError
from model.prediction.prediction_map import Prediction
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.incoming_run import require_sound
from recordings.errors import DamagedError, ForeignFormatError, UnknownFormatError
from recordings.exchange.formats import read_table

T = TypeVar("T")
RPM = np.pi / 30.0
NEAR_SPEED = 300.0 * RPM  # rad/s: a measured bin further than this from the speed asked for is none of it


class Models(Protocol):
    """The model's predictions by the rigs of runs."""

    def prediction_for(self, header: RunHeader, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s; None where there is none yet, ValueError outside its range."""
        ...


FAILURES: dict[type[Exception], ProblemType] = {
    DataNotFoundError: ProblemType.NO_DATA,
    RequestTooLargeError: ProblemType.RESPONSE_TOO_LARGE,
    ArrowUnavailableError: ProblemType.NOT_ACCEPTABLE,
    PngUnavailableError: ProblemType.NOT_ACCEPTABLE,
    WorkerStoppedError: ProblemType.BUSY,
    WorkerTimeoutError: ProblemType.TIME_LIMIT_EXCEEDED,
    InsufficientDataError: ProblemType.INSUFFICIENT_DATA,
}
ARRIVAL_LIMIT = 3600.0  # s that looking through a recording that was sent in may take


def result_job(run: str, path: str, query: BaseModel | None) -> JobHint:
    """Return the order for a job that makes the answer of an address."""
    parameters = {} if query is None else query.model_dump(mode="json", exclude_defaults=True)
    return {"kind": "result", "run": run, "path": path, "parameters": parameters}


def foreign_columns(path: Path, name: str) -> ColumnsSchema:
    """Return what is in another program's file of a name."""
    return columns_schema(name, read_table(path))


class ResultsReader:
    """Answers about runs; made by reading processes, so that no request holds up an acquisition or a live view.

    Parameters
    ----------
    models : Models
        The model's predictions.
    processes : int
        How many answers are made at once.
    deadline : float
        How long one may take, s; longer work is a job.
    """

    def __init__(self, models: Models, processes: int = 1, time_limit: float = TIME_LIMIT) -> None:
        self._models = models
        self._processes = WorkerPool(processes, time_limit)

    def answer(self, run: RunEntry, what: str, query: BaseModel | None, *, packed: bool) -> bytes:
        """Return the answer of this name (see `daq.service.rendering`) as JSON, gzipped where it is `packed`."""
        job = result_job(run.id, answers.address_of(what), query)
        return self._run(answers.answer_of, run.path, what, query, packed, job=job)

    def samples(self, run: RunEntry, query: SamplesQuery, form: SampleFormat, *, packed: bool) -> bytes:
        """Return a stretch of samples."""
        return self._run(encode_samples, run.path, query, form, packed)

    def summary(self, path: Path) -> RunSummary:
        """Return what the run of a file was."""
        return self._run(answers.summary, path, job=result_job(path.stem, "summary", None))

    def columns(self, path: Path, name: str) -> ColumnsSchema:
        """Return what is in another program's file; ProblemError where it cannot be read."""
        try:
            return self._run(foreign_columns, path, name)
        except ForeignFormatError as error:
            raise ProblemError(ProblemType.UNREADABLE_UPLOAD, str(error).replace(str(path), name)) from error

    def require_sound(self, temporary: Path) -> None:
        """Raise ProblemError where a file that was sent in is no whole recording."""
        try:
            self._run(require_sound, temporary, time_limit=ARRIVAL_LIMIT)
        except (DamagedError, UnknownFormatError) as error:
            raise ProblemError(
                ProblemType.INVALID_RECORDING, str(error).replace(str(temporary), "what was sent")
            ) from error

    def prediction(self, run: RunEntry, speed: float) -> PredictionSchema:
        """Return what the model says of a run's rig at a speed, rad/s."""
        return PredictionSchema(run=run.id, predicted=predicted_vibration_schema(self._predicted(run, speed)))

    def comparison(self, run: RunEntry, speed: float) -> ComparisonSchema:
        """Return the measurement nearest to a speed, rad/s, beside the prediction at the measured speed."""
        rows = self.summary(run.path).rows
        row = min(rows, key=lambda row: abs(row.speed - speed), default=None)
        if row is None or abs(row.speed - speed) > NEAR_SPEED:
            raise ProblemError(ProblemType.NO_DATA, f"nothing was measured near {rpm(speed):,.0f} r/min")
        prediction = self._predicted(run, row.speed)
        measured, predicted = row.motion[0], prediction.vectors[0]
        seen = np.abs(predicted) > 0.0
        ratio = np.where(seen, np.abs(measured) / np.where(seen, np.abs(predicted), 1.0), np.nan)
        later = np.where(seen, -np.angle(measured * np.conj(predicted)), np.nan)
        return ComparisonSchema(
            run=run.id,
            measured=speed_row_schema(row),
            predicted=predicted_vibration_schema(prediction),
            amplitude_ratio_x=finite(ratio[0]),
            amplitude_ratio_y=finite(ratio[1]),
            lag_difference_x_deg=degrees(later[0]),
            lag_difference_y_deg=degrees(later[1]),
        )

    def _predicted(self, run: RunEntry, speed: float) -> Prediction:
        if run.header is None:
            raise ProblemError(ProblemType.MODEL_NOT_READY, f"run {run.id}: its rig is not known: {run.fault}")
        try:
            prediction = self._models.prediction_for(run.header, speed)
        except (ValueError, RigError) as error:  # outside the model's speeds, or a rig that has no model
            raise ProblemError(ProblemType.NO_DATA, str(error)) from error
        if prediction is None:
            raise ProblemError(ProblemType.MODEL_NOT_READY, "the model's map of this rig is being computed")
        return prediction

    def _run(
        self, work: Callable[..., T], *arguments: object, time_limit: float | None = None, job: JobHint | None = None
    ) -> T:
        try:
            return self._processes.run(work, *arguments, time_limit=time_limit)
        except tuple(FAILURES) as error:
            is_overdue = isinstance(error, WorkerTimeoutError)
            detail = f"{error}; POST `job` to /api/v1/jobs" if is_overdue and job else str(error)
            raise ProblemError(FAILURES[type(error)], detail, job=job if is_overdue else None) from error

    def close(self) -> None:
        """End the processes."""
        self._processes.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
