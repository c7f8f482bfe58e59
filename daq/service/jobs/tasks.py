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
    Asked,
    At,
    Question,
    RecordedCascadeQuery,
    RecordedWaterfallQuery,
    TrendQuery,
)
from daq.reports.registry import KINDS
from daq.service.jobs import execution
from daq.service.jobs.queue import CatalogueLocation, Task
from daq.service.jobs.schemas import (
    Address,
    AnalysisOrder,
    AnswerOrder,
    ExportOrder,
    IndexOrder,
    PredictionOrder,
    RecoveryOrder,
    RunOrder,
    VerificationOrder,
)
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.session.offline import corrected_header
from recordings.catalogue.catalogue import RunEntry

ANALYSES: Final = "analyses/"
QUESTIONS: Final[Mapping[Address, type[Question]]] = {
    Address.TREND: TrendQuery,
    Address.CASCADE: RecordedCascadeQuery,
    Address.WATERFALL: RecordedWaterfallQuery,
    Address.ORDER_SPECTRUM: At,
    Address.FULL_SPECTRUM: At,
    Address.ORBIT: At,
    **{Address(f"{ANALYSES}{name}"): kind.question for name, kind in KINDS.items()},
}


def index_task(order: IndexOrder, place: CatalogueLocation) -> Task:
    """Return what an order is to do that is about no run."""
    about = "catalogue, with verification" if order.verify else "catalogue"
    return Task(order.kind, about, "", execution.index, (place, order.verify), "index.json")


def run_task(order: RunOrder, entry: RunEntry, place: CatalogueLocation) -> Task:
    """Return what an order is to do with a run.

    Raises
    ------
    ProblemError, RequestValidationError
        It cannot be done with this run.
    """
    run, path = entry.id, entry.path
    task = partial(Task, order.kind, run=run)
    match order:
        case AnswerOrder(address=Address.SUMMARY):
            _asked(order)
            return task(f"summary of {run}", work=execution.summary, arguments=(place, run), file="summary.json")
        case AnswerOrder(address=address) if isinstance(query := _asked(order), Asked):
            kind, form = address.removeprefix(ANALYSES), query.format or AnalysisForm.JSON
            return task(
                f"{kind} of {run}", work=execution.analysis, arguments=(path, kind, query), file=f"{kind}.{form}"
            )
        case AnswerOrder(address=address):
            asked = (path, address.value, _asked(order))
            return task(f"{address} of {run}", work=execution.answer, arguments=asked, file=f"{address}.json")
        case AnalysisOrder():
            given = (place, run, _calibrations(order, entry))
            return task(f"{run} analysed anew", work=execution.analyse, arguments=given, file="summary.json")
        case PredictionOrder():
            changes = order.model_dump(exclude={"kind", "run"}, exclude_none=True)
            words = "".join(f", {name} {value:g}" for name, value in changes.items())
            wanted = (header_of(entry), changes)
            return task(f"model of {run}{words}", work=execution.predict, arguments=wanted, file="prediction.json")
        case ExportOrder(format=form):
            part = execution.part_of(order.from_s, order.until_s, order.segment)
            cut = (path, execution.TABLES[order.content], part)
            return task(
                f"{order.content} of {run} as {form}", work=execution.export, arguments=cut, file=f"{run}.{form}"
            )
        case VerificationOrder():
            file = "verification.json"
            return task(f"verification of {run}", work=execution.verification, arguments=(place, run), file=file)
        case RecoveryOrder():
            return task(f"recovery of {run}", work=execution.recovery, arguments=(place, run), file="recovery.json")


def _asked(order: AnswerOrder) -> Question | None:
    """Return the parameters of an address as its question; RequestValidationError where they are none."""
    form = QUESTIONS.get(order.address, Question)
    try:
        question = form.model_validate(order.parameters)
    except ValidationError as error:
        faults = [{**fault, "loc": ("body", "parameters", *fault["loc"])} for fault in error.errors()]
        raise RequestValidationError(faults) from error
    return question if order.address in QUESTIONS else None


def _calibrations(order: AnalysisOrder, entry: RunEntry) -> dict[str, Calibration]:
    """Return the calibrations of an order; ProblemError where they are none for this run."""
    try:
        given = {name: to_calibration(record, f"calibrations.{name}") for name, record in order.calibrations.items()}
        corrected_header(header_of(entry), given)
    except (ConfigError, UsageError) as error:
        raise ProblemError(ProblemType.BAD_PARAMETER, str(error)) from error
    return given


def header_of(entry: RunEntry) -> RunHeader:
    """Return a run's header; ProblemError where it cannot be read."""
    if entry.header is None:
        raise ProblemError(ProblemType.RUN_DAMAGED, f"run {entry.id}: {entry.fault}")
    return entry.header
