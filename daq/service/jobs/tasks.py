"""Tasks of the job queue, made from job requests."""

from collections.abc import Mapping
from functools import partial
from typing import Final

from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from analysis.signals.header import Calibration, RunHeader
from daq.config.calibration import to_calibration
from daq.errors import ConfigError, UsageError
from daq.reports.parameters import (
    AnalysisFormat,
    AnalysisQuery,
    FrameQuery,
    QueryParameters,
    RecordedCascadeQuery,
    RecordedWaterfallQuery,
    TrendQuery,
)
from daq.reports.registry import KINDS
from daq.service.jobs import execution
from daq.service.jobs.queue import CatalogueLocation, Task
from daq.service.jobs.schemas import (
    ANALYSIS_PREFIX,
    ExportRequest,
    IndexRequest,
    PredictionRequest,
    ReanalysisRequest,
    RecordedResult,
    RecoveryRequest,
    ResultRequest,
    RunJobRequest,
    VerificationRequest,
)
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.offline import corrected_header
from recordings.catalogue.catalogue import RunEntry

RESULT_QUERIES: Final[Mapping[str, type[QueryParameters]]] = {
    RecordedResult.TREND: TrendQuery,
    RecordedResult.CASCADE: RecordedCascadeQuery,
    RecordedResult.WATERFALL: RecordedWaterfallQuery,
    RecordedResult.ORDER_SPECTRUM: FrameQuery,
    RecordedResult.FULL_SPECTRUM: FrameQuery,
    RecordedResult.ORBIT: FrameQuery,
    **{f"{ANALYSIS_PREFIX}{name}": kind.parameters for name, kind in KINDS.items()},
}


def index_task(request: IndexRequest, location: CatalogueLocation) -> Task:
    """Return the task of a catalogue update."""
    title = "catalogue, with verification" if request.verify else "catalogue"
    return Task(request.kind, title, "", execution.index_job, (location, request.verify), "index.json")


def run_task(request: RunJobRequest, entry: RunEntry, location: CatalogueLocation) -> Task:
    """Return the task of a job request for a run.

    Raises
    ------
    ProblemError, RequestValidationError
        The request is not possible for this run.
    """
    run, path = entry.id, entry.path
    arguments: tuple[object, ...]
    task = partial(Task, request.kind, run=run)
    match request:
        case ResultRequest(path=RecordedResult.SUMMARY):
            _query(request)
            return task(f"summary of {run}", work=execution.summary_job, arguments=(location, run), file="summary.json")
        case ResultRequest(path=result_path) if isinstance(query := _query(request), AnalysisQuery):
            kind, file_format = result_path.removeprefix(ANALYSIS_PREFIX), query.format or AnalysisFormat.JSON
            return task(
                f"{kind} of {run}",
                work=execution.analysis_job,
                arguments=(path, kind, query),
                file=f"{kind}.{file_format}",
            )
        case ResultRequest(path=result_path):
            arguments = (path, result_path, _query(request))
            return task(
                f"{result_path} of {run}", work=execution.result_job, arguments=arguments, file=f"{result_path}.json"
            )
        case ReanalysisRequest():
            arguments = (location, run, _calibrations(request, entry))
            return task(f"reanalysis of {run}", work=execution.reanalysis_job, arguments=arguments, file="summary.json")
        case PredictionRequest():
            changes = request.model_dump(exclude={"kind", "run"}, exclude_none=True)
            changed = "".join(f", {name} {value:g}" for name, value in changes.items())
            arguments = (header_of(entry), changes)
            return task(
                f"model of {run}{changed}", work=execution.prediction_job, arguments=arguments, file="prediction.json"
            )
        case ExportRequest(format=file_format):
            selection = execution.export_selection(request.from_s, request.until_s, request.segment)
            arguments = (path, execution.TABLES[request.content], selection)
            return task(
                f"{request.content} of {run} as {file_format}",
                work=execution.export_job,
                arguments=arguments,
                file=f"{run}.{file_format}",
            )
        case VerificationRequest():
            file = "verification.json"
            return task(f"verification of {run}", work=execution.verification_job, arguments=(location, run), file=file)
        case RecoveryRequest():
            return task(
                f"recovery of {run}", work=execution.recovery_job, arguments=(location, run), file="recovery.json"
            )


def _query(request: ResultRequest) -> QueryParameters | None:
    """Return the validated query parameters of a result; RequestValidationError if they are invalid."""
    query_class = RESULT_QUERIES.get(request.path, QueryParameters)
    try:
        query = query_class.model_validate(request.parameters)
    except ValidationError as error:
        faults = [{**fault, "loc": ("body", "parameters", *fault["loc"])} for fault in error.errors()]
        raise RequestValidationError(faults) from error
    return query if request.path in RESULT_QUERIES else None


def _calibrations(request: ReanalysisRequest, entry: RunEntry) -> dict[str, Calibration]:
    """Return the calibrations of a request; ProblemError if they do not fit this run."""
    try:
        calibrations = {
            name: to_calibration(record, f"calibrations.{name}") for name, record in request.calibrations.items()
        }
        corrected_header(header_of(entry), calibrations)
    except (ConfigError, UsageError) as error:
        raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
    return calibrations


def header_of(entry: RunEntry) -> RunHeader:
    """Return a run's header; ProblemError if it cannot be read."""
    if entry.header is None:
        raise ProblemError(ProblemType.RUN_DAMAGED, f"run {entry.id}: {entry.fault}")
    return entry.header
