"""Table 5.3 of the thesis: natural frequencies over speed on bearings of 1e4 N/m, and number of critical speeds.

Tolerance 0.8 Hz: the thesis prints whole hertz (0.5) from slightly different numbers. Misprints are listed with
their reason and compared with a wider tolerance, so that all 170 entries are compared.
"""

import numpy as np
import pytest

from model.linear.linear_system import whirl_modes
from model.linear.modes import critical_speeds
from model.rotor.gj90c import gj90c
from model.studies.linear_studies import supported_system
from model.studies.thesis.chapter_5 import TABLE_5_3, misprint_reason

BEARING_STIFFNESS = 1e4  # N/m
TOLERANCE = 0.8  # Hz

# (speed, printed frequency): tolerance, Hz, and reason
WIDER: dict[tuple[int, int], tuple[float, str]] = {
    **{(speed, 53): (3.1 if speed == 2500 else 1.5, misprint_reason(speed, 53)) for speed in range(2500, 6501, 500)},
    **{(speed, -50): (2.5, misprint_reason(speed, -50)) for speed in range(2500, 8001, 500)},
    (8000, -11667): (1.5, misprint_reason(8000, -11667)),
}


def computed(speed: float) -> tuple[list[float], list[float]]:
    (modes,) = whirl_modes(supported_system(gj90c(), BEARING_STIFFNESS), [speed])
    frequencies = np.sort(modes.frequencies) / (2 * np.pi)
    middle = frequencies.size // 2
    return list(frequencies[middle : middle + 5][::-1]), list(frequencies[middle - 5 : middle])


def pairs(speed: int) -> list[tuple[float, int]]:
    forward, reverse = computed(speed)
    printed_forward, printed_reverse = TABLE_5_3[speed]
    # Computed frequencies are sorted. The printed columns track the modes through the crossing of the two rigid ones
    # near 2600 rad/s, so the printed rows are sorted as well.
    return list(zip(forward, sorted(printed_forward, reverse=True), strict=True)) + list(
        zip(reverse, sorted(printed_reverse), strict=True)
    )


@pytest.mark.parametrize("speed", TABLE_5_3)
def test_rotor_on_soft_bearings_has_the_frequencies_of_table_5_3(speed: int) -> None:
    wrong = []
    for ours, printed in pairs(speed):
        tolerance, _ = WIDER.get((speed, printed), (TOLERANCE, ""))
        if abs(ours - printed) > tolerance:
            wrong.append(f"{speed} rad/s: {ours:.1f} Hz, printed {printed}")
    assert not wrong


def test_only_misprints_with_a_reason_differ_from_table_5_3() -> None:
    misses = {
        (speed, printed) for speed in TABLE_5_3 for ours, printed in pairs(speed) if abs(ours - printed) > TOLERANCE
    }
    assert misses == set(WIDER)
    assert sum(len(pairs(speed)) for speed in TABLE_5_3) == 170


@pytest.mark.parametrize(
    ("bearing_stiffness", "forward", "reverse"),
    [
        (1e10, (7525.9,), (5500.0,)),
        (1e7, (4034.8, 6147.2), (3511.4, 5134.1)),
        (1e4, (135.8, 329.5), (121.5, 329.3, 7800.1)),
    ],
)
def test_number_of_critical_speeds_is_that_of_the_campbell_diagrams(
    bearing_stiffness: float, forward: tuple[float, ...], reverse: tuple[float, ...]
) -> None:
    # Section 5.3 states 2, 4 and 5 crossings; the speeds were found independently from the determinant.
    found = critical_speeds(supported_system(gj90c(), bearing_stiffness), 8000)
    assert found.forward == pytest.approx(forward, abs=0.06)
    assert found.reverse == pytest.approx(reverse, abs=0.06)


@pytest.mark.parametrize("bearing_stiffness", [1e4, 1e7, 1e10])
def test_a_critical_speed_is_where_a_frequency_equals_the_speed(bearing_stiffness: float) -> None:
    system = supported_system(gj90c(), bearing_stiffness)
    found = critical_speeds(system, 8000)
    for sign, speeds in ((1, found.forward), (-1, found.reverse)):
        for speed in speeds:
            frequencies = whirl_modes(system, [speed])[0].frequencies
            assert np.min(np.abs(frequencies - sign * speed)) < 1e-3
