"""Figures 3.2 to 3.15 of the thesis, recomputed."""

from collections.abc import Callable

import numpy as np

from model.films.lubrication import RingEquilibrium
from model.studies.thesis.chapter_3_cases import (
    CalibratedChapter,
    Case,
    inner_attitude,
    inner_eccentricity,
    inner_rupture,
    mean_flow,
    outer_attitude,
    outer_eccentricity,
    outer_rupture,
)
from model.studies.thesis.report import Curve, Figure

RING_ANGLES = np.arange(0.0, 360.0, 0.5)  # degrees
SPEED_LABEL = "Speed of the shaft [rad/s]"
ANGLE_LABEL = "Angle from the top in the direction of rotation [°]"
RING_LABEL = "Angle of the ring [°]"
NO_CAVITY = "the film is complete at all these speeds: no cavity"
FLOW_LABEL = "Oil flow into the inner film, calibrated [1e-4 kg/s]"


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
