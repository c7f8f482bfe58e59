"""Chapter 5 of the thesis recomputed: Tables 5.2 and 5.3 with known misprints, mode shapes, Campbell diagrams."""

import math
from typing import Final

import numpy as np

from analysis.signals.units import MILLIMETRE
from model.linear.linear_system import LinearSystem, whirl_modes
from model.linear.modes import critical_speeds, free_modes
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import campbell_study, critical_study, modes_study, supported_system
from model.studies.study import Plot, Series
from model.studies.thesis.report import Captioned, Comparison

# Speed, rad/s: third, second, first bending, upper, lower rigid mode, Hz; forward, then reverse. As printed.
TABLE_5_3: Final[dict[int, tuple[tuple[int, ...], tuple[int, ...]]]] = {
    0: ((11976, 5046, 1732, 52, 20), (-11976, -5046, -1732, -52, -20)),
    500: ((11997, 5094, 1769, 53, 25), (-11955, -4997, -1695, -52, -16)),
    1000: ((12019, 5143, 1808, 53, 31), (-11934, -4950, -1659, -52, -13)),
    1500: ((12040, 5193, 1847, 53, 37), (-11913, -4904, -1623, -52, -11)),
    2000: ((12063, 5244, 1887, 53, 44), (-11893, -4858, -1589, -52, -9)),
    2500: ((12085, 5295, 1927, 53, 55), (-11873, -4813, -1555, -50, -8)),
    3000: ((12108, 5347, 1968, 53, 61), (-11853, -4769, -1521, -50, -7)),
    3500: ((12131, 5400, 2010, 53, 68), (-11833, -4725, -1489, -50, -6)),
    4000: ((12154, 5454, 2052, 53, 76), (-11814, -4682, -1457, -50, -5)),
    4500: ((12177, 5508, 2095, 53, 85), (-11794, -4640, -1427, -50, -5)),
    5000: ((12201, 5563, 2138, 53, 93), (-11775, -4598, -1396, -50, -4)),
    5500: ((12225, 5619, 2182, 53, 101), (-11756, -4557, -1367, -50, -4)),
    6000: ((12250, 5676, 2227, 53, 110), (-11738, -4517, -1338, -50, -4)),
    6500: ((12274, 5733, 2272, 53, 118), (-11720, -4477, -1311, -50, -4)),
    7000: ((12300, 5791, 2317, 53, 127), (-11701, -4438, -1283, -50, -3)),
    7500: ((12325, 5850, 2363, 53, 135), (-11683, -4399, -1257, -50, -3)),
    8000: ((12351, 5909, 2410, 53, 143), (-11667, -4361, -1231, -50, -3)),
}

COPIED_53: Final = "printed as 53 at every speed; the branch dips to 50.0 where it meets the lower one near 2,600 rad/s"
COPIED_MINUS_50: Final = "printed as -50 from 2,500 rad/s on; the branch hardly depends on speed and stays at -52.4"
MISPRINT_11667: Final = "the column falls by 18 a row; -11665.6 continues it, -11667 does not"


def misprint_reason(speed: int, printed: int) -> str:
    """Return the reason why a printed entry differs; empty if none is known."""
    if printed == 53 and 2500 <= speed <= 6500:
        return COPIED_53
    if printed == -50 and speed >= 2500:
        return COPIED_MINUS_50
    return MISPRINT_11667 if (speed, printed) == (8000, -11667) else ""


TABLE_5_2 = (1730.0, 5045.0, 11975.0, 18193.0)  # Hz
STIFFNESS = 1e4  # N/m, of Table 5.3
CRITICAL_SPEED_COUNTS = {
    1e10: 2,
    1e7: 4,
    1e4: 5,
}  # critical speeds up to 8,000 rad/s by bearing stiffness, N/m; section 5.3
DIAGRAMS, SHAPES = ("5.3", "5.5", "5.7"), ("5.4", "5.6", "5.8")  # figures, by bearing stiffness as above
MAX_SPEED = 8000.0  # rad/s
MODES_PER_DIRECTION = 4  # modes of each sense


def chapter_5_comparisons() -> list[Comparison]:
    """Return all numbers stated in chapter 5 with the computed ones."""
    parameters = gj90c()
    bending = free_modes(parameters.rotor).frequencies[2:6] / (2 * math.pi)
    found = [
        Comparison("Table 5.2", f"bending mode {number} of the free rotor", "Hz", stated, float(ours), 0.5)
        for number, (stated, ours) in enumerate(zip(TABLE_5_2, bending, strict=True), 1)
    ]
    for stiffness, count in CRITICAL_SPEED_COUNTS.items():
        critical = critical_speeds(supported_system(parameters, stiffness), MAX_SPEED)
        where = ", ".join(f"{speed:,.1f}" for speed in sorted((*critical.forward, *critical.reverse)))
        ours = len(critical.forward) + len(critical.reverse)
        found.append(
            Comparison(
                "Section 5.3",
                f"critical speeds up to 8,000 rad/s on bearings of {stiffness:.0e} N/m",
                "-",
                count,
                ours,
                0,
                note=f"{len(critical.forward)} forward, {len(critical.reverse)} reverse: {where} rad/s",
            )
        )
    system = supported_system(parameters, STIFFNESS)
    for speed, (forward, reverse) in TABLE_5_3.items():
        found += _row(system, speed, forward, reverse)
    return found


def _row(system: LinearSystem, speed: int, forward: tuple[int, ...], reverse: tuple[int, ...]) -> list[Comparison]:
    """Return a row of Table 5.3, sorted: its columns track the rigid modes through their veering."""
    frequencies = np.sort(whirl_modes(system, [speed])[0].frequencies) / (2 * math.pi)
    middle = frequencies.size // 2
    ours = (*frequencies[middle : middle + 5][::-1], *frequencies[middle - 5 : middle])
    printed = (*sorted(forward, reverse=True), *sorted(reverse))
    return [
        Comparison(
            "Table 5.3", f"{speed:,} rad/s", "Hz", float(stated), float(one), 0.8, note=misprint_reason(speed, stated)
        )
        for stated, one in zip(printed, ours, strict=True)
    ]


def chapter_5_figures() -> list[Captioned]:
    """Return the figures of chapter 5 with captions."""
    parameters, speeds = gj90c(), np.linspace(0.0, MAX_SPEED, 161)
    shapes = modes_study(parameters, None, 0.0, 14).plots
    diagrams = [campbell_study(parameters, stiffness, speeds) for stiffness in CRITICAL_SPEED_COUNTS]
    stiffnesses = np.geomspace(1e3, 1e10, 141)
    return [
        ("Fig. 5.2: mode shapes of the free rotor (Table 5.2)", shapes),
        *(
            (f"Fig. {number}: {one.title}, {one.remarks[0]}", one.plots)
            for number, one in zip(DIAGRAMS, diagrams, strict=True)
        ),
        *(
            (f"Fig. {number}: modes of the rotor on springs of {stiffness:.0e} N/m", _shapes(parameters, stiffness))
            for number, stiffness in zip(SHAPES, CRITICAL_SPEED_COUNTS, strict=True)
        ),
        (
            "Critical speed map: the critical speeds of the three diagrams over the stiffness of the bearings",
            critical_study(parameters, stiffnesses, 2e4).plots,
        ),
    ]


def _shapes(parameters: ModelParameters, stiffness: float) -> tuple[Plot, ...]:
    """Return the lowest forward and reverse modes at the highest speed, scaled to a maximum of 1."""
    modes = whirl_modes(supported_system(parameters, stiffness), [MAX_SPEED])[0]
    plots = []
    for name, sign in (("Forward", 1), ("Reverse", -1)):
        indices = np.flatnonzero(sign * modes.frequencies > 0)
        series = []
        for index in indices[np.argsort(np.abs(modes.frequencies[indices]))][:MODES_PER_DIRECTION]:
            shape = modes.shapes[index, 0]
            scaled = np.real(shape / shape[int(np.argmax(np.abs(shape)))])
            hertz = f"{abs(modes.frequencies[index]) / (2 * math.pi):,.1f} Hz"
            series.append(Series(hertz, parameters.rotor.positions / MILLIMETRE, np.asarray(scaled)))
        title = f"{name} modes at {MAX_SPEED:,.0f} rad/s, springs of {stiffness:.0e} N/m"
        plots.append(
            Plot(title, "Position along the shaft [mm]", "Displacement, maximum 1", tuple(series), y_limits=(-1.1, 1.1))
        )
    return tuple(plots)
