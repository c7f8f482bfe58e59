"""The preflight check of the tacho counter."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, Verdict
from analysis.preflight.tacho_checks import counter_check
from analysis.signals.header import Acquisition, Channel, Device, Edge, Role, Tacho, TachoCounter

RATE, TIMEBASE = 100_000.0, 80e6
SCALING = (0.0, 10.0 / 32768.0)
COUNTER = TachoCounter("ctr0", "PFI0", Edge.RISING, TIMEBASE, is_reference=True, max_difference=50e-6)
ACQUISITION = Acquisition(
    device=Device("simulated", "USB-6251", "1", "", simulated=True),
    rate=RATE,
    convert_rate=300_000.0,
    channels=tuple(
        Channel(role.value, role, f"ai{k}", -10.0, 10.0, SCALING)
        for k, role in enumerate((Role.PROBE_X, Role.PROBE_Y, Role.TACHO))
    ),
    tacho=Tacho(threshold=2.5, hysteresis=1.0, counter=COUNTER),
)
EDGES: NDArray[np.float64] = 0.004 + 0.01 * np.arange(100.0)


def codes(edges: NDArray[np.float64] = EDGES, light: float = 0.004) -> NDArray[np.int16]:
    """Return a second of a tacho that rises at these times, s, within 40 µs."""
    time = np.arange(int(RATE)) / RATE + 2 / ACQUISITION.convert_rate
    corners = (edges[:, np.newaxis] + np.array([-2e-5, 2e-5, light - 2e-5, light + 2e-5])).ravel()
    volts = np.interp(time, corners, np.tile([0.0, 5.0, 5.0, 0.0], edges.size))
    return np.stack([np.zeros(time.size), np.zeros(time.size), volts / SCALING[1]]).round().astype(np.int16)


def stamps(edges: NDArray[np.float64] = EDGES) -> NDArray[np.int64]:
    return np.floor(edges * TIMEBASE).astype(np.int64)


def checked(ticks: NDArray[np.int64] | None, *, is_reference: bool = True) -> Check:
    counter = replace(COUNTER, is_reference=is_reference)
    acquisition = replace(ACQUISITION, tacho=replace(ACQUISITION.tacho, counter=counter))
    return counter_check(acquisition, codes(), ticks)


def test_counter_that_times_every_edge_passes_and_shows_the_largest_difference() -> None:
    check = checked(stamps())
    assert check.verdict is Verdict.GOOD
    assert check.value.startswith(("99 edges, 0.", "100 edges, 0."))


@pytest.mark.parametrize(
    ("ticks", "finding", "advice"),
    [
        (None, Finding.SILENT, "no timestamps"),
        (np.empty(0, np.int64), Finding.SILENT, "PFI0 none"),
        (stamps(np.sort(np.concatenate([EDGES, EDGES[20:40] + 2e-6]))), Finding.COUNT, "missed or doubled at PFI0"),
        (stamps(np.delete(EDGES, [30, 40])), Finding.COUNT, "missed or doubled at PFI0"),
        (stamps(EDGES + 0.004), Finding.REVERSED, "tacho.counter.edge"),
    ],
)
@pytest.mark.parametrize("is_reference", [True, False])
def test_counter_mismatch_fails_only_if_the_counter_is_the_reference(
    ticks: NDArray[np.int64] | None, finding: Finding, advice: str, *, is_reference: bool
) -> None:
    check = checked(ticks, is_reference=is_reference)
    assert check.finding is finding
    assert advice in check.advice
    assert check.verdict is (Verdict.FAIL if is_reference else Verdict.WARN)


def test_slightly_late_timestamps_are_a_warning() -> None:
    check = checked(stamps(EDGES + 80e-6))
    assert (check.verdict, check.finding) == (Verdict.WARN, Finding.SCATTER)
    assert "up to 80" in check.value


@pytest.mark.parametrize("stamped", [0, 100])
def test_samples_without_an_edge_are_inconclusive_for_any_timestamps(stamped: int) -> None:
    still = np.zeros((3, int(RATE)), np.int16)
    check = counter_check(ACQUISITION, still, stamps()[:stamped])
    assert (check.verdict, check.finding, check.value) == (Verdict.WARN, Finding.INCONCLUSIVE, f"{stamped} timestamps")


def test_too_few_edges_are_a_warning() -> None:
    check = counter_check(ACQUISITION, codes(EDGES[10:12]), stamps(EDGES[10:12]))
    assert (check.verdict, check.finding) == (Verdict.WARN, Finding.STILL)


def test_acquisition_without_a_counter_raises() -> None:
    with pytest.raises(ValueError, match="no counter"):
        counter_check(replace(ACQUISITION, tacho=replace(ACQUISITION.tacho, counter=None)), codes(), None)
