"""Chapter 5 of the thesis computed again: Tables 5.2 and 5.3, mode shapes and Campbell diagrams."""

import math

import numpy as np
from numpy.typing import NDArray

from model.gj90c import gj90c, gj90c_rotor
from model.modes import critical_speeds, free_modes, natural_frequencies
from model.rotor import Rotor
from model.studies.linear import campbell_study, critical_study, modes_study
from model.studies.study import Plot, Surface
from model.studies.thesis_table_5_3 import PRINTED, reason
from model.thesis_report import Comparison

FloatArray = NDArray[np.float64]

TABLE_5_2 = (1730.0, 5045.0, 11975.0, 18193.0)  # Hz
STIFFNESS = 1e4  # N/m, of Table 5.3
COUNTS = {1e10: 2, 1e7: 4, 1e4: 5}  # critical speeds up to 8,000 rad/s by bearing stiffness, N/m; section 5.3
HIGHEST = 8000.0  # rad/s


def chapter_5_comparisons() -> list[Comparison]:
    """Return every number that chapter 5 states, beside the computed one."""
    rotor = gj90c_rotor()
    bending = free_modes(rotor).frequencies[2:6] / (2 * math.pi)
    found = [
        Comparison("Table 5.2", f"bending mode {number} of the free rotor", "Hz", stated, float(ours), 0.5)
        for number, (stated, ours) in enumerate(zip(TABLE_5_2, bending, strict=True), 1)
    ]
    for stiffness, count in COUNTS.items():
        critical = critical_speeds(rotor, stiffness, HIGHEST)
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
    for speed, (forward, reverse) in PRINTED.items():
        found += _row(rotor, speed, forward, reverse)
    return found


def _row(rotor: Rotor, speed: int, forward: tuple[int, ...], reverse: tuple[int, ...]) -> list[Comparison]:
    """Return a row of Table 5.3, sorted: its columns follow the rigid modes through their meeting."""
    frequencies = natural_frequencies(rotor, STIFFNESS, speed) / (2 * math.pi)
    middle = frequencies.size // 2
    ours = (*frequencies[middle : middle + 5][::-1], *frequencies[middle - 5 : middle])
    printed = (*sorted(forward, reverse=True), *sorted(reverse))
    return [
        Comparison("Table 5.3", f"{speed:,} rad/s", "Hz", float(stated), float(one), 0.8, note=reason(speed, stated))
        for stated, one in zip(printed, ours, strict=True)
    ]


def chapter_5_figures() -> list[tuple[str, tuple[Plot | Surface, ...]]]:
    """Return chapter 5's figures with their captions."""
    parameters, speeds = gj90c(), np.linspace(0.0, HIGHEST, 161)
    shapes = modes_study(parameters, None, 0.0, 14).plots
    diagrams = [campbell_study(parameters, stiffness, speeds) for stiffness in COUNTS]
    stiffnesses = np.geomspace(1e3, 1e10, 141)
    return [
        ("Mode shapes of the free rotor (Table 5.2)", shapes),
        *((f"{one.title}: {one.remarks[0]}", one.plots) for one in diagrams),
        (
            "Where the critical speeds of the three diagrams come from: all over the bearings' stiffness",
            critical_study(parameters, stiffnesses, 2e4).plots,
        ),
    ]
