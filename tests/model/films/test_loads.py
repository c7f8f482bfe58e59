"""Constant loads in the motion on the films, and the motion at all stations."""

from dataclasses import replace

import numpy as np
import pytest

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.rotor.supports import StaticLoad, Support, SupportCoefficients


def place(parameters: ModelParameters) -> complex:
    """Mean position of the settled shaft at the station of the probes, m."""
    x, y = ShaftMotion(parameters, 500.0, 80).integrate_turns(8).mean(axis=1)
    return complex(x, y)


def test_load_on_the_shaft_acts_as_weight() -> None:
    heavy = gj90c()
    # the weight of every station, but not of the rings
    loads = tuple(StaticLoad(disc.station, 0.0, -disc.mass * heavy.gravity) for disc in heavy.rotor.discs)
    pushed = replace(heavy, gravity=0.0, loads=loads)
    assert ModalSystem.from_parameters(pushed).shaft.weight == pytest.approx(
        ModalSystem.from_parameters(heavy).shaft.weight, rel=1e-12
    )


def test_load_on_the_rings_acts_as_ring_weight() -> None:
    bearing = gj90c().floating_ring
    pressed = replace(gj90c(), bearing=replace(bearing, static_load=bearing.ring_mass * 9.80665))
    assert ModalSystem.from_parameters(pressed).rings.gravity == pytest.approx(2 * 9.80665)
    assert abs(place(pressed)) > 1.2 * abs(place(gj90c()))


def test_each_station_has_its_own_displacement_of_one_motion() -> None:
    paths = [
        ShaftMotion(replace(gj90c(), probe_station=station), 900.0, 40).integrate_turns(2) for station in (2, 3, 4)
    ]
    # the shaft is stiff: the motion of station 3 is interpolated between its neighbours at 25 and 30 mm
    straight = (30 * paths[0] + 25 * paths[2]) / 55
    assert np.abs(paths[1] - straight).max() < 0.05 * np.ptp(paths[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"loads": (StaticLoad(7, 0.0, -1.0),)}, "load: station 7, expected 1 to 6"),
        ({"supports": (Support(0, SupportCoefficients.isotropic(1e5)),)}, "support: station 0, expected 1 to 6"),
    ],
)
def test_load_or_support_at_no_station_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(gj90c(), **changes)  # type: ignore[arg-type]  # wrong on purpose
