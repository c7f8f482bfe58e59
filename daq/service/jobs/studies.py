"""Study jobs: the model studies of `rig model`, with the same functions and defaults."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rig import model_parameters
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
from daq.service.jobs.execution import write_json
from daq.service.jobs.queue import Progress, ReportProgress, Task
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import campbell_stiffness, campbell_study, critical_study, modes_study, response_study
from model.studies.onset import onset_study
from model.studies.study import Study

FloatArray = NDArray[np.float64]


def study_task(request: StudyRequest, header: RunHeader | None) -> Task:
    """Return the task of a study for the rotor of a run's rig, or for the thesis's rotor without a run."""
    rotor = "the thesis's rotor" if header is None else f"the rotor of {header.run}"
    run = "" if header is None else header.run
    return Task(request.kind, f"{request.kind} of {rotor}", run, study_job, (header, request), f"{request.kind}.json")


def study_job(report: ReportProgress, target: Path, header: RunHeader | None, request: StudyRequest) -> None:
    """Compute a study and write it as JSON."""
    report(Progress("computing"))
    result = compute_study(_parameters(header), request)
    write_json(target, study_schema(result))


def _parameters(header: RunHeader | None) -> ModelParameters:
    if header is None:
        return gj90c()
    return model_parameters(read_recorded_config(header.config_toml, f"configuration of run {header.run}"))


def compute_study(parameters: ModelParameters, request: StudyRequest) -> Study:
    """Return the requested study; ModelError if it cannot be computed."""
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
