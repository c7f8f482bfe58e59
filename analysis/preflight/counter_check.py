"""Whether the tacho's counter stamps what its channel sees, before a run is trusted to it."""

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.checks import Check, Finding
from analysis.resampling.angular_record import tacho_edges
from analysis.signals.header import Acquisition, TachoCounter
from analysis.signals.snapshot import CounterReport, CounterState
from analysis.tacho.counter_comparison import SETTLING_TIME, START_MARGIN, CounterComparison

MIN_EDGES = 3  # to compare
MIN_WRONG_EDGE_OFFSET = (
    0.02  # of the time between edges: stamps so far off are of the mark's other edge, or of another signal
)


def counter_check(acquisition: Acquisition, codes: NDArray[np.int16], ticks: NDArray[np.int64] | None) -> Check:
    """Return whether a stretch of samples and what was stamped with it agree.

    Parameters
    ----------
    acquisition : Acquisition
        With a counter for its tacho.
    codes : ndarray of int16, shape (n_channels, n)
        Samples from a segment's first on.
    ticks : ndarray of int64, shape (n_pulses,), or None
        What the counter stamped; None where it failed.

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
            "the counter gave no stamps: what the driver says of it is told when a run ends; speed comes from samples"
        )
        return _bad(counter, Finding.SILENT, "failed", advice)
    sampled, duration = tacho_edges(acquisition, codes), codes.shape[1] / acquisition.rate
    if sampled.size == 0:
        advice = (
            "the samples show no edge to compare the counter with: where nothing turns, turn the shaft by hand and "
            "look again; else see to the tacho's own signal first"
        )
        return Check.warned("tacho counter", Finding.INCONCLUSIVE, f"{ticks.size} stamps", _limit(counter), advice)
    comparison = CounterComparison(counter)
    comparison.advance(sampled, ticks / counter.timebase, duration - START_MARGIN + SETTLING_TIME)
    report = comparison.report(is_working=True)
    if report.compared + report.missing + report.extra < MIN_EDGES:
        advice = "hardly anything turns, so counter and samples cannot be compared: turn the shaft by hand meanwhile"
        return Check.warned("tacho counter", Finding.STILL, f"{ticks.size} stamps", _limit(counter), advice)
    return _compared(counter, report, float(np.median(np.diff(sampled))) if sampled.size > 1 else np.nan)


def _compared(counter: TachoCounter, report: CounterReport, period: float) -> Check:
    if report.state is CounterState.AGREES:
        value = f"{report.compared:,} edges, {report.largest_difference * 1e6:.2f} µs at most"
        return Check.passed("tacho counter", value, _limit(counter))
    value = f"{report.compared:,} alike, {report.missing:,} not stamped, {report.extra:,} too many"
    if report.compared == 0 and not report.extra:
        advice = (
            f"the tacho's channel sees edges and {counter.terminal} none: not wired to it, or its levels do not pass "
            "0.8 and 2.2 V there"
        )
        return _bad(counter, Finding.SILENT, value, advice)
    most_are_apart = (
        2 * report.out_of_tolerance > report.compared and report.largest_difference > MIN_WRONG_EDGE_OFFSET * period
    )
    if report.compared == 0 or most_are_apart:
        advice = (
            f"the counter stamps other edges than the samples show: look at tacho.counter.edge and {counter.terminal}"
        )
        return _bad(counter, Finding.REVERSED, value, advice)
    if report.state is CounterState.COUNT_DIFFERS:
        advice = (
            f"edges are missed or doubled at {counter.terminal}: its line has no hysteresis to choose; look at the "
            "divider and the shield"
        )
        return _bad(counter, Finding.COUNT, value, advice)
    advice = (
        "slow edges pass the line's levels at another time than threshold_v: raise max_difference_us, or mend the edges"
    )
    return Check.warned("tacho counter", Finding.SCATTER, report.message, _limit(counter), advice)


def _bad(counter: TachoCounter, finding: Finding, value: str, advice: str) -> Check:
    """Return a check that fails where speed and phase rest on the counter."""
    judged = Check.failed if counter.is_reference else Check.warned
    return judged("tacho counter", finding, value, _limit(counter), advice)


def _limit(counter: TachoCounter) -> str:
    return f"each edge, within {counter.max_difference * 1e6:g} µs of the samples"
