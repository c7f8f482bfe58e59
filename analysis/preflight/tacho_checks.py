"""Preflight checks of the tacho: wiring, levels, noise, pulses, keyphasor mark, speed limit; and of its counter."""

from dataclasses import dataclass

import numpy as np

from analysis.preflight.calibration import SignalLevels, find_state_levels
from analysis.preflight.check_result import Check, Finding, WiringLimits
from analysis.resampling.angular_record import tacho_edges
from analysis.signals import CodeArray, FloatArray, IntArray
from analysis.signals.header import Acquisition, Channel, Edge, Tacho, TachoCounter
from analysis.signals.snapshot import CounterReport, CounterState
from analysis.signals.uncertainty import MAD_TO_SIGMA
from analysis.signals.units import MICROSECOND, MILLISECOND, MILLIVOLT, RPM
from analysis.tacho.edges import SETTLING_TIME, START_MARGIN, CounterComparison, edge_detector

MIN_EDGES = 3  # for a speed
MIN_NOISE_MARGIN = 6.0  # times the scatter, from a level to its switching level
HYSTERESIS_RANGE = (0.1, 0.5)  # of the swing: below, noisy slow edges count twice; above, a weak pulse is missed
WARNING_FRACTION = 0.9  # of the speed limit, for a warning
MAX_RANGE_FRACTION = 0.98  # of the card's range, of a level
MIN_WRONG_EDGE_OFFSET = 0.02  # of the period: then the counter times the other edge of the mark, or another signal


@dataclass(frozen=True, slots=True, eq=False)
class TachoSignal:
    """A stretch of the tacho's samples.

    Parameters
    ----------
    channel : Channel
        Channel of the tacho.
    tacho : Tacho
        Settings of the tacho.
    volts : ndarray of float64, shape (n,)
        Consecutive samples, V.
    rate : float
        Sample rate, Hz.
    levels : SignalLevels or None
        Its two levels; None where it does not switch.
    edges : ndarray of float64
        Positions of the edges at the configured switching levels, in samples.
    """

    channel: Channel
    tacho: Tacho
    volts: FloatArray
    rate: float
    levels: SignalLevels | None
    edges: FloatArray

    @classmethod
    def from_codes(cls, channel: Channel, tacho: Tacho, codes: CodeArray, rate: float) -> "TachoSignal":
        """Return the signal of the tacho channel; ValueError without samples."""
        volts = channel.volts(codes)
        return cls(channel, tacho, volts, rate, find_state_levels(volts), edge_detector(tacho).edges(volts, 0))

    @property
    def angle(self) -> FloatArray | None:
        """Shaft angle at the samples, rad, from one of the marks; None with too few revolutions."""
        edges = self.edges[:: self.tacho.pulses_per_revolution]  # one mark only: the spacing may be uneven
        if edges.size < MIN_EDGES:
            return None
        turns = np.arange(edges.size, dtype=np.float64)
        sample = np.arange(self.volts.size, dtype=np.float64)
        first = (turns[1] - turns[0]) / (edges[1] - edges[0])
        last = (turns[-1] - turns[-2]) / (edges[-1] - edges[-2])
        angle = np.interp(sample, edges, turns)
        angle = np.where(sample < edges[0], turns[0] + first * (sample - edges[0]), angle)
        angle = np.where(sample > edges[-1], turns[-1] + last * (sample - edges[-1]), angle)
        return np.asarray(2.0 * np.pi * angle, dtype=np.float64)

    @property
    def speed(self) -> float:
        """Mean speed, rad/s; NaN with too few edges."""
        if self.edges.size < MIN_EDGES:
            return np.nan
        turns = (self.edges.size - 1) / self.tacho.pulses_per_revolution
        return float(2.0 * np.pi * turns * self.rate / (self.edges[-1] - self.edges[0]))

    @property
    def scatter(self) -> float:
        """Relative robust scatter of the periods about their trend; NaN with too few edges."""
        marks = self.tacho.pulses_per_revolution  # each mark is compared with itself: the spacing may be uneven
        turns = self.edges[marks:] - self.edges[:-marks]
        if turns.size < 2 * marks + MIN_EDGES - 2:
            return np.nan
        # Second differences cancel a steady acceleration; they have 6 times the variance of white scatter.
        differences = turns[2 * marks :] - 2.0 * turns[marks:-marks] + turns[: -2 * marks]
        return float(MAD_TO_SIGMA * np.median(np.abs(differences)) / np.sqrt(6.0) / np.median(turns) * marks)


def tacho_checks(signal: TachoSignal, limits: WiringLimits, *, motion: bool) -> list[Check]:
    """Return the checks of the tacho signal.

    Parameters
    ----------
    signal : TachoSignal
        About a second of samples.
    limits : WiringLimits
        Limits of the checks.
    motion : bool
        Whether both probes measure motion of the shaft.
    """
    levels = signal.levels
    if levels is None:
        return [_one_level_check(signal, motion=motion)]
    checks = [_levels_check(signal, levels)]
    if checks[0].finding is None:
        checks += [
            _hysteresis_check(signal, levels),
            _noise_check(signal, levels),
            _pulses_check(signal, limits.tacho_scatter),
            _mark_check(signal, levels, limits.mark_tolerance),
        ]
    return checks


def speed_limit_check(tacho: Tacho, speed: float) -> Check:
    """Return the check that the sensor response suffices at the highest planned speed, rad/s."""
    shorter = min(tacho.mark_fraction, 1.0 - tacho.mark_fraction)
    name, value = "tacho speed limit", f"{speed / RPM:,.0f} r/min planned"
    if tacho.response_time == 0.0:
        return Check(name, value, "none: response_time_s = 0")
    highest = 2.0 * np.pi * shorter / tacho.response_time / tacho.pulses_per_revolution
    limit = f"{highest / RPM:,.0f} r/min"
    check = Check(name, value, limit)
    mark = (
        f"a mark over {100 * tacho.mark_fraction:.0f} % of a revolution and a response time of "
        f"{tacho.response_time / MILLISECOND:g} ms"
    )
    if speed > highest:
        return check.fail(
            Finding.SPEED,
            f"with {mark} pulses are missed unnoticed above {limit}: paint half of the circumference, or use a faster "
            "sensor",
        )
    if speed > WARNING_FRACTION * highest:
        return check.warn(
            Finding.SPEED, f"with {mark} the sensor misses pulses just above this speed: watch for a speed that halves"
        )
    return check


def _one_level_check(signal: TachoSignal, *, motion: bool) -> Check:
    level = float(np.median(signal.volts))
    low, high = _switching(signal.tacho)
    check = Check("tacho levels", f"{level:.2f} V, no pulse", f"below {low:g} and above {high:g} V in turn")
    if motion:
        return check.fail(
            Finding.SILENT,
            f"the probes measure a turning shaft, but the tacho stays at {level:.2f} V: unplugged, without supply, or "
            "not aimed at the mark",
        )
    if low <= level <= high:
        return check.fail(
            Finding.LEVELS,
            f"the tacho stays at {level:.2f} V, between its switching levels: unplugged, or levels set wrong",
        )
    return check.warn(
        Finding.STILL,
        "the shaft is at rest, so the mark and the direction of the orbit cannot be checked: turn the shaft by hand "
        "and repeat the check",
    )


def _levels_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    low, high = _switching(signal.tacho)
    value = f"{levels.low:.2f} and {levels.high:.2f} V"
    check = Check("tacho levels", value, f"below {low:g} and above {high:g} V in turn")
    proposal = f"threshold_v = {levels.middle:.2g}, hysteresis_v = {levels.hysteresis:.2g}"
    if levels.low < low and levels.high > high:
        if (
            levels.high > MAX_RANGE_FRACTION * signal.channel.range_high
            or levels.low < MAX_RANGE_FRACTION * signal.channel.range_low
        ):
            return check.warn(
                Finding.CLIPPED,
                f"the tacho reaches the range of {signal.channel.physical}: use a larger range_v, or a divider",
            )
        return check
    if -levels.high < low and -levels.low > high:
        return check.fail(
            Finding.REVERSED,
            f"the tacho switches between {value}: the two wires at {signal.channel.physical} are exchanged, or the "
            "sensor is wired to the wrong pole of its supply",
        )
    return check.fail(
        Finding.LEVELS,
        f"the tacho switches between {value}, but its switching levels are {low:g} and {high:g} V: wrong divider or "
        f"supply, or [tacho] should be {proposal} (rig calibrate tacho)",
    )


def _hysteresis_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    lowest, highest = HYSTERESIS_RANGE
    share = signal.tacho.hysteresis / levels.separation
    check = Check(
        "tacho hysteresis",
        f"{signal.tacho.hysteresis:g} V, {100 * share:.0f} % of the swing",
        f"{100 * lowest:.0f} to {100 * highest:.0f} % of {levels.separation:.2f} V",
    )
    if lowest <= share <= highest:
        return check
    effect = "noise on a slow edge counts twice" if share < lowest else "a slightly weaker pulse is missed"
    return check.warn(
        Finding.LEVELS, f"{effect}: hysteresis_v = {levels.hysteresis:.2g} suits the tacho levels (rig calibrate tacho)"
    )


def _noise_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    low, high = _switching(signal.tacho)
    needed = MIN_NOISE_MARGIN * levels.scatter
    margin = min(low - levels.low, levels.high - high, signal.tacho.hysteresis)
    limit = f"{margin / MIN_NOISE_MARGIN / MILLIVOLT:.0f} mV rms"
    check = Check("tacho noise", f"{levels.scatter / MILLIVOLT:.0f} mV rms", limit)
    if margin >= needed:
        return check
    return check.warn(
        Finding.NOISE,
        f"noise can switch the tacho: threshold_v = {levels.middle:.2g}, hysteresis_v = {levels.hysteresis:.2g} suit "
        "its levels; check its shield",
    )


def _pulses_check(signal: TachoSignal, max_scatter: float) -> Check:
    name, limit = "tacho pulses", f"scatter below {100 * max_scatter:g} % of the period"
    if signal.edges.size < MIN_EDGES:
        return Check(name, f"{signal.edges.size} pulses", f"at least {MIN_EDGES}").warn(
            Finding.STILL, "too few pulses for a speed: turn the shaft faster and repeat the check"
        )
    speed, scatter = signal.speed / RPM, signal.scatter
    if np.isnan(scatter):
        return Check(name, f"{speed:,.0f} r/min", limit)
    check = Check(name, f"{speed:,.0f} r/min, scatter {100 * scatter:.2f} %", limit)
    if scatter <= max_scatter:
        return check
    return check.warn(
        Finding.SCATTER, "the pulses are uneven: wrong pulses_per_revolution, a dirty mark, or the sensor too far away"
    )


def _mark_check(signal: TachoSignal, levels: SignalLevels, tolerance: float) -> Check:
    configured, seen = signal.tacho.mark_fraction, levels.high_fraction
    check = Check(
        "tacho mark", f"light for {100 * seen:.0f} % of the time", f"{100 * configured:.0f} ± {100 * tolerance:.0f} %"
    )
    whole_turns = signal.edges.size > 1 / tolerance  # else an incomplete revolution biases the duty cycle
    if abs(seen - configured) <= tolerance or not whole_turns:
        return check
    if abs(1.0 - seen - configured) <= tolerance:
        other = Edge.FALLING if signal.tacho.edge is Edge.RISING else Edge.RISING
        return check.warn(
            Finding.REVERSED,
            f"light and dark are exchanged (NPN for PNP, dark-on for light-on): edge = {other.value!r} may be correct",
        )
    return check.warn(
        Finding.DUTY,
        "the width of the mark differs from mark_fraction, or the sensitivity of the sensor is wrong: the speed limit "
        "is wrong",
    )


def _switching(tacho: Tacho) -> tuple[float, float]:
    return tacho.threshold - 0.5 * tacho.hysteresis, tacho.threshold + 0.5 * tacho.hysteresis


# to compare


def counter_check(acquisition: Acquisition, codes: CodeArray, ticks: IntArray | None) -> Check:
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
        return _bad(
            counter,
            Finding.SILENT,
            "failed",
            "the counter delivered no timestamps: speed uses the samples; see the driver's error at the end of a run",
        )
    sampled, duration = tacho_edges(acquisition, codes), codes.shape[1] / acquisition.rate
    if sampled.size == 0:
        return Check("tacho counter", f"{ticks.size} timestamps", _limit(counter)).warn(
            Finding.INCONCLUSIVE,
            "the samples contain no edge to compare the counter with: with the shaft at rest, turn it by hand and "
            "repeat the check; else correct the tacho signal first",
        )
    comparison = CounterComparison(counter)
    comparison.advance(sampled, ticks / counter.timebase, duration - START_MARGIN + SETTLING_TIME)
    report = comparison.report(is_working=True)
    if report.compared + report.missing + report.extra < MIN_EDGES:
        return Check("tacho counter", f"{ticks.size} timestamps", _limit(counter)).warn(
            Finding.STILL, "too few edges to compare counter and samples: turn the shaft by hand during the check"
        )
    return _compared(counter, report, float(np.median(np.diff(sampled))) if sampled.size > 1 else np.nan)


def _compared(counter: TachoCounter, report: CounterReport, period: float) -> Check:
    if report.state is CounterState.AGREES:
        value = f"{report.compared:,} edges, {report.largest_difference / MICROSECOND:.2f} µs at most"
        return Check("tacho counter", value, _limit(counter))
    value = f"{report.compared:,} matched, {report.missing:,} missing, {report.extra:,} extra"
    if report.compared == 0 and not report.extra:
        return _bad(
            counter,
            Finding.SILENT,
            value,
            f"the tacho channel has edges, {counter.terminal} none: the tacho is not wired to it, or its levels do not "
            "cross 0.8 and 2.2 V there",
        )
    most_are_apart = (
        2 * report.out_of_tolerance > report.compared and report.largest_difference > MIN_WRONG_EDGE_OFFSET * period
    )
    if report.compared == 0 or most_are_apart:
        return _bad(
            counter,
            Finding.REVERSED,
            value,
            f"the counter times other edges than the samples: check tacho.counter.edge and the wiring of "
            f"{counter.terminal}",
        )
    if report.state is CounterState.COUNT_DIFFERS:
        return _bad(
            counter,
            Finding.COUNT,
            value,
            f"edges are missed or doubled at {counter.terminal}, whose line has no adjustable hysteresis: check the "
            "divider and the shield",
        )
    return Check("tacho counter", report.message, _limit(counter)).warn(
        Finding.SCATTER,
        "slow edges pass the line's levels at another time than threshold_v: raise max_difference_us, or mend the "
        "edges",
    )


def _bad(counter: TachoCounter, finding: Finding, value: str, advice: str) -> Check:
    """Return a check that fails if the counter is the reference of speed and phase, and else warns."""
    check = Check("tacho counter", value, _limit(counter))
    return check.fail(finding, advice) if counter.is_reference else check.warn(finding, advice)


def _limit(counter: TachoCounter) -> str:
    return f"each edge, within {counter.max_difference / MICROSECOND:g} µs of the samples"
