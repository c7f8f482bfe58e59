"""Cases and figures of chapter 3 of the thesis: equilibria over speed for its loads and inlet pressures."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.signals import FloatArray
from model.films.lubrication import Lubrication, RingEquilibrium
from model.studies.thesis.report import Curve, Figure

LOADS = (10.0, 20.0, 30.0)  # N
PRESSURES = (1e5, 2e5, 3e5)  # Pa
SPEEDS = np.arange(1000.0, 6001.0, 100.0)  # rad/s
RING_ANGLES = np.arange(0.0, 360.0, 0.5)  # degrees
SPEED_LABEL = "Speed of the shaft [rad/s]"
ANGLE_LABEL = "Angle from the top in the direction of rotation [°]"
RING_LABEL = "Angle of the ring [°]"
NO_CAVITY = "the film is complete at all these speeds: no cavity"
FLOW_LABEL = "Oil flow into the inner film, calibrated [1e-4 kg/s]"


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


def chapter_3_figures(chapter: CalibratedChapter) -> list[Figure]:
    """Return Figures 3.2 to 3.15; 3.1 is a drawing, and 3.10 becomes a curve of the number of fed holes."""
    loads, pressures = chapter.by_load, chapter.by_pressure
    return [
        _over_speed(chapter, "3.2a", "outer eccentricity", "Eccentricity ratio", loads, outer_eccentricity),
        _over_speed(chapter, "3.2b", "outer attitude", "Attitude [°]", loads, outer_attitude),
        _over_speed(chapter, "3.3a", "inner eccentricity", "Eccentricity ratio", loads, inner_eccentricity),
        _over_speed(chapter, "3.3b", "inner attitude", "Attitude [°]", loads, inner_attitude),
        _over_speed(chapter, "3.4a", "outer eccentricity", "Eccentricity ratio", pressures, outer_eccentricity),
        _over_speed(chapter, "3.4b", "outer attitude", "Attitude [°]", pressures, outer_attitude),
        _over_speed(chapter, "3.5", "outer film's rupture", "Start of the cavity [°]", loads, outer_rupture),
        _over_speed(chapter, "3.6", "inner film's rupture", "Start of the cavity [°]", loads, inner_rupture),
        _over_speed(chapter, "3.7", "outer film's rupture", "Start of the cavity [°]", pressures, outer_rupture),
        *_pressure_figures(chapter),
        _fed_holes(chapter),
        _turn(chapter, "3.11", ((chapter.by_pressure[1], 3000.0),)),
        *(_turn(chapter, f"3.12{letter}", _three_speeds(c)) for letter, c in zip("abc", loads, strict=True)),
        _over_speed(chapter, "3.13", "mean oil flow", FLOW_LABEL, loads, mean_flow),
        *(_turn(chapter, f"3.14{letter}", _three_speeds(c)) for letter, c in zip("abc", pressures, strict=True)),
        _over_speed(chapter, "3.15", "mean oil flow", FLOW_LABEL, pressures, mean_flow),
    ]


def _three_speeds(case: Case) -> tuple[tuple[Case, float], ...]:
    return tuple((case, speed) for speed in (1000.0, 3000.0, 5000.0))


def _over_speed(
    chapter: CalibratedChapter,
    number: str,
    subject: str,
    y_label: str,
    cases: tuple[Case, ...],
    value: Callable[[RingEquilibrium], float | None],
) -> Figure:
    curves = tuple(Curve(case.name, *case.over_speed(value)) for case in cases)
    title = f"{subject.capitalize()}, {chapter.name}"
    return Figure(number, title, SPEED_LABEL, y_label, curves, NO_CAVITY)


def _turn(chapter: CalibratedChapter, number: str, reference_equilibrium: tuple[tuple[Case, float], ...]) -> Figure:
    curves = tuple(
        Curve(f"{case.name}, {speed:,.0f} rad/s", RING_ANGLES, 1e4 * case.at(speed).flow(np.radians(RING_ANGLES)))
        for case, speed in reference_equilibrium
    )
    return Figure(number, f"Oil flow in a turn of the ring, {chapter.name}", RING_LABEL, FLOW_LABEL, curves)


def _pressure_figures(chapter: CalibratedChapter) -> list[Figure]:
    equilibrium = chapter.reference_equilibrium
    psi = np.radians(RING_ANGLES)
    films = (
        Curve("inner film", RING_ANGLES, equilibrium.inner.pressure(psi) / 1e5),
        Curve("outer film", RING_ANGLES, equilibrium.outer.pressure(psi) / 1e5),
    )
    difference = Curve("outer less inner", RING_ANGLES, equilibrium.pressure_difference(psi) / 1e5)
    title = f"30 N, 2e5 Pa, 3,000 rad/s, {chapter.name}"
    return [
        Figure("3.8", f"Pressures, {title}", ANGLE_LABEL, "Pressure [1e5 Pa]", films),
        Figure("3.9", f"Pressure difference, {title}", ANGLE_LABEL, "Pressure difference [1e5 Pa]", (difference,)),
    ]


def _fed_holes(chapter: CalibratedChapter) -> Figure:
    # Fig. 3.10 shows the fed holes of the ring at 0, 20, 40 and 60 degrees.
    holes = np.radians(RING_ANGLES + 60.0 * np.arange(6)[:, None])
    fed = np.sum(chapter.reference_equilibrium.hole_flow(holes) > 0, axis=0).astype(np.float64)
    title = f"Holes through which oil flows in, of six, {chapter.name}"
    return Figure("3.10", title, RING_LABEL, "Fed holes", (Curve("fed holes", RING_ANGLES, fed),), y_limits=(-0.3, 6.3))
