"""Tasks of the job queue, made from job requests, and their functions, which run in a worker process.

Each function takes a `ProgressCallback`, the path of the result file, the catalogue and the request, and returns the
content of the file unless it writes the file itself.
"""

from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Final

import numpy as np
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from analysis.signals import FloatArray
from analysis.signals.header import Calibration, RunHeader
from daq.config.calibration import to_calibration
from daq.config.loader import parse_rig, read_recorded_config
from daq.config.rig import Rig, model_parameters
from daq.config.toml_files import to_toml
from daq.errors import ConfigError, UsageError
from daq.reports.analysis_result import ProgressCallback
from daq.reports.export import encode_analysis, run_analysis
from daq.reports.parameters import AnalysisFormat, AnalysisQuery, QueryParameters
from daq.reports.run_history import load_history
from daq.reports.run_summaries import Summaries
from daq.schemas.checks import RecoverySchema, VerificationSchema
from daq.schemas.live import predicted_vibration_schema
from daq.schemas.runs import IndexReportSchema, run_schema
from daq.schemas.study import (
    CampbellRequest,
    CriticalSpeedsRequest,
    InstabilityOnsetRequest,
    ModesRequest,
    ResponseRequest,
    Speeds,
    StudyRequest,
    study_schema,
)
from daq.schemas.units import Schema
from daq.service.jobs.queue import Task
from daq.service.jobs.schemas import (
    RESULT_QUERIES,
    ExportRequest,
    ImportRequest,
    IndexRequest,
    PredictionMapSchema,
    PredictionRequest,
    ReanalysisRequest,
    RecoveryRequest,
    ResultRequest,
    RigFromToml,
    RunJobRequest,
    VerificationRequest,
)
from daq.service.problems import ProblemError, ProblemType
from daq.service.results_reader import ANALYSIS_PREFIX, result_schema
from daq.service.uploads import UploadSchema
from daq.session.import_run import IMPORTED_BACKEND, ForeignFile, require_mapping_fits, write_imported_run
from daq.session.offline import corrected_header, summarise, with_reference_runout
from daq.session.prediction_maps import load_or_compute, map_file
from daq.session.predictor import Predictors
from model.prediction.prediction_map import default_map_speeds
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import (
    campbell_stiffness,
    campbell_study,
    critical_study,
    modes_study,
    response_study,
)
from model.studies.onset import onset_study
from model.studies.study import Study
from recordings.catalogue.catalogue import SUFFIX, Catalogue, RunEntry
from recordings.errors import ForeignFormatError, RunExistsError, StorageError
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import write_table
from recordings.file_operations import free_bytes, move_without_overwriting
from recordings.integrity.recover import recover
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader

DISK_RESERVE: Final = 1024**3  # bytes that stay free on the disk for a recording
MAX_BYTES_PER_NUMBER: Final = 24  # in any export format
MAPPING: Final = "mapping"
EXPORT_TABLES: Final = {"samples": samples_table, "results": results_table, "pulses": pulses_table}


def index_task(request: IndexRequest) -> Task:
    """Return the task of a catalogue update."""
    title = "catalogue, with verification" if request.verify else "catalogue"
    return Task(request, title, index_job, "index.json")


def study_task(request: StudyRequest) -> Task:
    """Return the task of a study for the rotor of a run's rig, or for the thesis's rotor without a run."""
    rotor = "the thesis's rotor" if request.run is None else f"the rotor of {request.run}"
    return Task(request, f"{request.kind} of {rotor}", study_job, f"{request.kind}.json")


def import_task(request: ImportRequest, upload: UploadSchema, path: Path, rig: Rig) -> Task:
    """Return the task of an import of an upload, stored at a path; ConfigError if the mapping lacks a channel."""
    columns = request.mapping.model_dump(mode="json", exclude_none=True)
    foreign = ForeignFile(path, upload.name, request.mapping, MAPPING, to_toml({"rig": rig.config.rig, **columns}))
    require_mapping_fits(foreign, rig)
    return Task(request, f"import of {upload.name}", partial(import_job, foreign=foreign, rig=rig), "run.json")


def run_task(request: RunJobRequest, entry: RunEntry) -> Task:
    """Return the task of a job request for a run.

    Raises
    ------
    ProblemError, RequestValidationError
        The request is not possible for this run.
    """
    run = entry.id
    match request:
        case ResultRequest(path="summary"):
            result_query(request)
            return Task(request, f"summary of {run}", summary_job, "summary.json")
        case ResultRequest(path=path):
            query, name = result_query(request), path.removeprefix(ANALYSIS_PREFIX)
            if isinstance(query, AnalysisQuery):
                return Task(request, f"{name} of {run}", analysis_job, f"{name}.{query.format or AnalysisFormat.JSON}")
            return Task(request, f"{name} of {run}", result_job, f"{name}.json")
        case ReanalysisRequest():
            try:
                corrected_header(header_of(entry), _calibrations(request))
            except (ConfigError, UsageError) as error:
                raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
            return Task(request, f"reanalysis of {run}", reanalysis_job, "summary.json")
        case PredictionRequest():
            header_of(entry)
            changed = "".join(f", {name} {value:g}" for name, value in _model_changes(request).items())
            return Task(request, f"model of {run}{changed}", prediction_job, "prediction.json")
        case ExportRequest(format=suffix):
            return Task(request, f"{request.content} of {run} as {suffix}", export_job, f"{run}.{suffix}")
        case VerificationRequest():
            return Task(request, f"verification of {run}", verification_job, "verification.json")
        case RecoveryRequest():
            return Task(request, f"recovery of {run}", recovery_job, "recovery.json")


def result_query(request: ResultRequest) -> QueryParameters:
    """Return the validated query parameters of a result; RequestValidationError if they are invalid."""
    try:
        return RESULT_QUERIES[request.path].model_validate(request.parameters)
    except ValidationError as error:
        faults = [{**fault, "loc": ("body", "parameters", *fault["loc"])} for fault in error.errors()]
        raise RequestValidationError(faults) from error


def _calibrations(request: ReanalysisRequest | RigFromToml) -> dict[str, Calibration]:
    return {name: to_calibration(record, f"calibrations.{name}") for name, record in request.calibrations.items()}


def _model_changes(request: PredictionRequest) -> dict[str, float]:
    return request.model_dump(exclude={"kind", "run"}, exclude_none=True)


def header_of(entry: RunEntry) -> RunHeader:
    """Return a run's header; ProblemError if it cannot be read."""
    if entry.header is None:
        raise ProblemError(ProblemType.RUN_DAMAGED, f"run {entry.id}: {entry.fault}")
    return entry.header


def rig_of_run(header: RunHeader) -> Rig:
    """Return the rig of a run with its configuration and calibrations at the time of recording.

    Raises
    ------
    ConfigError
        The run was imported. If its samples were displacements, its calibrations are not those of the rig.
    """
    name = f"run {header.run}"
    if header.acquisition.device.backend == IMPORTED_BACKEND:
        raise ConfigError(name, ["was imported: expected a recorded run, or the rig as TOML"])
    channels = header.acquisition.channels
    calibrations = {channel.name: channel.calibration for channel in channels if channel.calibration is not None}
    return Rig(Path(name), read_recorded_config(header.config_toml, name), calibrations)


def rig_from_toml(text: RigFromToml) -> Rig:
    """Return the rig of a TOML text; ConfigError if it is invalid."""
    return parse_rig(text.toml, _calibrations(text), "toml")


def result_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: ResultRequest) -> Schema:
    """Return the result of a run that its REST path returns."""
    path = catalogue.path(request.run)
    history = load_history(path, partial(report, "reading"))
    report("putting together", None)
    return result_schema(result_query(request), history)


def analysis_job(report: ProgressCallback, target: Path, catalogue: Catalogue, request: ResultRequest) -> bytes:
    """Return an analysis of a run's samples, in the format of the target's suffix."""
    kind = request.path.removeprefix(ANALYSIS_PREFIX)
    query: AnalysisQuery = result_query(request)  # type: ignore[assignment]  # that of an analysis
    run, analysis = run_analysis(catalogue.path(request.run), kind, query, report)
    report("writing", None)
    return encode_analysis(analysis, run, kind, AnalysisFormat(target.suffix.removeprefix(".")), query.plot_style())


def summary_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: ResultRequest) -> Schema:
    """Return a run's summary and cache it."""
    return Summaries(catalogue, Predictors(in_worker=True)).summary_with_agreement(request.run, report)


def reanalysis_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: ReanalysisRequest) -> Schema:
    """Return the summary of a run analysed again with corrected calibrations."""
    summaries = Summaries(catalogue, Predictors(in_worker=True))
    return summaries.recalibrated_summary(request.run, _calibrations(request), report)


def prediction_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: PredictionRequest) -> Schema:
    """Return the model's prediction over speed for a run's rig, with changed values of its `[model]`."""
    header = _recorded_header(catalogue, request.run)
    config = read_recorded_config(header.config_toml, f"configuration of run {header.run}")
    config = config.model_copy(update={"model": config.model.model_copy(update=_model_changes(request))})
    model = model_parameters(config), default_map_speeds(header.limits.speed), header.settings
    prediction_map = load_or_compute(
        lambda done, total: report("computing speed by speed", done / total), map_file(*model), *model
    )
    by_speed = tuple(predicted_vibration_schema(prediction_map.at(speed)) for speed in prediction_map.speeds.tolist())
    return PredictionMapSchema(run=header.run, by_speed=by_speed)


def _recorded_header(catalogue: Catalogue, run: str) -> RunHeader:
    with RunReader(catalogue.path(run)) as reader:
        return reader.header


def export_job(report: ProgressCallback, target: Path, catalogue: Catalogue, request: ExportRequest) -> None:
    """Write a run or a part of it as a file of another program."""
    part = {"start": request.from_s, "stop": inf if request.until_s is None else request.until_s}
    with RunReader(catalogue.path(request.run)) as reader:
        table = EXPORT_TABLES[request.content](
            reader, **part, segment=request.segment, on_progress=partial(report, "reading")
        )
    size, free = MAX_BYTES_PER_NUMBER * table.n_rows * len(table.columns), free_bytes(target.parent)
    if size > free - DISK_RESERVE:
        raise StorageError(f"{target.name}: up to {size:,} bytes, expected at most {max(free - DISK_RESERVE, 0):,}")
    step = f"writing {table.n_rows:,} rows"
    report(step, 0.0)
    try:
        write_table(target, table, partial(report, step))
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(target), target.name)) from error


def verification_job(
    report: ProgressCallback, _target: Path, catalogue: Catalogue, request: VerificationRequest
) -> Schema:
    """Verify a recording's file, store the verdict in the catalogue and return the findings."""
    verification = verify(catalogue.path(request.run), partial(report, "verifying"))
    catalogue.store_verdict(request.run, verification.verdict.value)
    return VerificationSchema.of(verification)


def recovery_job(report: ProgressCallback, target: Path, catalogue: Catalogue, request: RecoveryRequest) -> Schema:
    """Copy the intact data of a recording into a new run, which is listed once complete."""
    report("copying what is intact", None)
    copy = catalogue.path_for(f"{request.run}-recovered")
    if copy.exists():
        raise RunExistsError(f"{copy.name}: a run of this name exists already")
    temporary = target.with_name(copy.name)
    recovery = recover(catalogue.path(request.run), temporary)
    move_without_overwriting(temporary, copy)
    return RecoverySchema.of(replace(recovery, target=copy))


def index_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: IndexRequest) -> Schema:
    """Update the catalogue from the files, and verify them if wanted."""
    changes = catalogue.index(summarise, verify_files=request.verify, on_status=lambda status: report(status, None))
    return IndexReportSchema.of(changes)


def import_job(
    report: ProgressCallback,
    target: Path,
    catalogue: Catalogue,
    _request: ImportRequest,
    *,
    foreign: ForeignFile,
    rig: Rig,
) -> Schema:
    """Convert a file into a run and return the run's schema."""
    report("reading", None)
    try:
        rig = with_reference_runout(_check_runout_source(rig, catalogue), catalogue.folder)
        run, _ = write_imported_run(foreign, rig, catalogue, target.parent, partial(report, "writing and analysing"))
    except ForeignFormatError as error:
        raise ForeignFormatError(str(error).replace(str(foreign.path), foreign.name)) from error
    return run_schema(catalogue.run(run))


def _check_runout_source(rig: Rig, catalogue: Catalogue) -> Rig:
    """Return the rig unchanged if its run-out comes from no run or one of the data folder, never from a path."""
    name = rig.config.runout.from_run
    if name.endswith(SUFFIX):
        raise ConfigError("runout.from_run", [f"{name!r}: expected the id of a run, not a file"])
    if name:
        catalogue.path(name)
    return rig


def study_job(report: ProgressCallback, _target: Path, catalogue: Catalogue, request: StudyRequest) -> Schema:
    """Return a study, with the same functions and defaults as `rig model`; ModelError if it cannot be computed."""
    report("computing", None)
    return study_schema(_study(_rotor(catalogue, request.run), request))


def _rotor(catalogue: Catalogue, run: str | None) -> ModelParameters:
    if run is None:
        return gj90c()
    header = _recorded_header(catalogue, run)
    return model_parameters(read_recorded_config(header.config_toml, f"configuration of run {header.run}"))


def _study(parameters: ModelParameters, request: StudyRequest) -> Study:
    match request:
        case ModesRequest():
            return modes_study(parameters, request.stiffness_n_m, request.speed_rad_s, request.count)
        case CampbellRequest():
            stiffness = campbell_stiffness(parameters) if request.stiffness_n_m is None else request.stiffness_n_m
            return campbell_study(parameters, stiffness, _spaced(request.speeds), request.count)
        case CriticalSpeedsRequest(stiffnesses=range_):
            stiffnesses = np.geomspace(range_.from_n_m, range_.to_n_m, range_.count)
            return critical_study(parameters, stiffnesses, request.highest_rad_s)
        case ResponseRequest():
            return response_study(parameters, _spaced(request.speeds), request.stiffness_n_m, request.station)
        case InstabilityOnsetRequest():
            return onset_study(parameters, _spaced(request.speeds))


def _spaced(speeds: Speeds) -> FloatArray:
    return np.linspace(speeds.from_rad_s, speeds.to_rad_s, speeds.count)
