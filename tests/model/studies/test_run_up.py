"""Stepped run-ups with perturbation, and motion at one speed, at any station."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_spectrum
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import FilmName
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import response_study
from model.studies.motion import (
    DEFAULT_PERTURBATION,
    MAX_GROWTH_TURNS,
    STEPS_PER_TURN,
    MotionTable,
    SteppedMotion,
    motion_study,
)
from model.studies.onset import stability
from model.studies.run_up import bifurcation_study, run_up, waterfall_study
from model.studies.sweep_quantities import with_values

SPEEDS = np.arange(780.0, 881.0, 20.0)


def test_onset_of_a_perturbed_run_up_is_that_of_the_eigenvalues(default: ModelParameters) -> None:
    (band,) = stability(default, SPEEDS).bands
    first = float(SPEEDS[np.searchsorted(SPEEDS, band.start)])
    perturbed = run_up(default, SPEEDS, 60, 64, perturbation=DEFAULT_PERTURBATION)
    assert perturbed.onset(FilmName.INNER) == first
    assert run_up(default, SPEEDS, 60, 64).onset(FilmName.INNER) > first
    assert perturbed.perturbation is not None
    assert np.array_equal(perturbed.perturbation.growth_rates > 0, np.greater_equal(SPEEDS, first))
    assert perturbed.whirl(FilmName.INNER)[1][: int(np.argmax(first == SPEEDS))].max() < 2 * DEFAULT_PERTURBATION
    assert "growth_rate_1_s" in waterfall_study(perturbed, "").columns
    remarks = " ".join(waterfall_study(perturbed, "").remarks)
    assert "perturbed by 0.02 µm" in remarks
    assert f"unstable by eigenvalues: {first:,.0f} rad/s" in remarks


@pytest.mark.campaign
@pytest.mark.parametrize(
    "changes",
    [
        {"viscosity_pa_s": 0.005},
        {"viscosity_pa_s": 0.035},
        {"inner_clearance_um": 15.0},
        {"inner_clearance_um": 25.0},
        {"imbalance_kg_m": 2.5e-7},
        {"imbalance_kg_m": 1e-6},
    ],
    ids=str,
)
def test_onset_of_a_perturbed_run_up_is_that_of_the_eigenvalues_for_other_rotors(changes: dict[str, float]) -> None:
    parameters = with_values(gj90c(), changes)
    band = stability(parameters, np.arange(300.0, 2101.0, 50.0)).bands[0]
    speeds = 25 * np.floor(band.start / 25) + 25 * np.arange(-2.0, 5.0)
    found = run_up(parameters, speeds, 60, 64, perturbation=DEFAULT_PERTURBATION)
    assert found.perturbation is not None
    e_folds = found.perturbation.growth_rates * MAX_GROWTH_TURNS * 2 * math.pi / speeds
    onset = found.onset(band.film)
    # not below the onset by eigenvalues, and not above the speed at which the perturbation has time to become visible
    assert band.start <= onset <= speeds[int(np.argmax(e_folds > 3))]


def test_unperturbed_run_up_is_the_undisturbed_motion(default: ModelParameters) -> None:
    found = run_up(default, np.array([900.0, 1000.0]), 10, 8)
    motion = ShaftMotion(default, 900.0, 10)
    motion.integrate_turns(8, STEPS_PER_TURN)
    motion.change_speed(1000.0)
    motion.integrate_turns(10, STEPS_PER_TURN)
    assert np.array_equal(found.stroboscopic[1], motion.integrate_turns(8, STEPS_PER_TURN)[:, ::STEPS_PER_TURN])
    assert found.perturbation is None
    assert "not perturbed" in " ".join(bifurcation_study(found, "").remarks)


def test_all_stations_of_one_motion_equal_those_computed_singly(default: ModelParameters) -> None:
    whole = ShaftMotion(default, 900.0, 10).integrate_stations(2)
    assert whole.shape == (6, 2, 128)
    for station in (1, 4, 6):
        alone = ShaftMotion(replace(default, probe_station=station), 900.0, 10).integrate_turns(2)
        assert np.array_equal(whole[station - 1], alone)
    speeds = np.array([900.0, 1000.0])
    assert np.array_equal(
        run_up(default, speeds, 5, 8, station=5).spectrum,
        run_up(replace(default, probe_station=5), speeds, 5, 8).spectrum,
    )


def test_response_at_a_station_is_that_of_the_synchronous_motion_there(default: ModelParameters) -> None:
    speeds = np.array([900.0, 1000.0])
    amplitudes = [response_study(default, speeds, station=station).columns["up_amplitude_um_pk"] for station in (1, 5)]
    for station, found in zip((1, 5), amplitudes, strict=True):
        other = response_study(replace(default, probe_station=station), speeds).columns["up_amplitude_um_pk"]
        assert np.array_equal(np.asarray(found), np.asarray(other))
    assert not np.allclose(np.asarray(amplitudes[0], float), np.asarray(amplitudes[1], float), rtol=0.05)


def test_motion_study_lists_stations_orbit_spectrum_and_poincare_section(default: ModelParameters) -> None:
    def listed(table: MotionTable) -> list[dict[str, float | str]]:
        return motion_study(default, 1600.0, 3, 40, 16, perturbation=DEFAULT_PERTURBATION, table=table).rows()

    stepped = SteppedMotion(default, DEFAULT_PERTURBATION)
    path = stepped.settle_at(1600.0, 40).record(16).stations[2] / MICROMETRE
    orbit = np.array([[row["x_um"], row["y_um"]] for row in listed(MotionTable.ORBIT)], float)
    assert np.array_equal(orbit.T, path[:, -8 * STEPS_PER_TURN :])
    points = np.array([[row["x_um"], row["y_um"]] for row in listed(MotionTable.POINCARE)], float)
    assert np.array_equal(points.T, path[:, ::STEPS_PER_TURN])
    spectrum = np.array([row["x_um_pk"] for row in listed(MotionTable.SPECTRUM)], float)
    expected = np.abs(order_spectrum(path[0] - path[0].mean(), 16)[1])
    assert np.array_equal(spectrum, expected[: spectrum.size])
    stations = listed(MotionTable.STATIONS)
    assert [row["station"] for row in stations] == [1, 2, 3, 4, 5, 6]
    assert stations[2]["overall_x_um_pp"] == pytest.approx(np.ptp(path[0]))
    assert stations[2]["first_order_x_um_pk"] == pytest.approx(expected[16])
    assert 200 < stepped.turns_settled < 1000  # time for the perturbation to grow
    assert {row["whirl_order"] for row in stations} == {0.6875}  # nearest sixteenth


def test_synchronous_motion_is_one_point_and_has_no_whirl() -> None:
    study = motion_study(gj90c(imbalance=2e-6), 1200.0, settle=20, turns=16, perturbation=DEFAULT_PERTURBATION)
    assert all(math.isnan(float(row["whirl_order"])) for row in study.rows())
    assert max(float(row["spread_x_um"]) for row in study.rows()) < 0.05


@pytest.mark.parametrize(("speed", "station", "message"), [(0.0, 1, "speed: 0 rad/s"), (900.0, 9, "probe_station: 9")])
def test_invalid_motion_study_is_refused(default: ModelParameters, speed: float, station: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        motion_study(default, speed, station)


def test_invalid_perturbation_is_refused(default: ModelParameters) -> None:
    for perturbation, shown in ((-1e-8, "-0.01"), (math.nan, "nan"), (20e-6, "20")):
        expected = f"perturbation: {shown} µm, expected 0 or more and less than the inner clearance of 20 µm"
        with pytest.raises(ValueError, match=expected):
            run_up(default, SPEEDS, perturbation=perturbation)
    with pytest.raises(ValueError, match="motion: none, expected a call of settle_at"):
        SteppedMotion(default, DEFAULT_PERTURBATION).record(8)
