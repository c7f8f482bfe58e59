"""Results of recorded runs, computed from their files in worker processes."""

import gzip
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from analysis.live.summary import RunSummary
from analysis.signals.units import RPM
from daq.errors import ConfigError
from daq.reports.export import SampleFormat, SamplesQuery, analysis_body, encode_samples
from daq.reports.parameters import AnalysisQuery, QueryParameters, TrendQuery
from daq.reports.recorded_results import findings_schema, trend_schema
from daq.reports.run_history import RunHistory, file_status, load_history
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.results import ComparisonSchema, PredictionSchema
from daq.schemas.summary import speed_row_schema
from daq.schemas.units import Schema, degrees, finite, rpm
from daq.service.problems import JobHint, ProblemError, ProblemType
from daq.service.uploads import ColumnsSchema, columns_schema
from daq.session.predictor import Predictors
from daq.session.processes import WorkerPool, WorkerTimeoutError
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
VERIFICATION_TIME_LIMIT = 3600.0  # s for the check of an uploaded recording
RESPONSE_CACHE_SIZE = 128
GZIP_LEVEL = 4  # higher levels take more time and save almost nothing
ANALYSIS_PREFIX = "analyses/"


def result_schema(query: QueryParameters, history: RunHistory) -> Schema:
    """Return the trend for its query; for another query the findings, which take no parameters."""
    return trend_schema(history, query) if isinstance(query, TrendQuery) else findings_schema(history)


def result_body(path: Path, name: str, query: QueryParameters, gzipped: bool) -> bytes:  # noqa: FBT001 - sent through a pipe
    """Return a response's content: an analysis in the format of its query, or another result as JSON."""
    status = file_status(path)
    return _cached_body(path, status.st_size, status.st_mtime_ns, name, query, gzipped)


@lru_cache(maxsize=RESPONSE_CACHE_SIZE)
def _cached_body(
    path: Path,
    _size: int,
    _modified_ns: int,
    name: str,
    query: QueryParameters,
    gzipped: bool,  # noqa: FBT001 - part of the cache key
) -> bytes:
    if isinstance(query, AnalysisQuery):
        body = analysis_body(path, name.removeprefix(ANALYSIS_PREFIX), query)
    else:
        body = result_schema(query, load_history(path)).model_dump_json().encode()
    return gzip.compress(body, GZIP_LEVEL, mtime=0) if gzipped else body


def read_summary(path: Path) -> RunSummary:
    """Return the summary of the run in a file."""
    return load_history(path).summary


def read_columns(path: Path, name: str) -> ColumnsSchema:
    """Return the columns of another program's file with this name."""
    return columns_schema(name, read_table(path))


class ResultsReader:
    """Computes results of runs in worker processes, so that no request delays acquisition or live view.

    Parameters
    ----------
    models : Predictors
        The model's predictions.
    time_limit : float
        Time limit of one result, s; a job has none.
    """

    def __init__(self, models: Predictors, time_limit: float = TIME_LIMIT) -> None:
        self._models = models
        self._pool = WorkerPool(1, NICENESS, time_limit)

    def result(self, run: RunEntry, name: str, query: QueryParameters, *, gzipped: bool) -> bytes:
        """Return the content of the response for a path below that of the run, gzipped if wanted."""
        parameters = query.model_dump(mode="json", exclude_defaults=True)
        return self._run_in_worker(
            result_body, run.path, name, query, gzipped, job=_result_job(run.id, name, **parameters)
        )

    def samples(self, run: RunEntry, query: SamplesQuery, form: SampleFormat, *, gzipped: bool) -> bytes:
        """Return the samples of a time range."""
        return self._run_in_worker(encode_samples, run.path, query, form, gzipped)

    def summary(self, path: Path) -> RunSummary:
        """Return the summary of the run in a file."""
        return self._run_in_worker(read_summary, path, job=_result_job(path.stem, "summary"))

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
        except WorkerTimeoutError as error:
            if job is None:
                raise
            detail = f"{error}; POST `job` to /api/v1/jobs"
            raise ProblemError(ProblemType.TIME_LIMIT_EXCEEDED, detail, job=job) from error

    def close(self) -> None:
        """Stop the worker processes."""
        self._pool.close()


def _result_job(run: str, path: str, **parameters: object) -> JobHint:
    """Return the job request for a result."""
    return {"kind": "result", "run": run, "path": path, "parameters": parameters}
