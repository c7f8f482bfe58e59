"""Limits of standards, with scope and source."""

import math

import numpy as np
import pytest

from analysis.signals.standards import allowed_combined_runout, permissible_unbalance, standard_limits
from analysis.signals.units import MICROMETRE, RPM


def test_standard_limits_are_those_quoted_with_their_scope() -> None:
    at = {figure.name: figure for figure in standard_limits(2 * np.pi * 200.0)}  # 12,000 r/min
    assert at["vibration limit"].limit == pytest.approx(25.4 * MICROMETRE)
    assert at["zone boundary A/B"].limit == pytest.approx(4800 / np.sqrt(12_000) * MICROMETRE)
    assert at["combined run-out"].limit == pytest.approx(6.4 * MICROMETRE)
    fast = {figure.name: figure for figure in standard_limits(2 * np.pi * 1000.0)}  # 60,000 r/min
    assert math.isnan(fast["zone boundary A/B"].limit)
    assert not fast["zone boundary A/B"].in_scope
    assert fast["vibration limit"].limit == pytest.approx(25.4 * np.sqrt(0.2) * MICROMETRE)
    assert all(figure.scope for figure in fast.values())
    assert all("not checked against the standard's text" in figure.source for figure in fast.values())


def test_permissible_unbalance_follows_the_balance_grade() -> None:
    assert permissible_unbalance(2.5e-3, 1.0, 3000 * RPM) == pytest.approx(9549e-9 * 2.5 / 3000 * 1e3, rel=1e-3)
    with pytest.raises(ValueError, match="grade"):
        permissible_unbalance(0.0, 1.0, 1.0)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_invalid_speed_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="speed"):
        standard_limits(speed)


def test_allowed_run_out_is_a_quarter_of_the_vibration_or_6_4_micrometres() -> None:
    assert allowed_combined_runout(10 * MICROMETRE) == pytest.approx(6.4 * MICROMETRE)
    assert allowed_combined_runout(80 * MICROMETRE) == pytest.approx(20 * MICROMETRE)
    with pytest.raises(ValueError, match="allowed"):
        allowed_combined_runout(math.nan)
