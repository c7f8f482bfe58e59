"""Cases and figures of chapter 3 of the thesis: equilibria over speed for its loads and inlet pressures."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from typing import Final

import numpy as np

from analysis.signals import FloatArray
from model.films.lubrication import Lubrication, RingEquilibrium
from model.studies.linear_studies import SPEED_LABEL
from model.studies.study import Plot, Series, Style
from model.studies.thesis.report import Captioned

LOADS = (10.0, 20.0, 30.0)  # N
PRESSURES = (1e5, 2e5, 3e5)  # Pa
SPEEDS = np.arange(1000.0, 6001.0, 100.0)  # rad/s
RING_ANGLES = np.arange(0.0, 360.0, 0.5)  # degrees
ANGLE_LABEL = "Angle from the top in the direction of rotation [°]"
RING_LABEL = "Angle of the ring [°]"
NO_CAVITY = "the film is complete at all these speeds: no cavity"
FLOW_LABEL = "Oil flow into the inner film, calibrated [1e-4 kg/s]"
STYLES = (Style.LINE, Style.DASHED, Style.DOTTED)  # to distinguish equal curves


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.degrees(angle))


VALUES: Final[dict[str, Callable[[RingEquilibrium], float | None]]] = {
    "outer eccentricity": lambda found: found.outer.eccentricity,
    "inner eccentricity": lambda found: found.inner.eccentricity,
    "outer attitude": lambda found: _degrees(found.outer.attitude),
    "inner attitude": lambda found: _degrees(found.inner.attitude),
    "outer film's rupture": lambda found: _degrees(found.outer.rupture),
    "inner film's rupture": lambda found: _degrees(found.inner.rupture),
    "mean oil flow": lambda found: 1e4 * found.mean_flow(),
}
"""Values of an equilibrium: ratios, degrees (None in a complete film), and the calibrated flow, 1e-4 kg/s."""


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

    def over_speed(self, value: str) -> tuple[FloatArray, FloatArray]:
        """Return the speeds, rad/s, at which one of `VALUES` is not None, and the values."""
        numbers = np.array([VALUES[value](found) for found in self.equilibria], np.float64)  # None becomes NaN
        exists = ~np.isnan(numbers)
        return SPEEDS[exists], numbers[exists]

    def at(self, speed: float) -> RingEquilibrium:
        """Return the equilibrium at one of `SPEEDS`, rad/s."""
        return self.equilibria[int(np.argmin(np.abs(SPEEDS - speed)))]

    def value(self, value: str, speed: float = 1000.0) -> float | None:
        """Return one of `VALUES` at one of `SPEEDS`, rad/s."""
        return VALUES[value](self.at(speed))


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

    @property
    def calibration(self) -> str:
        """Name of the calibration; empty if it is that of the printed data."""
        return "" if self.lubrication.inner_capacity_factor == 1 else self.name


def calibrated_chapter(name: str, lubrication: Lubrication) -> CalibratedChapter:
    """Return all cases of the chapter with a calibration."""

    def case(load: float, inlet_pressure: float) -> Case:
        equilibria = tuple(lubrication.equilibrium(load, float(speed), inlet_pressure) for speed in SPEEDS)
        return Case(load, inlet_pressure, equilibria)

    by_load = tuple(case(load, PRESSURES[0]) for load in LOADS)
    by_pressure = (by_load[-1], *(case(LOADS[-1], pressure) for pressure in PRESSURES[1:]))
    return CalibratedChapter(name, lubrication, by_load, by_pressure)


def chapter_3_figures(chapter: CalibratedChapter) -> list[Captioned]:
    """Return Figures 3.2 to 3.15; 3.1 is a drawing, and 3.10 becomes a curve of the number of fed holes."""
    loads, pressures = chapter.by_load, chapter.by_pressure
    return [
        _over_speed(chapter, "3.2a", "outer eccentricity", "Eccentricity ratio", loads),
        _over_speed(chapter, "3.2b", "outer attitude", "Attitude [°]", loads),
        _over_speed(chapter, "3.3a", "inner eccentricity", "Eccentricity ratio", loads),
        _over_speed(chapter, "3.3b", "inner attitude", "Attitude [°]", loads),
        _over_speed(chapter, "3.4a", "outer eccentricity", "Eccentricity ratio", pressures),
        _over_speed(chapter, "3.4b", "outer attitude", "Attitude [°]", pressures),
        _over_speed(chapter, "3.5", "outer film's rupture", "Start of the cavity [°]", loads),
        _over_speed(chapter, "3.6", "inner film's rupture", "Start of the cavity [°]", loads),
        _over_speed(chapter, "3.7", "outer film's rupture", "Start of the cavity [°]", pressures),
        *_reference_figures(chapter),
        _turn(chapter, "3.11", chapter.by_pressure[1], 3000.0),
        *(_turn(chapter, f"3.12{letter}", case) for letter, case in zip("abc", loads, strict=True)),
        _over_speed(chapter, "3.13", "mean oil flow", FLOW_LABEL, loads),
        *(_turn(chapter, f"3.14{letter}", case) for letter, case in zip("abc", pressures, strict=True)),
        _over_speed(chapter, "3.15", "mean oil flow", FLOW_LABEL, pressures),
    ]


def _captioned(
    number: str,
    title: str,
    labels: tuple[str, str],
    curves: dict[str, tuple[FloatArray, FloatArray]],
    y_limits: tuple[float, float] | None = None,
) -> Captioned:
    series = tuple(Series(name, x, y, style) for (name, (x, y)), style in zip(curves.items(), cycle(STYLES)))
    return f"Fig. {number}: {title}", (Plot(title, *labels, series, y_limits=y_limits, empty_text=NO_CAVITY),)


def _over_speed(
    chapter: CalibratedChapter, number: str, value: str, y_label: str, cases: tuple[Case, ...]
) -> Captioned:
    curves = {case.name: case.over_speed(value) for case in cases}
    return _captioned(number, f"{value.capitalize()}, {chapter.name}", (SPEED_LABEL, y_label), curves)


def _turn(chapter: CalibratedChapter, number: str, case: Case, *speeds: float) -> Captioned:
    curves = {
        f"{case.name}, {speed:,.0f} rad/s": (RING_ANGLES, 1e4 * case.at(speed).flow(np.radians(RING_ANGLES)))
        for speed in speeds or (1000.0, 3000.0, 5000.0)
    }
    return _captioned(number, f"Oil flow in a turn of the ring, {chapter.name}", (RING_LABEL, FLOW_LABEL), curves)


def _reference_figures(chapter: CalibratedChapter) -> list[Captioned]:
    found, psi = chapter.reference_equilibrium, np.radians(RING_ANGLES)
    films = {
        "inner film": (RING_ANGLES, found.inner.pressure(psi) / 1e5),
        "outer film": (RING_ANGLES, found.outer.pressure(psi) / 1e5),
    }
    difference = {"outer less inner": (RING_ANGLES, found.pressure_difference(psi) / 1e5)}
    # Fig. 3.10 shows the fed holes of the ring at 0, 20, 40 and 60 degrees.
    holes = np.radians(RING_ANGLES + 60.0 * np.arange(6)[:, None])
    fed = {"fed holes": (RING_ANGLES, np.sum(found.hole_flow(holes) > 0, axis=0).astype(np.float64))}
    title = f"30 N, 2e5 Pa, 3,000 rad/s, {chapter.name}"
    return [
        _captioned("3.8", f"Pressures, {title}", (ANGLE_LABEL, "Pressure [1e5 Pa]"), films),
        _captioned("3.9", f"Pressure difference, {title}", (ANGLE_LABEL, "Pressure difference [1e5 Pa]"), difference),
        _captioned(
            "3.10",
            f"Holes through which oil flows in, of six, {chapter.name}",
            (RING_LABEL, "Fed holes"),
            fed,
            (-0.3, 6.3),
        ),
    ]
