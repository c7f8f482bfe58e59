"""Preflight check of the tacho counter: its timestamps must agree with the edges in the tacho channel."""

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding
from analysis.resampling.angular_record import tacho_edges
from analysis.signals.header import Acquisition, TachoCounter
from analysis.signals.snapshot import CounterReport, CounterState
from analysis.signals.units import MICROSECOND
from analysis.tacho.counter_comparison import SETTLING_TIME, START_MARGIN, CounterComparison

MIN_EDGES = 3  # to compare
MIN_WRONG_EDGE_OFFSET = 0.02  # of the period: then the counter times the other edge of the mark, or another signal


def counter_check(acquisition: Acquisition, codes: NDArray[np.int16], ticks: NDArray[np.int64] | None) -> Check:
    """Return the check of the counter's timestamps against a stretch of samples.

    Parameters
    ----------
    acquisition : Acquisition
        Acquisition with a tacho counter.
    codes : ndarray of int16, shape (n_channels, n)
        Samples from the first of a segment on.
    ticks : ndarray of int64, shape (n_pulses,), or None
        Timestamps of the counter; None where it failed.

    Raises
    ------
    ValueError
        The tacho has no counter.
    """
    counter = acquisition.tacho.counter
    if counter is None:
        raise ValueError("acquisition: the tacho has no counter, expected one to check")
    if ticks is None:
        advice = (
            "the counter delivered no timestamps: speed uses the samples; see the driver's error at the end of a run"
        )
        return _bad(counter, Finding.SILENT, "failed", advice)
    sampled, duration = tacho_edges(acquisition, codes), codes.shape[1] / acquisition.rate
    if sampled.size == 0:
        advice = (
            "the samples contain no edge to compare the counter with: with the shaft at rest, turn it by hand and "
            "repeat the check; else correct the tacho signal first"
        )
        return Check.warned("tacho counter", Finding.INCONCLUSIVE, f"{ticks.size} timestamps", _limit(counter), advice)
    comparison = CounterComparison(counter)
    comparison.advance(sampled, ticks / counter.timebase, duration - START_MARGIN + SETTLING_TIME)
    report = comparison.report(is_working=True)
    if report.compared + report.missing + report.extra < MIN_EDGES:
        advice = "too few edges to compare counter and samples: turn the shaft by hand during the check"
        return Check.warned("tacho counter", Finding.STILL, f"{ticks.size} timestamps", _limit(counter), advice)
    return _compared(counter, report, float(np.median(np.diff(sampled))) if sampled.size > 1 else np.nan)


def _compared(counter: TachoCounter, report: CounterReport, period: float) -> Check:
    if report.state is CounterState.AGREES:
        value = f"{report.compared:,} edges, {report.largest_difference / MICROSECOND:.2f} µs at most"
        return Check.passed("tacho counter", value, _limit(counter))
    value = f"{report.compared:,} matched, {report.missing:,} missing, {report.extra:,} extra"
    if report.compared == 0 and not report.extra:
        advice = (
            f"the tacho channel has edges, {counter.terminal} none: the tacho is not wired to it, or its levels do not "
            "cross 0.8 and 2.2 V there"
        )
        return _bad(counter, Finding.SILENT, value, advice)
    most_are_apart = (
        2 * report.out_of_tolerance > report.compared and report.largest_difference > MIN_WRONG_EDGE_OFFSET * period
    )
    if report.compared == 0 or most_are_apart:
        advice = (
            f"the counter times other edges than the samples: check tacho.counter.edge and the wiring of "
            f"{counter.terminal}"
        )
        return _bad(counter, Finding.REVERSED, value, advice)
    if report.state is CounterState.COUNT_DIFFERS:
        advice = (
            f"edges are missed or doubled at {counter.terminal}, whose line has no adjustable hysteresis: check the "
            "divider and the shield"
        )
        return _bad(counter, Finding.COUNT, value, advice)
    advice = (
        "slow edges pass the line's levels at another time than threshold_v: raise max_difference_us, or mend the edges"
    )
    return Check.warned("tacho counter", Finding.SCATTER, report.message, _limit(counter), advice)


def _bad(counter: TachoCounter, finding: Finding, value: str, advice: str) -> Check:
    """Return a check that fails if the counter is the reference of speed and phase, and else warns."""
    judged = Check.failed if counter.is_reference else Check.warned
    return judged("tacho counter", finding, value, _limit(counter), advice)


def _limit(counter: TachoCounter) -> str:
    return f"each edge, within {counter.max_difference / MICROSECOND:g} µs of the samples"
