"""Cases of chapter 3 of the thesis: equilibria over speed for its loads and inlet pressures."""

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
    """Equilibria over speed at a load and an inlet pressure.

    Parameters
    ----------
    load : float
        N.
    inlet_pressure : float
        Pa.
    equilibria : tuple of RingEquilibrium
        One equilibrium for each of `SPEEDS`.
    """

    load: float
    inlet_pressure: float
    equilibria: tuple[RingEquilibrium, ...]

    @property
    def name(self) -> str:
        """Load and inlet pressure as text."""
        return f"{self.load:g} N, {self.inlet_pressure / 1e5:g}e5 Pa"

    def over_speed(self, value: Callable[[RingEquilibrium], float | None]) -> tuple[FloatArray, FloatArray]:
        """Return the speeds, rad/s, at which ``value`` is not None, and the values."""
        points = [(speed, value(equilibrium)) for speed, equilibrium in zip(SPEEDS, self.equilibria, strict=True)]
        existing = [(speed, number) for speed, number in points if number is not None]
        return np.array([speed for speed, _ in existing]), np.array([number for _, number in existing])

    def at(self, speed: float) -> RingEquilibrium:
        """Return the equilibrium at one of `SPEEDS`, rad/s."""
        return self.equilibria[int(np.argmin(np.abs(SPEEDS - speed)))]


@dataclass(frozen=True, slots=True)
class CalibratedChapter:
    """All cases of the chapter with one calibration.

    Parameters
    ----------
    name : str
        Name of the calibration.
    lubrication : Lubrication
        Bearing and calibration factors.
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
        """Equilibrium for Figs. 3.8 to 3.11: 3,000 rad/s and 2e5 Pa as stated; 30 N assumed.

        Of the three loads of the chapter, 30 N comes closest to the stated rupture.
        """
        return self.by_pressure[1].at(3000.0)


def calibrated_chapter(name: str, lubrication: Lubrication) -> CalibratedChapter:
    """Return all cases of the chapter with a calibration."""

    def case(load: float, inlet_pressure: float) -> Case:
        equilibria = tuple(lubrication.equilibrium(load, float(speed), inlet_pressure) for speed in SPEEDS)
        return Case(load, inlet_pressure, equilibria)

    by_load = tuple(case(load, PRESSURES[0]) for load in LOADS)
    by_pressure = (by_load[-1], *(case(LOADS[-1], pressure) for pressure in PRESSURES[1:]))
    return CalibratedChapter(name, lubrication, by_load, by_pressure)


def outer_eccentricity(equilibrium: RingEquilibrium) -> float:
    """Return the eccentricity ratio of the ring."""
    return equilibrium.outer.eccentricity


def inner_eccentricity(equilibrium: RingEquilibrium) -> float:
    """Return the eccentricity ratio of the journal in the ring."""
    return equilibrium.inner.eccentricity


def outer_attitude(equilibrium: RingEquilibrium) -> float:
    """Return the attitude angle of the ring, degrees."""
    return float(np.degrees(equilibrium.outer.attitude))


def inner_attitude(equilibrium: RingEquilibrium) -> float:
    """Return the attitude angle of the journal in the ring, degrees."""
    return float(np.degrees(equilibrium.inner.attitude))


def outer_rupture(equilibrium: RingEquilibrium) -> float | None:
    """Return the rupture angle of the outer film, degrees from the top; None in a complete film."""
    return None if equilibrium.outer.rupture is None else float(np.degrees(equilibrium.outer.rupture))


def inner_rupture(equilibrium: RingEquilibrium) -> float | None:
    """Return the rupture angle of the inner film, degrees from the top; None in a complete film."""
    return None if equilibrium.inner.rupture is None else float(np.degrees(equilibrium.inner.rupture))


def mean_flow(equilibrium: RingEquilibrium) -> float:
    """Return the mean oil flow into the inner film over a turn of the ring, calibrated, 1e-4 kg/s."""
    return 1e4 * equilibrium.mean_flow()
