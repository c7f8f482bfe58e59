"""The functions that jobs run in a worker process; each writes its result to a file and reports its progress."""

import math
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis.signals.header import Calibration, RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import model_parameters
from daq.reports.export import encode_analysis, run_analysis
from daq.reports.parameters import AnalysisFormat, AnalysisQuery
from daq.reports.run_history import read_history
from daq.reports.run_summaries import Summaries
from daq.schemas.checks import RecoverySchema, VerificationSchema
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.runs import IndexReportSchema
from daq.schemas.units import Schema
from daq.service.jobs.queue import CatalogueLocation, Progress, ReportProgress
from daq.service.jobs.schemas import PredictionMapSchema
from daq.service.rendering import result_schema
from daq.session.offline import summarise
from daq.session.prediction_maps import load_or_compute, map_file
from daq.session.predictor import Predictors
from model.prediction.prediction_map import default_map_speeds
from recordings.errors import ForeignFormatError, RunExistsError, StorageError
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import write_table
from recordings.exchange.table import Table
from recordings.file_operations import move_without_overwriting
from recordings.integrity.recover import recover
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader

REPORT_INTERVAL = 0.1  # s between two progress reports of one step
DISK_RESERVE = 1024**3  # bytes that stay free on the disk for a recording
MAX_BYTES_PER_NUMBER = 24  # in any export format


class ProgressThrottle:
    """Limits the rate of progress reports; a new step is always reported.

    Parameters
    ----------
    report : ReportProgress
        Receives the reports.
    """

    def __init__(self, report: ReportProgress) -> None:
        self._report = report
        self._step = ""
        self._reported_at = -math.inf

    def report(self, step: str, fraction: float | None) -> None:
        """Report a step and its completed fraction, 0 to 1; None if unknown."""
        now = time.monotonic()
        if step != self._step or now - self._reported_at >= REPORT_INTERVAL:
            self._step, self._reported_at = step, now
            self._report(Progress(step, fraction))


def fraction_reporter(report: ReportProgress, step: str) -> Callable[[float], None]:
    """Return a function that reports the completed fraction of a step, 0 to 1."""
    throttle = ProgressThrottle(report)
    return lambda fraction: throttle.report(step, fraction)


def result_job(report: ReportProgress, target: Path, path: Path, requested_path: str, query: object) -> None:
    """Write the result of a run that the REST path ``requested_path`` returns."""
    history = read_history(path, fraction_reporter(report, "reading"))
    report(Progress("putting together"))
    write_json(target, result_schema(path, requested_path, query, history))


def analysis_job(report: ReportProgress, target: Path, path: Path, kind: str, query: AnalysisQuery) -> None:
    """Write an analysis of a run's samples, in the format of the target's suffix."""
    run, analysis = run_analysis(path, kind, query, ProgressThrottle(report).report)
    report(Progress("writing"))
    file_format = AnalysisFormat(target.suffix.removeprefix("."))
    write_result(target, encode_analysis(analysis, run, kind, file_format, query.plot_style()))


def summary_job(report: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Write a run's summary and cache it."""
    summaries = Summaries(location.catalogue(), Predictors(in_worker=True))
    write_json(target, summaries.summary_with_agreement(run, ProgressThrottle(report).report))


def reanalysis_job(
    report: ReportProgress, target: Path, location: CatalogueLocation, run: str, calibrations: Mapping[str, Calibration]
) -> None:
    """Write the summary of a run analysed again with corrected calibrations."""
    summaries = Summaries(location.catalogue(), Predictors(in_worker=True))
    write_json(target, summaries.recalibrated_summary(run, calibrations, ProgressThrottle(report).report))


def prediction_job(report: ReportProgress, target: Path, header: RunHeader, changes: Mapping[str, float]) -> None:
    """Write the model's prediction over speed for a run's rig, with changed values of its `[model]`."""
    config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
    config = config.model_copy(update={"model": config.model.model_copy(update=dict(changes))})
    report_fraction = fraction_reporter(report, "computing speed by speed")
    model = model_parameters(config), default_map_speeds(header.limits.speed), header.settings
    prediction_map = load_or_compute(lambda done, total: report_fraction(done / total), map_file(*model), *model)
    by_speed = tuple(predicted_vibration_schema(prediction_map.at(speed)) for speed in prediction_map.speeds.tolist())
    write_json(target, PredictionMapSchema(run=header.run, by_speed=by_speed))


def export_job(
    report: ReportProgress, target: Path, path: Path, to_table: Callable[..., Table], selection: Mapping[str, Any]
) -> None:
    """Write a run or a part of it as a file of another program."""
    with RunReader(path) as reader:
        table = to_table(reader, **selection, on_progress=fraction_reporter(report, "reading"))
    size, free = MAX_BYTES_PER_NUMBER * table.n_rows * len(table.columns), shutil.disk_usage(target.parent).free
    if size > free - DISK_RESERVE:
        raise StorageError(f"{target.name}: up to {size:,} bytes, expected at most {max(free - DISK_RESERVE, 0):,}")
    step = f"writing {table.n_rows:,} rows"
    report(Progress(step, 0.0))
    try:
        write_table(target, table, fraction_reporter(report, step))
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(target), target.name)) from error


def verification_job(report: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Verify a recording's file, store the verdict in the catalogue and write the findings."""
    catalogue = location.catalogue()
    verification = verify(catalogue.path(run), fraction_reporter(report, "verifying"))
    catalogue.store_verdict(run, verification.verdict.value)
    write_json(target, VerificationSchema.of(verification))


def recovery_job(report: ReportProgress, target: Path, location: CatalogueLocation, run: str) -> None:
    """Copy the intact data of a recording into a new run, which is listed once complete."""
    report(Progress("copying what is intact"))
    catalogue = location.catalogue()
    copy = catalogue.path_for(f"{run}-recovered")
    if copy.exists():
        raise RunExistsError(f"{copy.name}: a run of this name exists already")
    temporary = target.with_name(copy.name)
    recovery = recover(catalogue.path(run), temporary)
    move_without_overwriting(temporary, copy)
    write_json(target, RecoverySchema.of(replace(recovery, target=copy)))


def index_job(report: ReportProgress, target: Path, location: CatalogueLocation, verifying: bool) -> None:  # noqa: FBT001 - sent through a pipe
    """Update the catalogue from the files, and verify them if wanted."""
    index_report = location.catalogue().index(
        summarise, verify_files=verifying, on_status=lambda status: report(Progress(status))
    )
    write_json(target, IndexReportSchema.of(index_report))


def export_selection(start: float, stop: float | None, segment: int | None) -> dict[str, Any]:
    """Return the exported part of a run, as keyword arguments of `samples_table` and `results_table`."""
    return {"start": start, "stop": math.inf if stop is None else stop, "segment": segment}


TABLES = {"samples": samples_table, "results": results_table, "pulses": pulses_table}


def write_json(target: Path, schema: Schema) -> None:
    """Write a schema as JSON to a job's result file; StorageError if that fails."""
    write_result(target, schema.model_dump_json().encode())


def write_result(target: Path, content: bytes) -> None:
    """Write a job's result file; StorageError if that fails."""
    try:
        target.write_bytes(content)
    except OSError as error:
        raise StorageError(f"{target.name}: cannot be written: {error.strerror or error}") from error
