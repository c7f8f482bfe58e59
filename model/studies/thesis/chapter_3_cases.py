"""The equilibria that chapter 3 of the thesis shows: loads, inlet pressures and speeds, in both calibrations."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.films.lubrication import Lubrication, RingEquilibrium

FloatArray = NDArray[np.float64]

LOADS = (10.0, 20.0, 30.0)  # N
PRESSURES = (1e5, 2e5, 3e5)  # Pa
SPEEDS = np.arange(1000.0, 6001.0, 100.0)  # rad/s


@dataclass(frozen=True, slots=True)
class Case:
    """Both films over the speeds at a load and an inlet pressure.

    Parameters
    ----------
    load : float
        N.
    inlet_pressure : float
        Pa.
    rests : tuple of RingEquilibrium
        One for each of `SPEEDS`.
    """

    load: float
    inlet_pressure: float
    rests: tuple[RingEquilibrium, ...]

    @property
    def name(self) -> str:
        """Load and inlet pressure, to be read."""
        return f"{self.load:g} N, {self.inlet_pressure / 1e5:g}e5 Pa"

    def over_speed(self, value: Callable[[RingEquilibrium], float | None]) -> tuple[FloatArray, FloatArray]:
        """Return the speeds at which an equilibrium has a value, rad/s, and the values."""
        points = [(speed, value(rest)) for speed, rest in zip(SPEEDS, self.rests, strict=True)]
        there = [(speed, number) for speed, number in points if number is not None]
        return np.array([speed for speed, _ in there]), np.array([number for _, number in there])

    def at(self, speed: float) -> RingEquilibrium:
        """Return the equilibrium at one of `SPEEDS`, rad/s."""
        return self.rests[int(np.argmin(np.abs(SPEEDS - speed)))]


@dataclass(frozen=True, slots=True)
class CalibratedChapter:
    """A calibration with the cases that the chapter's figures show.

    Parameters
    ----------
    name : str
        Of the calibration.
    lubrication : Lubrication
        Bearing and factors.
    by_load : tuple of Case
        10, 20 and 30 N at 1e5 Pa.
    by_pressure : tuple of Case
        1e5, 2e5 and 3e5 Pa at 30 N.
    """

    name: str
    lubrication: Lubrication
    by_load: tuple[Case, ...]
    by_pressure: tuple[Case, ...]

    @property
    def reference_equilibrium(self) -> RingEquilibrium:
        """Equilibrium taken for Figs. 3.8 to 3.11: 3,000 rad/s and 2e5 Pa as the text says, 30 N for want of a load.

        Of the three loads it comes nearest to the rupture that the text gives.
        """
        return self.by_pressure[1].at(3000.0)


def calibrated_chapter(name: str, lubrication: Lubrication) -> CalibratedChapter:
    """Return the chapter's cases in a calibration."""

    def case(load: float, inlet_pressure: float) -> Case:
        rests = tuple(lubrication.equilibrium(load, float(speed), inlet_pressure) for speed in SPEEDS)
        return Case(load, inlet_pressure, rests)

    by_load = tuple(case(load, PRESSURES[0]) for load in LOADS)
    by_pressure = (by_load[-1], *(case(LOADS[-1], pressure) for pressure in PRESSURES[1:]))
    return CalibratedChapter(name, lubrication, by_load, by_pressure)


def outer_eccentricity(rest: RingEquilibrium) -> float:
    """Return the ring's eccentricity ratio."""
    return rest.outer.eccentricity


def inner_eccentricity(rest: RingEquilibrium) -> float:
    """Return the journal's eccentricity ratio in the ring."""
    return rest.inner.eccentricity


def outer_attitude(rest: RingEquilibrium) -> float:
    """Return the ring's attitude, degrees."""
    return float(np.degrees(rest.outer.attitude))


def inner_attitude(rest: RingEquilibrium) -> float:
    """Return the journal's attitude in the ring, degrees."""
    return float(np.degrees(rest.inner.attitude))


def outer_rupture(rest: RingEquilibrium) -> float | None:
    """Return where the outer film's cavity starts, degrees from the top; none in a complete film."""
    return None if rest.outer.rupture is None else float(np.degrees(rest.outer.rupture))


def inner_rupture(rest: RingEquilibrium) -> float | None:
    """Return where the inner film's cavity starts, degrees from the top; none in a complete film."""
    return None if rest.inner.rupture is None else float(np.degrees(rest.inner.rupture))


def mean_flow(rest: RingEquilibrium) -> float:
    """Return the mean oil flow into the inner film over a turn of the ring, scaled, 1e-4 kg/s."""
    return 1e4 * rest.mean_flow()
