"""What jobs do; each function is the work of a process of its own and writes its result to a file.

Words on how a job goes, no more often than anybody looks.
"""

import math
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis.signals.header import Calibration, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rotor import model_parameters
from daq.reports.analysis_export import encode_analysis, run_analysis
from daq.reports.parameters import AnalysisForm, AnalysisQuery
from daq.reports.run_history import read_history
from daq.reports.run_summaries import ProgressCallback, Summaries
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.runs import index_report_schema
from daq.schemas.units import Schema
from daq.schemas.verification import recovery_schema, verification_schema
from daq.service.jobs.queue import CatalogueLocation, Progress, ReportProgress
from daq.service.jobs.schemas import PredictionMapSchema
from daq.service.rendering import document_of
from daq.session.offline import summarise
from daq.session.prediction.map_cache import CachedPredictionMap, CachedPredictionMaps
from recordings.catalogue.incoming_run import move_without_overwriting
from recordings.errors import ForeignFormatError, RunExistsError, StorageError
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import write_table
from recordings.exchange.table import Table
from recordings.integrity.recover import recover
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader

PAUSE = 0.1  # s between two words on how it goes


class ProgressThrottle:
    """Tells no more often than anybody looks.

    Parameters
    ----------
    tell : Tell
        Who is told.
    """

    def __init__(self, tell: ReportProgress) -> None:
        self._tell = tell
        self._doing = ""
        self._told = -math.inf

    def words(self, doing: str, part: float | None) -> None:
        """Tell what is done, and what part of it, 0 to 1; None where that cannot be told."""
        now = time.monotonic()
        if doing != self._doing or now - self._told >= PAUSE:
            self._doing, self._told = doing, now
            self._tell(Progress(doing, part))


def parts_told(tell: ReportProgress, doing: str) -> Callable[[float], None]:
    """Return what takes the part of something that is done, 0 to 1, and tells it."""
    words = ProgressThrottle(tell).words
    return lambda part: words(doing, part)


RESERVE = 1024**3  # bytes that stay free on the disk: a run may be recorded on it
BYTES_A_NUMBER = 24  # at most, in any form


def answer(tell: ReportProgress, target: Path, path: Path, what: str, query: object) -> None:
    """Make the document of an address of a run's results."""
    found = read_history(path, parts_told(tell, "reading"))
    tell(Progress("putting together"))
    _write(target, document_of(path, what, query, found))


def analysis(tell: ReportProgress, target: Path, path: Path, kind: str, query: AnalysisQuery) -> None:
    """Analyse a run's samples as a whole, in the form that the target's suffix tells."""
    run, made = run_analysis(path, kind, query, _waiting(tell))
    tell(Progress("writing"))
    target.write_bytes(encode_analysis(made, run, kind, AnalysisForm(target.suffix.removeprefix("."))))


def summary(tell: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Sum a run up and keep its summary."""
    _write(target, Summaries(location.catalogue(), CachedPredictionMaps()).summary_with_agreement(run, _waiting(tell)))


def analyse(
    tell: ReportProgress, target: Path, location: CatalogueLocation, run: str, calibrations: Mapping[str, Calibration]
) -> None:
    """Analyse a run's samples anew."""
    _write(
        target,
        Summaries(location.catalogue(), CachedPredictionMaps()).recalibrated_summary(run, calibrations, _waiting(tell)),
    )


def predict(tell: ReportProgress, target: Path, header: RunHeader, changes: Mapping[str, float]) -> None:
    """Compute the model over speed for the rig of a run, with other values of its `[model]`."""
    config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
    config = config.model_copy(update={"model": config.model.model_copy(update=dict(changes))})
    parts = parts_told(tell, "computing speed by speed")
    wanted = CachedPredictionMap(model_parameters(config), header.settings, header.limits)
    found = wanted.computed(lambda done, total: parts(done / total))
    by_speed = tuple(predicted_vibration_schema(found.at(speed)) for speed in found.speeds.tolist())
    _write(target, PredictionMapSchema(run=header.run, by_speed=by_speed))


def export(tell: ReportProgress, target: Path, path: Path, made: Callable[..., Table], part: Mapping[str, Any]) -> None:
    """Write a run or a part of it in the form of another program."""
    with RunReader(path) as reader:
        table = made(reader, **part, on_progress=parts_told(tell, "reading"))
    size, free = BYTES_A_NUMBER * table.n_rows * len(table.columns), shutil.disk_usage(target.parent).free
    if size > free - RESERVE:
        raise StorageError(f"{target.name}: up to {size:,} bytes, expected at most {max(free - RESERVE, 0):,}")
    doing = f"writing {table.n_rows:,} rows"
    tell(Progress(doing, 0.0))
    try:
        write_table(target, table, parts_told(tell, doing))
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(target), target.name)) from error


def verification(tell: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Look through a recording's file and keep the verdict."""
    catalogue = location.catalogue()
    found = verify(catalogue.path(run), parts_told(tell, "verifying"))
    catalogue.store_verdict(run, found.verdict.value)
    _write(target, verification_schema(found))


def recovery(tell: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Copy what is intact of a recording; the copy is listed when it is whole."""
    tell(Progress("copying what is intact"))
    catalogue = location.catalogue()
    copy = catalogue.path_for(f"{run}-recovered")
    if copy.exists():
        raise RunExistsError(f"{copy.name}: a run of this name exists already")
    temporary = target.with_name(copy.name)
    found = recover(catalogue.path(run), temporary)
    move_without_overwriting(temporary, copy)
    _write(target, recovery_schema(replace(found, target=copy)))


def index(tell: ReportProgress, target: Path, location: CatalogueLocation, verifying: bool) -> None:  # noqa: FBT001 - sent through a pipe
    """Bring the catalogue up to date."""
    report = location.catalogue().index(
        summarise, verify_files=verifying, on_status=lambda words: tell(Progress(words))
    )
    _write(target, index_report_schema(report))


def part_of(start: float, stop: float | None, segment: int | None) -> dict[str, Any]:
    """Return which part of a run is exported, as `samples_table` and `results_table` take it."""
    return {"start": start, "stop": math.inf if stop is None else stop, "segment": segment}


TABLES = {"samples": samples_table, "results": results_table, "pulses": pulses_table}


def _write(target: Path, document: Schema) -> None:
    target.write_text(document.model_dump_json(), encoding="utf-8")


def _waiting(tell: ReportProgress) -> ProgressCallback:
    return ProgressThrottle(tell).words
