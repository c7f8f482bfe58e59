"""Studies without solution at some speeds (omitted and reported) or at all speeds (an error)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from model.errors import EquilibriumError, ModelError, WallContactError
from model.films.lubrication import nominal_lubrication
from model.rotor.gj90c import gj90c
from model.studies.films import lubrication_study
from model.studies.onset import onset_study
from model.studies.run_up import RunUp, bifurcation_study, run_up, waterfall_study
from model.studies.study import Study

THIN = gj90c(viscosity=1e-9)


@pytest.fixture(scope="module")
def calm() -> RunUp:
    return run_up(gj90c(), np.array([500.0, 520.0, 540.0]), 5, 8)


@pytest.mark.parametrize("study", [waterfall_study, bifurcation_study])
def test_run_up_into_the_wall_at_every_speed_is_an_error(study: Callable[[RunUp, str], Study]) -> None:
    with pytest.raises(WallContactError, match="reached a wall at each of the 2 speeds from 100 to 200 rad/s"):
        study(run_up(THIN, np.array([100.0, 200.0]), 5, 8), "thin oil")


@pytest.mark.parametrize("study", [waterfall_study, bifurcation_study])
def test_run_up_reports_the_number_of_speeds_with_wall_contact(
    study: Callable[[RunUp, str], Study], calm: RunUp
) -> None:
    assert not any("wall" in remark for remark in study(calm, "calm").remarks)
    overall = np.where(calm.speeds == 520.0, np.nan, calm.peak_to_peak)
    touched = study(replace(calm, peak_to_peak=overall), "touched")
    assert "the motion reached a wall at 1 of 3 speeds: omitted" in touched.remarks


def test_rotor_without_synchronous_motion_is_an_error() -> None:
    with pytest.raises(ModelError, match="none found within the clearances at any of 2 speeds from 100 to 200 rad/s"):
        onset_study(THIN, np.array([100.0, 200.0]))
    assert onset_study(gj90c(), np.array([500.0, 520.0])).remarks == ("stable from 500 to 520 rad/s",)


def test_load_that_no_film_carries_is_an_error() -> None:
    with pytest.raises(EquilibriumError, match=r"load: 1e\+09 N presses the body"):
        lubrication_study(nominal_lubrication(), 1e9, 1e5, np.array([1000.0, 2000.0]))


def test_speeds_without_equilibrium_are_omitted_and_reported() -> None:
    def is_full_film(load: float) -> bool:
        try:
            nominal_lubrication().equilibrium(load, 1000.0, 1e5)
        except EquilibriumError:
            return False
        return True

    too_much = next(load for load in np.geomspace(100.0, 1e9, 60) if not is_full_film(float(load)))
    study = lubrication_study(nominal_lubrication(), float(too_much), 1e5, np.array([1000.0, 2000.0, 4000.0]))
    assert any(remark.startswith("1 of 3 speeds are omitted: load: ") for remark in study.remarks)
    assert study.plots[-1].title == "Pressure at 4,000 rad/s"
