"""From an order to what a job does."""

from collections.abc import Mapping
from functools import partial
from typing import Final

from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from analysis.signals.header import Calibration, RunHeader
from daq.config.calibration import to_calibration
from daq.errors import ConfigError, UsageError
from daq.reports.parameters import (
    AnalysisForm,
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
    ExportRequest,
    IndexRequest,
    PredictionRequest,
    ReanalysisRequest,
    RecoveryRequest,
    ResultPath,
    ResultRequest,
    RunJobRequest,
    VerificationRequest,
)
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.offline import corrected_header
from recordings.catalogue.catalogue import RunEntry

ANALYSES: Final = "analyses/"
QUESTIONS: Final[Mapping[ResultPath, type[QueryParameters]]] = {
    ResultPath.TREND: TrendQuery,
    ResultPath.CASCADE: RecordedCascadeQuery,
    ResultPath.WATERFALL: RecordedWaterfallQuery,
    ResultPath.ORDER_SPECTRUM: FrameQuery,
    ResultPath.FULL_SPECTRUM: FrameQuery,
    ResultPath.ORBIT: FrameQuery,
    **{ResultPath(f"{ANALYSES}{name}"): kind.parameters for name, kind in KINDS.items()},
}


def index_task(request: IndexRequest, location: CatalogueLocation) -> Task:
    """Return what an order is to do that is about no run."""
    about = "catalogue, with verification" if request.verify else "catalogue"
    return Task(request.kind, about, "", execution.index, (location, request.verify), "index.json")


def run_task(request: RunJobRequest, entry: RunEntry, location: CatalogueLocation) -> Task:
    """Return what an order is to do with a run.

    Raises
    ------
    ProblemError, RequestValidationError
        It cannot be done with this run.
    """
    run, path = entry.id, entry.path
    task = partial(Task, request.kind, run=run)
    match request:
        case ResultRequest(path=ResultPath.SUMMARY):
            _asked(request)
            return task(f"summary of {run}", work=execution.summary, arguments=(location, run), file="summary.json")
        case ResultRequest(path=result_path) if isinstance(query := _asked(request), AnalysisQuery):
            kind, form = result_path.removeprefix(ANALYSES), query.format or AnalysisForm.JSON
            return task(
                f"{kind} of {run}", work=execution.analysis, arguments=(path, kind, query), file=f"{kind}.{form}"
            )
        case ResultRequest(path=result_path):
            asked = (path, result_path.value, _asked(request))
            return task(f"{result_path} of {run}", work=execution.answer, arguments=asked, file=f"{result_path}.json")
        case ReanalysisRequest():
            given = (location, run, _calibrations(request, entry))
            return task(f"{run} analysed anew", work=execution.analyse, arguments=given, file="summary.json")
        case PredictionRequest():
            changes = request.model_dump(exclude={"kind", "run"}, exclude_none=True)
            words = "".join(f", {name} {value:g}" for name, value in changes.items())
            wanted = (header_of(entry), changes)
            return task(f"model of {run}{words}", work=execution.predict, arguments=wanted, file="prediction.json")
        case ExportRequest(format=form):
            part = execution.part_of(request.from_s, request.until_s, request.segment)
            cut = (path, execution.TABLES[request.content], part)
            return task(
                f"{request.content} of {run} as {form}", work=execution.export, arguments=cut, file=f"{run}.{form}"
            )
        case VerificationRequest():
            file = "verification.json"
            return task(f"verification of {run}", work=execution.verification, arguments=(location, run), file=file)
        case RecoveryRequest():
            return task(f"recovery of {run}", work=execution.recovery, arguments=(location, run), file="recovery.json")


def _asked(request: ResultRequest) -> QueryParameters | None:
    """Return the parameters of an address as its question; RequestValidationError where they are none."""
    form = QUESTIONS.get(request.path, QueryParameters)
    try:
        question = form.model_validate(request.parameters)
    except ValidationError as error:
        faults = [{**fault, "loc": ("body", "parameters", *fault["loc"])} for fault in error.errors()]
        raise RequestValidationError(faults) from error
    return question if request.path in QUESTIONS else None


def _calibrations(request: ReanalysisRequest, entry: RunEntry) -> dict[str, Calibration]:
    """Return the calibrations of an order; ProblemError where they are none for this run."""
    try:
        given = {name: to_calibration(record, f"calibrations.{name}") for name, record in request.calibrations.items()}
        corrected_header(header_of(entry), given)
    except (ConfigError, UsageError) as error:
        raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
    return given


def header_of(entry: RunEntry) -> RunHeader:
    """Return a run's header; ProblemError where it cannot be read."""
    if entry.header is None:
        raise ProblemError(ProblemType.RUN_DAMAGED, f"run {entry.id}: {entry.fault}")
    return entry.header
