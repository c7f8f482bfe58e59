"""Preflight checks of the tacho: wiring, switching levels, noise, pulses, keyphasor mark and speed limit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, WiringLimits
from analysis.preflight.switching_levels import SignalLevels, find_state_levels
from analysis.signals.header import Channel, Edge, Tacho
from analysis.signals.units import MILLISECOND, MILLIVOLT, RPM
from analysis.tacho.edges import edge_detector

FloatArray = NDArray[np.float64]

MIN_EDGES = 3  # for a speed
MIN_NOISE_MARGIN = 6.0  # times the scatter, from a level to its switching level
HYSTERESIS_RANGE = (0.1, 0.5)  # of the swing: below, noisy slow edges count twice; above, a weak pulse is missed
WARNING_FRACTION = 0.9  # of the speed limit, for a warning
MAX_RANGE_FRACTION = 0.98  # of the card's range, of a level


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
    def from_codes(cls, channel: Channel, tacho: Tacho, codes: NDArray[np.int16], rate: float) -> "TachoSignal":
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
        return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(6.0) / np.median(turns) * marks)


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
        return Check.passed(name, value, "none: response_time_s = 0")
    highest = 2.0 * np.pi * shorter / tacho.response_time / tacho.pulses_per_revolution
    limit = f"{highest / RPM:,.0f} r/min"
    mark = (
        f"a mark over {100 * tacho.mark_fraction:.0f} % of a revolution and a response time of "
        f"{tacho.response_time / MILLISECOND:g} ms"
    )
    if speed > highest:
        advice = (
            f"with {mark} pulses are missed unnoticed above {limit}: paint half of the circumference, or use a faster "
            "sensor"
        )
        return Check.failed(name, Finding.SPEED, value, limit, advice)
    if speed > WARNING_FRACTION * highest:
        advice = f"with {mark} the sensor misses pulses just above this speed: watch for a speed that halves"
        return Check.warned(name, Finding.SPEED, value, limit, advice)
    return Check.passed(name, value, limit)


def _one_level_check(signal: TachoSignal, *, motion: bool) -> Check:
    level = float(np.median(signal.volts))
    low, high = _switching(signal.tacho)
    name, value, limit = "tacho levels", f"{level:.2f} V, no pulse", f"below {low:g} and above {high:g} V in turn"
    if motion:
        advice = (
            f"the probes measure a turning shaft, but the tacho stays at {level:.2f} V: unplugged, without supply, or "
            "not aimed at the mark"
        )
        return Check.failed(name, Finding.SILENT, value, limit, advice)
    if low <= level <= high:
        advice = f"the tacho stays at {level:.2f} V, between its switching levels: unplugged, or levels set wrong"
        return Check.failed(name, Finding.LEVELS, value, limit, advice)
    advice = (
        "the shaft is at rest, so the mark and the direction of the orbit cannot be checked: turn the shaft by hand "
        "and repeat the check"
    )
    return Check.warned(name, Finding.STILL, value, limit, advice)


def _levels_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    low, high = _switching(signal.tacho)
    name, limit = "tacho levels", f"below {low:g} and above {high:g} V in turn"
    value = f"{levels.low:.2f} and {levels.high:.2f} V"
    proposal = f"threshold_v = {levels.middle:.2g}, hysteresis_v = {levels.hysteresis:.2g}"
    if levels.low < low and levels.high > high:
        if (
            levels.high > MAX_RANGE_FRACTION * signal.channel.range_high
            or levels.low < MAX_RANGE_FRACTION * signal.channel.range_low
        ):
            advice = f"the tacho reaches the range of {signal.channel.physical}: use a larger range_v, or a divider"
            return Check.warned(name, Finding.CLIPPED, value, limit, advice)
        return Check.passed(name, value, limit)
    if -levels.high < low and -levels.low > high:
        advice = (
            f"the tacho switches between {value}: the two wires at {signal.channel.physical} are exchanged, or the "
            "sensor is wired to the wrong pole of its supply"
        )
        return Check.failed(name, Finding.REVERSED, value, limit, advice)
    advice = (
        f"the tacho switches between {value}, but its switching levels are {low:g} and {high:g} V: wrong divider or "
        f"supply, or [tacho] should be {proposal} (rig calibrate tacho)"
    )
    return Check.failed(name, Finding.LEVELS, value, limit, advice)


def _hysteresis_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    lowest, highest = HYSTERESIS_RANGE
    share = signal.tacho.hysteresis / levels.separation
    name, value = "tacho hysteresis", f"{signal.tacho.hysteresis:g} V, {100 * share:.0f} % of the swing"
    limit = f"{100 * lowest:.0f} to {100 * highest:.0f} % of {levels.separation:.2f} V"
    if lowest <= share <= highest:
        return Check.passed(name, value, limit)
    effect = "noise on a slow edge counts twice" if share < lowest else "a slightly weaker pulse is missed"
    advice = f"{effect}: hysteresis_v = {levels.hysteresis:.2g} suits the tacho levels (rig calibrate tacho)"
    return Check.warned(name, Finding.LEVELS, value, limit, advice)


def _noise_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    low, high = _switching(signal.tacho)
    needed = MIN_NOISE_MARGIN * levels.scatter
    margin = min(low - levels.low, levels.high - high, signal.tacho.hysteresis)
    name, value = "tacho noise", f"{levels.scatter / MILLIVOLT:.0f} mV rms"
    limit = f"{margin / MIN_NOISE_MARGIN / MILLIVOLT:.0f} mV rms"
    if margin >= needed:
        return Check.passed(name, value, limit)
    advice = (
        f"noise can switch the tacho: threshold_v = {levels.middle:.2g}, hysteresis_v = {levels.hysteresis:.2g} suit "
        "its levels; check its shield"
    )
    return Check.warned(name, Finding.NOISE, value, limit, advice)


def _pulses_check(signal: TachoSignal, max_scatter: float) -> Check:
    name, limit = "tacho pulses", f"scatter below {100 * max_scatter:g} % of the period"
    if signal.edges.size < MIN_EDGES:
        advice = "too few pulses for a speed: turn the shaft faster and repeat the check"
        return Check.warned(name, Finding.STILL, f"{signal.edges.size} pulses", f"at least {MIN_EDGES}", advice)
    speed, scatter = signal.speed / RPM, signal.scatter
    if np.isnan(scatter):
        return Check.passed(name, f"{speed:,.0f} r/min", limit)
    value = f"{speed:,.0f} r/min, scatter {100 * scatter:.2f} %"
    if scatter <= max_scatter:
        return Check.passed(name, value, limit)
    advice = "the pulses are uneven: wrong pulses_per_revolution, a dirty mark, or the sensor too far away"
    return Check.warned(name, Finding.SCATTER, value, limit, advice)


def _mark_check(signal: TachoSignal, levels: SignalLevels, tolerance: float) -> Check:
    configured, seen = signal.tacho.mark_fraction, levels.high_fraction
    name, value = "tacho mark", f"light for {100 * seen:.0f} % of the time"
    limit = f"{100 * configured:.0f} ± {100 * tolerance:.0f} %"
    whole_turns = signal.edges.size > 1 / tolerance  # else an incomplete revolution biases the duty cycle
    if abs(seen - configured) <= tolerance or not whole_turns:
        return Check.passed(name, value, limit)
    if abs(1.0 - seen - configured) <= tolerance:
        other = Edge.FALLING if signal.tacho.edge is Edge.RISING else Edge.RISING
        advice = (
            f"light and dark are exchanged (NPN for PNP, dark-on for light-on): edge = {other.value!r} may be correct"
        )
        return Check.warned(name, Finding.REVERSED, value, limit, advice)
    advice = (
        "the width of the mark differs from mark_fraction, or the sensitivity of the sensor is wrong: the speed limit "
        "is wrong"
    )
    return Check.warned(name, Finding.DUTY, value, limit, advice)


def _switching(tacho: Tacho) -> tuple[float, float]:
    return tacho.threshold - 0.5 * tacho.hysteresis, tacho.threshold + 0.5 * tacho.hysteresis
