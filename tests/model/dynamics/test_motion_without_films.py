"""Motion in time of rotors on linear supports: angular acceleration, residual bow and modal damping in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.dynamics.modal_system import ModalSystem
from model.dynamics.motion import ShaftMotion
from model.dynamics.newmark import NO_FAILURE, integrate
from model.errors import ParameterError
from model.rotor.gj90c import gj90c, gj90c_rotor
from model.rotor.parameters import Bow, Imbalance, ModelParameters
from model.rotor.rotor import Disc, Rotor, Segment
from model.rotor.supports import Support, SupportCoefficients

SOFT = SupportCoefficients.isotropic(1e-3)  # N/m: holds nothing


def without_films(parameters: ModelParameters) -> ModelParameters:
    return replace(parameters, bearing=None, gravity=0.0, supports=(Support(3, SOFT), Support(4, SOFT)))


def test_free_rotor_turns_about_its_centre_of_mass_along_any_speed_trace() -> None:
    """The centre of mass z + e exp(i theta) of a free rotor moves uniformly, whatever the speed does."""
    eccentricity, start, step = 1e-6, 600.0, 1e-5
    imbalances = tuple(Imbalance(disc.station, disc.mass * eccentricity) for disc in gj90c_rotor().discs)
    motion = ShaftMotion(replace(without_films(gj90c()), imbalances=imbalances), start, 0)
    t = step * np.arange(1, 10_001)
    speed = start + 400 * (1 - np.cos(60 * t))  # up to 24,000 rad/s²
    angle = (start + 400) * t - 400 / 60 * np.sin(60 * t)
    x, y = motion.advance(angle, speed, step)
    centre = x + 1j * y + eccentricity * np.exp(1j * angle)
    assert np.abs(centre - eccentricity * (1 + 1j * start * t)).max() < 0.01 * eccentricity


@pytest.mark.parametrize("speed", [300.0, 1100.0, 2500.0])
def test_bowed_jeffcott_rotor_has_its_closed_form(speed: float) -> None:
    """z = (Omega² U + k b) / (k - m Omega² + i c Omega) at the disc, for imbalance U and bow b."""
    mass, damping, stiff, length, radius = 1.0, 300.0, 1e9, 0.4, 8e-3
    rotor = Rotor(
        segments=(Segment(length / 2, radius), Segment(length / 2, radius)),
        discs=(Disc(1, 1e-3, 1e-7, 1e-7), Disc(2, mass, 1e-4, 1e-7), Disc(3, 1e-3, 1e-7, 1e-7)),
        bearing_stations=(1, 3),
    )
    spring, damper = SupportCoefficients.isotropic(stiff), SupportCoefficients.isotropic(1e-3, damping)
    imbalance, bow = Imbalance(2, 2e-5, 0.7), Bow(2, 30e-6, -1.1)
    parameters = ModelParameters(
        rotor, None, (imbalance,), gravity=0.0, probe_station=2, bows=(bow,),
        supports=(Support(1, spring), Support(2, damper), Support(3, spring)),
    )  # fmt: skip
    bending = 48 * rotor.segments[0].bending_stiffness / length**3
    stiffness = 1 / (1 / bending + 1 / (2 * stiff))
    excited = speed**2 * imbalance.magnitude * np.exp(0.7j) + stiffness * bow.displacement * np.exp(-1.1j)
    expected = excited / (stiffness - mass * speed**2 + 1j * damping * speed)
    motion = ShaftMotion(parameters, speed, 30)
    path = motion.integrate_turns(math.ceil(0.1 * speed / (2 * math.pi)), 256)[:, -256:]  # 15 time constants
    found = np.mean((path[0] + 1j * path[1]) * np.exp(-2j * np.pi * np.arange(256) / 256))
    assert abs(found - expected) < 2e-3 * abs(expected)


def test_bending_mode_decays_with_the_modal_damping() -> None:
    """q(t) = exp(-zeta w t) cos(w sqrt(1 - zeta²) t) + ... of the first bending mode at rest."""
    ratio = 0.02
    system = ModalSystem.from_parameters(replace(without_films(gj90c(imbalance=0.0)), modal_damping=ratio))
    w = math.sqrt(float(system.shaft.squared_frequencies[2]))
    damped, step = w * math.sqrt(1 - ratio**2), 2 * math.pi / w / 400
    state = system.at_rest(angle=0.0, speed=0.0)
    state.motion[0, 2], state.motion[2, 2] = 1e-6, -(w**2) * 1e-6
    history, outputs = np.zeros((2, 4000)), np.eye(1, system.shaft.weight.size, 2)
    path = np.empty((1, 4000), np.complex128)
    result = integrate(system.parts, system.constraints, system.matrices(step), state, history, outputs, path)
    assert result == NO_FAILURE
    t = step * np.arange(1, 4001)
    expected = 1e-6 * np.exp(-ratio * w * t) * (np.cos(damped * t) + ratio * w / damped * np.sin(damped * t))
    assert np.abs(path[0] - expected).max() < 0.005e-6


def test_bow_of_a_shaft_that_stays_straight_is_refused() -> None:
    parameters = replace(without_films(gj90c()), bows=(Bow(3, 1e-6),))  # at a journal
    with pytest.raises(ParameterError, match="bow: known at 2 stations"):
        parameters.bow_forces()


def test_rotor_that_nothing_holds_is_refused() -> None:
    with pytest.raises(ParameterError, match="bearing: none"):
        ShaftMotion(replace(gj90c(), bearing=None), 500.0, 0)
