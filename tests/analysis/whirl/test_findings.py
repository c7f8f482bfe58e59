"""Whirl findings from successive frames."""

from collections.abc import Sequence

import numpy as np
import pytest

from analysis.signals.blocks import RampDirection
from analysis.signals.snapshot import OrderFrame, Whirl
from analysis.whirl.findings import MAX_FINDINGS, WhirlFinding, WhirlTracker, whirl_hysteresis

HOP = 0.1


def frame(speed: float, *orders: float | None, amplitude: float = 5e-6, forward: bool = True) -> OrderFrame:
    """Return a frame of 16 revolutions at a speed, rad/s, with whirls of given orders."""
    circles = (amplitude, 0.0) if forward else (0.0, amplitude)
    whirls = tuple(Whirl(each, *circles, np.zeros(2, dtype=np.complex128)) for each in orders if each is not None)
    return OrderFrame(
        speed=speed,
        acceleration=0.0,
        orders=np.arange(129) / 16,
        spectrum=np.zeros((2, 129), dtype=np.complex128),
        vectors=np.zeros((2, 2), dtype=np.complex128),
        noise=1e-9,
        whirls=whirls,
        orbit=np.zeros((2, 256)),
    )


def found(orders: Sequence[float | None], speed: float = 1000.0, rise: float = 10.0) -> tuple[WhirlFinding, ...]:
    tracker = WhirlTracker()
    for number, order in enumerate(orders):
        tracker.add_frame(0, HOP * (number + 1), frame(speed + rise * number, order))
    return tracker.findings()


def test_whirls_of_successive_frames_are_one_finding() -> None:
    orders = [None] * 5 + [0.49 - 0.001 * k for k in range(20)] + [None] * 20
    (finding,) = found(orders)
    assert finding.frames == 20
    assert finding.order == pytest.approx(0.4805)
    assert finding.order_at_onset == pytest.approx(0.489)
    assert (finding.onset.speed, finding.end.speed) == (1050.0, 1240.0)
    assert finding.onset.time == pytest.approx(0.6 - 16 * np.pi / 1050)
    assert finding.is_forward


def test_component_that_replaces_another_is_a_separate_finding() -> None:
    findings = found([0.49] * 20 + [0.17] * 20)
    assert [round(finding.order, 2) for finding in findings] == [0.49, 0.17]
    assert findings[1].onset.speed == 1200.0


def test_alternating_components_are_tracked_in_parallel() -> None:
    findings = found([0.49, 0.17] * 15)
    assert [(round(finding.order, 2), finding.frames) for finding in findings] == [(0.49, 15), (0.17, 15)]


def test_single_frames_and_single_disturbances_are_no_finding() -> None:
    assert found([None, 0.3, None, None, 0.6, None, 0.45, None]) == ()
    slow = found([None] * 3 + [0.4] * 8 + [None] * 20, speed=105.0, rise=0.0)  # 16 revolutions take 0.96 s
    assert slow == ()


def test_only_a_long_break_splits_a_finding() -> None:
    assert len(found([0.49] * 10 + [None] * 3 + [0.49] * 10)) == 1
    assert len(found([0.49] * 10 + [None] * 8 + [0.49] * 10)) == 2


def test_active_component_is_a_finding_and_ends_with_its_segment() -> None:
    tracker = WhirlTracker()
    for number in range(10):
        tracker.add_frame(0, HOP * (number + 1), frame(1000.0, 0.49, amplitude=1e-6 * (number + 1), forward=False))
    assert tracker.findings()[0].frames == 10
    assert tracker.findings()[0].amplitude == pytest.approx(10e-6)
    assert not tracker.findings()[0].is_forward
    tracker.end_segment()
    for number in range(10):
        tracker.add_frame(1, HOP * (number + 1), frame(1000.0, 0.49))
    assert [finding.onset.segment for finding in tracker.findings()] == [0, 1]


def test_number_of_findings_is_bounded() -> None:
    tracker = WhirlTracker()
    for segment in range(MAX_FINDINGS + 20):
        for number in range(4):
            tracker.add_frame(segment, HOP * (number + 1), frame(1000.0, 0.49, amplitude=1e-6 * (segment + 1)))
        tracker.end_segment()
    findings = tracker.findings()
    assert len(findings) == MAX_FINDINGS
    assert findings[0].onset.segment == 20


def test_simultaneous_components_are_tracked_in_parallel() -> None:
    tracker = WhirlTracker()
    for number in range(30):
        orders = (0.17, 0.49) if number % 2 else (0.49 + 0.001 * number, 0.17)
        tracker.add_frame(0, HOP * (number + 1), frame(1000.0 + number, *orders))
    assert sorted(finding.order for finding in tracker.findings()) == pytest.approx([0.17, 0.497], abs=0.01)
    assert [finding.frames for finding in tracker.findings()] == [30, 30]


def test_hysteresis_contains_onset_on_run_up_and_end_on_run_down() -> None:
    tracker = WhirlTracker()
    up, down = np.arange(900.0, 1500.0, 10.0), np.arange(1500.0, 800.0, -10.0)
    speeds = [(speed, RampDirection.RUN_UP, 1100.0 <= speed < 1400.0) for speed in up.tolist()]
    speeds += [(speed, RampDirection.RUN_DOWN, 1000.0 < speed <= 1390.0) for speed in down.tolist()]
    for number, (speed, direction, there) in enumerate(speeds):
        tracker.add_frame(0, HOP * (number + 1), frame(speed, 0.48 if there else None), direction)
    first, second = tracker.findings()
    assert (first.onset_direction, first.end_direction) == (RampDirection.RUN_UP, RampDirection.RUN_UP)
    assert (second.onset_direction, second.end_direction) == (RampDirection.RUN_DOWN, RampDirection.RUN_DOWN)
    (found,) = whirl_hysteresis(tracker.findings())
    assert found.order == pytest.approx(0.48)
    assert (found.onset, found.end) == (1100.0, 1010.0)
    assert found.width == pytest.approx(90.0)
    assert whirl_hysteresis((first,)) == ()
