from dataclasses import replace
from typing import Any

import pytest

from model.rotor.gj90c import gj90c
from model.rotor.parameters import Imbalance


def test_ring_speed_ratio_of_chapter_6_is_0_407() -> None:
    assert gj90c().floating_ring.ring_speed_ratio == pytest.approx(0.407, abs=5e-4)


def test_ring_speed_ratio_of_table_3_1_is_0_593() -> None:
    bearing = replace(gj90c().floating_ring, ring_outer_radius=7e-3)
    assert bearing.ring_speed_ratio == pytest.approx(0.593, abs=5e-4)


def test_clearance_is_the_sum_of_both_films() -> None:
    assert gj90c().floating_ring.clearance == pytest.approx(100e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"viscosity": 0.0}, r"viscosity: 0 Pa s"),
        ({"ring_mass": -0.02}, r"ring_mass: -0.02 kg"),
        ({"length": float("inf")}, r"length: inf m"),
        (
            {"ring_outer_radius": 5e-3},
            r"ring_outer_radius: 0.005 m, expected more than the ring's inner radius 0.00502 m",
        ),
        ({"inner_clearance": 1e-3}, r"inner_clearance: 0.001 m, expected a thin film"),
    ],
)
def test_invalid_bearing_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(gj90c().floating_ring, **changes)


@pytest.mark.parametrize(
    ("imbalance", "message"),
    [
        (Imbalance(7, 1e-7), r"imbalance: station 7, expected 1 to 6"),
        (Imbalance(5, -1e-7), r"imbalance: -1e-07 kg m, expected a finite value, 0 or more"),
        (Imbalance(5, 1e-7, float("nan")), r"imbalance: phase nan rad"),
        (Imbalance(5, 5e-5), r"imbalance: 5e-05 kg m at station 5, expected at most 1.85e-05 kg m"),
    ],
)
def test_invalid_imbalance_is_refused(imbalance: Imbalance, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(gj90c(), imbalances=(imbalance,))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gravity": -9.8}, r"gravity: -9.8 m/s²"),
        ({"probe_station": 0}, r"probe_station: 0, expected 1 to 6"),
        ({"probe_angles": (0.0, float("nan"))}, r"probe_angles: nan rad"),
    ],
)
def test_invalid_parameters_are_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(gj90c(), **changes)  # type: ignore[arg-type]  # wrong on purpose
