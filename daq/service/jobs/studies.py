"""Studies of the model as jobs: the very functions that `rig model` calls, for the same defaults."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import RunHeader
from daq.config.loader import read_recorded_config
from daq.config.rotor import model_parameters
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
from daq.service.jobs.queue import Progress, ReportProgress, Task
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.linear import campbell_stiffness, campbell_study, critical_study, modes_study
from model.studies.onset import onset_study
from model.studies.study import Study
from model.studies.synchronous import response_study

FloatArray = NDArray[np.float64]


def study_task(order: StudyRequest, header: RunHeader | None) -> Task:
    """Return what an order is to do, for the rotor of the rig of a run, or without one for the thesis's."""
    whose = "the thesis's rotor" if header is None else f"the rotor of {header.run}"
    run = "" if header is None else header.run
    return Task(order.kind, f"{order.kind} of {whose}", run, study, (header, order), f"{order.kind}.json")


def study(tell: ReportProgress, target: Path, header: RunHeader | None, order: StudyRequest) -> None:
    """Compute a study."""
    tell(Progress("computing"))
    found = computed(_parameters(header), order)
    target.write_text(study_schema(found).model_dump_json(), encoding="utf-8")


def _parameters(header: RunHeader | None) -> ModelParameters:
    if header is None:
        return gj90c()
    return model_parameters(read_recorded_config(header.config_toml, f"configuration of run {header.run}"))


def computed(parameters: ModelParameters, order: StudyRequest) -> Study:
    """Return the study that is asked for; ValueError, ModelError where there is none."""
    match order:
        case ModesRequest():
            return modes_study(parameters, order.stiffness_n_m, order.speed_rad_s, order.count)
        case CampbellRequest():
            stiffness = campbell_stiffness(parameters) if order.stiffness_n_m is None else order.stiffness_n_m
            return campbell_study(parameters, stiffness, _spaced(order.speeds), order.count)
        case CriticalSpeedsRequest(stiffnesses=range_):
            stiffnesses = np.geomspace(range_.from_n_m, range_.to_n_m, range_.count)
            return critical_study(parameters, stiffnesses, order.highest_rad_s)
        case ResponseRequest():
            return response_study(parameters, _spaced(order.speeds), order.stiffness_n_m, order.station)
        case InstabilityOnsetRequest():
            return onset_study(parameters, _spaced(order.speeds))


def _spaced(speeds: Speeds) -> FloatArray:
    return np.linspace(speeds.from_rad_s, speeds.to_rad_s, speeds.count)
