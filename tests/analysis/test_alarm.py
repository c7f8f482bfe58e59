"""The latched alarm."""

import math

import numpy as np
import pytest

from analysis.acceptance import figures, unbalance_allowed
from analysis.alarm import LatchedAlarm
from analysis.run import Limits, Severity

MICRO = 1e-6
LIMITS = Limits(80 * MICRO, 95 * MICRO, 100 * MICRO, 2000.0)


def fed(alarm: LatchedAlarm, values: list[float], begin: float = 0.0) -> list[Severity]:
    return [alarm.update(value * MICRO, begin + 0.5 * step).now for step, value in enumerate(values)]


def test_a_limit_must_be_held_before_it_counts() -> None:
    alarm = LatchedAlarm(LIMITS, delay=1.0)
    normal, raised = Severity.NORMAL, Severity.ALARM
    assert fed(alarm, [70, 85, 70, 85, 85, 85]) == [normal, normal, normal, normal, normal, raised]
    assert alarm.state.since == 2.5


def test_it_falls_by_the_hysteresis_but_stays_latched_until_somebody_has_seen_it() -> None:
    alarm = LatchedAlarm(LIMITS, hysteresis=0.05, delay=0.0)
    assert fed(alarm, [96, 92, 90, 77, 75]) == [
        Severity.DANGER, Severity.DANGER, Severity.ALARM, Severity.ALARM, Severity.NORMAL,
    ]  # fmt: skip
    state = alarm.state
    assert (state.now, state.latched, state.since) == (Severity.NORMAL, Severity.DANGER, 0.0)
    assert state.largest == pytest.approx(96 * MICRO)
    seen = alarm.acknowledge(9.0)
    assert seen.latched is Severity.NORMAL
    assert math.isnan(seen.since)


def test_acknowledging_while_it_lasts_keeps_it() -> None:
    alarm = LatchedAlarm(LIMITS, delay=0.0)
    fed(alarm, [96])
    assert alarm.acknowledge(3.0).latched is Severity.DANGER


def test_what_is_not_known_changes_nothing() -> None:
    alarm = LatchedAlarm(LIMITS, delay=0.0)
    assert fed(alarm, [85, math.nan, 79]) == [Severity.ALARM] * 3
    assert fed(LatchedAlarm(LIMITS, delay=0.0), [math.nan]) == [Severity.NORMAL]


@pytest.mark.parametrize(("hysteresis", "delay"), [(1.0, 0.0), (-0.1, 0.0), (0.0, math.nan)])
def test_settings_out_of_range_are_refused(hysteresis: float, delay: float) -> None:
    with pytest.raises(ValueError, match="hysteresis"):
        LatchedAlarm(LIMITS, hysteresis, delay)


def test_figures_of_standards_are_those_quoted_and_say_their_scope() -> None:
    at = {figure.name: figure for figure in figures(2 * np.pi * 200.0)}  # 12,000 r/min
    assert at["vibration limit"].limit == pytest.approx(25.4 * MICRO)
    assert at["zone boundary A/B"].limit == pytest.approx(4800 / np.sqrt(12_000) * MICRO)
    assert at["combined run-out"].limit == pytest.approx(6.4 * MICRO)
    fast = {figure.name: figure for figure in figures(2 * np.pi * 1000.0)}  # 60,000 r/min
    assert math.isnan(fast["zone boundary A/B"].limit)
    assert not fast["zone boundary A/B"].in_scope
    assert fast["vibration limit"].limit == pytest.approx(25.4 * np.sqrt(0.2) * MICRO)
    assert all(figure.scope for figure in fast.values())
    with pytest.raises(ValueError, match="speed"):
        figures(0.0)


def test_permissible_unbalance_is_that_of_the_grade() -> None:
    assert unbalance_allowed(2.5e-3, 1.0, 2 * np.pi * 3000 / 60) == pytest.approx(9549e-9 * 2.5 / 3000 * 1e3, rel=1e-3)
    with pytest.raises(ValueError, match="grade"):
        unbalance_allowed(0.0, 1.0, 1.0)
