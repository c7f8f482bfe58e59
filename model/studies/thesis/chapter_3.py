"""Chapter 3 of the thesis computed again: every number of Figures 3.2 to 3.15, stated beside computed.

Both calibrations are computed: as Table 3.1 and the equations say (`nominal`), and with the two factors that bring back
the equilibria (`thesis_like`). Flows are scaled so that 10 N at 1e5 Pa and 1,000 rad/s give the 2.1e-4 kg/s of page 84
nominally; their size is therefore not predicted. Loads that the text does not give are taken as named beside them.
"""

import numpy as np
from numpy.typing import NDArray

from model.films.lubrication import nominal, thesis_like
from model.studies.thesis.chapter_3_cases import (
    Case,
    Reading,
    inner_attitude,
    inner_rupture,
    mean_flow,
    outer_attitude,
    outer_eccentricity,
    outer_rupture,
    read_chapter,
)
from model.studies.thesis.chapter_3_figures import chapter_3_figures
from model.studies.thesis.report import Chapter, Comparison, Relation

FloatArray = NDArray[np.float64]

SIDE_FORCE = (
    "a difference with these zeros pushes sideways: for horizontal balance its mean times sin Psi must be 0, whatever "
    "load, viscosity or clearance"
)
FLOW_TREND = (
    "no factors on loads and capacities that were tried give flows that fall with speed: at a fixed load the inner "
    "pressure hardly changes and the outer cavity shrinks"
)
ZEROS_MOVE = "30 N taken, none is stated; the flow's kinks lie where a hole meets a zero of Fig. 3.9, which differ"
LOAD_RATIO = "the speeds for 10, 20 and 30 N stand as 1 to 2.7 to 4.9 in any reading"


def chapter_3() -> Chapter:
    """Return chapter 3 computed again with both calibrations; takes about a second."""
    readings = (read_chapter("nominal", nominal()), read_chapter("thesis-like", thesis_like()))
    comparisons = [comparison for reading in readings for comparison in _comparisons(reading)]
    figures = [figure for reading in readings for figure in chapter_3_figures(reading)]
    return Chapter("Chapter 3: lubrication of floating-ring bearings", tuple(comparisons), tuple(figures))


def _comparisons(reading: Reading) -> list[Comparison]:
    return [*_equilibria(reading), *_cavities(reading), *_differences(reading), *_flows(reading)]


def _equilibria(reading: Reading) -> list[Comparison]:
    note = _inner_note(reading)
    falling = sum(bool(np.all(np.diff(case.over_speed(outer_eccentricity)[1]) < 0)) for case in reading.by_load)
    rising = sum(bool(np.all(np.diff(case.over_speed(outer_attitude)[1]) > -1e-9)) for case in reading.by_load)
    found = [
        _equal(reading, "3.2", "loads whose outer eccentricity falls with speed", "-", 3, falling, 0, "counted"),
        _equal(reading, "3.2", "loads whose outer attitude nears 90° with speed", "-", 3, rising, 0, "counted"),
    ]
    for case, eccentricity, attitude in zip(reading.by_load, (0.12, 0.23, 0.35), (90, 89, 87), strict=True):
        rest, where = case.at(1000.0), _where(case, 1000.0)
        found += [
            _equal(
                reading, "3.3", f"inner eccentricity, {where}", "-", eccentricity, rest.inner.eccentricity, 0.005, note
            ),
            _equal(reading, "3.3", f"inner attitude, {where}", "°", attitude, inner_attitude(rest), 0.8, note),
        ]
    return found


def _cavities(reading: Reading) -> list[Comparison]:
    lubrication = reading.lubrication
    ten, twenty, thirty = (lubrication.complete_above(case.load, case.inlet_pressure) for case in reading.by_load)
    quantity = "speed above which the outer film has no cavity, {} N, 1e5 Pa"
    slow = [outer_rupture(case.at(1000.0)) for case in reading.by_pressure]
    known = [angle for angle in slow if angle is not None]
    spread = max(known) - min(known) if len(known) == len(slow) else None
    lowest = min(angle for angle in (inner_rupture(case.at(1000.0)) for case in reading.by_load) if angle is not None)
    never = sum(rest.inner.is_complete for case in reading.by_load for rest in case.rests)
    broken = sum(any(not rest.outer.is_complete for rest in case.rests) for case in reading.by_load)
    return [
        _equal(
            reading,
            "3.5",
            "loads with an outer cavity within 1,000-6,000 rad/s",
            "-",
            3,
            broken,
            0,
            "counted" if broken == 3 else f"as Table 3.1 has it the outer film is complete from {thirty:,.0f} rad/s on",
        ),
        Comparison("Fig. 3.5", quantity.format(10), "rad/s", 2000, ten, 0, Relation.AT_MOST, reading.name),
        Comparison(
            "Fig. 3.5", quantity.format(20), "rad/s", 3000, twenty, 0, Relation.AT_MOST, f"{reading.name}; {LOAD_RATIO}"
        ),
        Comparison(
            "Fig. 3.5",
            quantity.format(30),
            "rad/s",
            6000,
            thirty,
            0,
            Relation.AT_LEAST,
            f"{reading.name}; {LOAD_RATIO}",
        ),
        _equal(
            reading,
            "3.6",
            "lowest start of the inner cavity, the axis",
            "°",
            325,
            lowest,
            1,
            f"axis of the figure; {_inner_note(reading)}",
        ),
        _equal(reading, "3.6", "inner films without a cavity, 1,000-6,000 rad/s", "-", 0, never, 0, "counted"),
        _equal(
            reading,
            "3.7",
            "spread of the outer cavity's start over the inlet pressures, 30 N, 1,000 rad/s",
            "°",
            0,
            spread,
            7,
            "stated as the same place; tolerance what can be read off an axis of 360°"
            if spread is not None
            else "the outer film is complete",
        ),
        _equal(
            reading,
            "3.8",
            "start of the outer cavity, 3,000 rad/s, 2e5 Pa, load not stated (30 N taken)",
            "°",
            280,
            outer_rupture(reading.shown),
            5,
            "the outer film is complete" if outer_rupture(reading.shown) is None else "the load is not stated",
        ),
    ]


def _differences(reading: Reading) -> list[Comparison]:
    rest = reading.shown
    degrees = np.arange(0.0, 360.0, 0.05)
    psi = np.radians(degrees)
    difference = rest.pressure_difference(psi) / 1e5
    zeros = degrees[1:][np.sign(difference[1:]) != np.sign(difference[:-1])]
    quantity = "the pressure difference's zero nearest to {}°, 3,000 rad/s, 2e5 Pa, load not stated (30 N taken)"
    note = SIDE_FORCE if zeros.size else "no zero: the outer pressure is higher everywhere"
    found = [
        _equal(reading, "3.9", quantity.format(f"{stated:g}"), "°", stated, _nearest(zeros, stated), 5, note)
        for stated in (187.0, 343.0)
    ]
    fed = [
        _equal(
            reading,
            "3.10",
            f"holes fed with the ring at {angle}°, load not stated (30 N taken)",
            "-",
            stated,
            float(np.sum(rest.hole_flow(np.radians(angle + 60.0 * np.arange(6))) > 0)),
            0,
            SIDE_FORCE,
        )
        for angle, stated in ((0, 4), (20, 3), (60, 4))
    ]
    peak = float(np.max(rest.outer.pressure(psi))) / 1e5
    axis = "axis of the figure; the load is not stated"
    return [
        *found,
        *fed,
        Comparison("Fig. 3.8", "highest pressure", "1e5 Pa", 16, peak, 0, Relation.AT_MOST, f"{reading.name}; {axis}"),
        Comparison(
            "Fig. 3.9",
            "lowest pressure difference",
            "1e5 Pa",
            -8,
            float(np.min(difference)),
            0,
            Relation.AT_LEAST,
            f"{reading.name}; {axis}",
        ),
        Comparison(
            "Fig. 3.9",
            "highest pressure difference",
            "1e5 Pa",
            4,
            float(np.max(difference)),
            0,
            Relation.AT_MOST,
            f"{reading.name}; {axis}",
        ),
    ]


def _flows(reading: Reading) -> list[Comparison]:
    ring = np.arange(0.0, 60.0, 0.25)
    turn = reading.shown.flow(np.radians(ring))
    found = [
        _equal(reading, "3.11", "ring angle of the highest flow", "°", 15, float(ring[np.argmax(turn)]), 2, ZEROS_MOVE),
        _equal(reading, "3.11", "ring angle of the lowest flow", "°", 40, float(ring[np.argmin(turn)]), 2, ZEROS_MOVE),
        _equal(
            reading,
            "3.12",
            "mean flow, 10 N, 1e5 Pa, 1,000 rad/s (printed as 2.1 kg/s)",
            "1e-4 kg/s",
            2.1,
            mean_flow(reading.by_load[0].at(1000.0)),
            0.05,
            "the flow's scale is chosen to give it nominally: no prediction",
        ),
        _equal(reading, "3.13", "speeds with outward flow, 10 N", "%", 0, _starved(reading.by_load[0]), 0, FLOW_TREND),
        _equal(
            reading,
            "3.13",
            "first speed with outward flow, 30 N",
            "rad/s",
            1500,
            _first(reading.by_load[2]),
            200,
            FLOW_TREND,
        ),
    ]
    for case, stated in zip(reading.by_pressure, (6.0, 7.0, 8.0), strict=True):
        quantity = f"mean flow, {_where(case, 1000.0)}"
        computed = mean_flow(case.at(1000.0))
        found.append(
            _equal(
                reading,
                "3.15",
                quantity,
                "1e-4 kg/s",
                stated,
                computed,
                0.5,
                "the size is calibrated, the ratio of the three is not",
            )
        )
    middle, high = reading.by_pressure[1:]
    found += [
        _equal(
            reading, "3.15", "first speed with outward flow, 2e5 Pa", "rad/s", 2300, _first(middle), 200, FLOW_TREND
        ),
        _equal(reading, "3.15", "last speed with outward flow, 2e5 Pa", "rad/s", 4500, _last(middle), 200, FLOW_TREND),
        _equal(reading, "3.15", "speeds with outward flow, 3e5 Pa", "%", 0, _starved(high), 0, FLOW_TREND),
    ]
    return found


def _inner_note(reading: Reading) -> str:
    calibrated = reading.lubrication.inner_capacity_factor != 1
    return "one factor gives all six" if calibrated else "the inner film as Table 3.1 has it carries 13 times more"


def _equal(  # a comparison with one number of a figure
    reading: Reading,
    figure: str,
    quantity: str,
    unit: str,
    stated: float,
    computed: float | None,
    tolerance: float,
    note: str,
) -> Comparison:
    return Comparison(f"Fig. {figure}", quantity, unit, stated, computed, tolerance, note=f"{reading.name}; {note}")


def _where(case: Case, speed: float) -> str:
    return f"{case.name}, {speed:,.0f} rad/s"


def _nearest(values: FloatArray, stated: float) -> float | None:
    return None if values.size == 0 else float(values[np.argmin(np.abs(values - stated))])


def _outward(case: Case) -> FloatArray:
    # speeds at which oil leaves the inner film, rad/s
    speeds, flow = case.over_speed(mean_flow)
    return speeds[flow < 0]


def _starved(case: Case) -> float:
    return 100 * _outward(case).size / len(case.rests)


def _first(case: Case) -> float | None:
    outward = _outward(case)
    return None if outward.size == 0 else float(outward[0])


def _last(case: Case) -> float | None:
    outward = _outward(case)
    return None if outward.size == 0 else float(outward[-1])
