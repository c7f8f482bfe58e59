"""What the tacho's signal says of its wiring, its switching levels and its mark."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.checks import Check, Finding, WiringLimits
from analysis.preflight.switching_levels import SignalLevels, find_state_levels
from analysis.signals.header import Channel, Edge, Tacho
from analysis.tacho.edges import EdgeDetector

FloatArray = NDArray[np.float64]
RPM = 2.0 * np.pi / 60.0

MIN_EDGES = 3  # to speak of a speed
MIN_NOISE_MARGIN = 6.0  # times the scatter must fit between a level and its switching level
HYSTERESIS_RANGE = (0.1, 0.5)  # of the swing: below, slow edges with noise count twice; above, a weaker pulse is missed
WARNING_FRACTION = 0.9  # of the speed limit: from here on it is said
MAX_RANGE_FRACTION = 0.98  # of the card's range that a level may take


@dataclass(frozen=True, slots=True, eq=False)
class TachoSignal:
    """A stretch of the tacho's samples.

    Parameters
    ----------
    channel : Channel
        Of the tacho.
    tacho : Tacho
        How it is read.
    volts : ndarray of float64, shape (n,)
        Consecutive samples, V.
    rate : float
        Sample rate, Hz.
    levels : Levels or None
        Its two levels; None where it does not switch.
    edges : ndarray of float64
        Where the marks pass by the rig's switching levels, in samples.
    """

    channel: Channel
    tacho: Tacho
    volts: FloatArray
    rate: float
    levels: SignalLevels | None
    edges: FloatArray

    @classmethod
    def from_codes(cls, channel: Channel, tacho: Tacho, codes: NDArray[np.int16], rate: float) -> "TachoSignal":
        """Return the signal of the tacho's channel; ValueError where there are no samples."""
        volts = channel.volts(codes)
        return cls(channel, tacho, volts, rate, find_state_levels(volts), EdgeDetector(tacho).edges(volts, 0))

    @property
    def angle(self) -> FloatArray | None:
        """Angle of the shaft at the samples, rad, from one of its marks; None where that passes too few times."""
        edges = self.edges[:: self.tacho.pulses_per_revolution]  # several may lie unevenly
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
        """Mean speed, rad/s; NaN where too few marks pass."""
        if self.edges.size < MIN_EDGES:
            return np.nan
        turns = (self.edges.size - 1) / self.tacho.pulses_per_revolution
        return float(2.0 * np.pi * turns * self.rate / (self.edges[-1] - self.edges[0]))

    @property
    def scatter(self) -> float:
        """Robust scatter of the periods about their slow course, relative; NaN where too few marks pass."""
        marks = self.tacho.pulses_per_revolution  # each is compared with itself: several may lie unevenly
        turns = self.edges[marks:] - self.edges[:-marks]
        if turns.size < 2 * marks + MIN_EDGES - 2:
            return np.nan
        # A steady change of speed bends none; of white scatter the bends have the 6-fold power.
        bends = turns[2 * marks :] - 2.0 * turns[marks:-marks] + turns[: -2 * marks]
        return float(1.4826 * np.median(np.abs(bends)) / np.sqrt(6.0) / np.median(turns) * marks)


def tacho_checks(signal: TachoSignal, limits: WiringLimits, *, motion: bool) -> list[Check]:
    """Return what is to be said of the tacho.

    Parameters
    ----------
    signal : TachoSignal
        A second of it.
    limits : WiringLimits
        What is still good.
    motion : bool
        Whether both probes see the shaft move.
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
    """Return whether the sensor can follow the mark at the highest speed planned, rad/s."""
    shorter = min(tacho.mark_fraction, 1.0 - tacho.mark_fraction)
    name, value = "tacho speed limit", f"{speed / RPM:,.0f} r/min planned"
    if tacho.response_time == 0.0:
        return Check.passed(name, value, "none: response_time_s = 0")
    highest = 2.0 * np.pi * shorter / tacho.response_time / tacho.pulses_per_revolution
    limit = f"{highest / RPM:,.0f} r/min"
    mark = f"a mark over {100 * tacho.mark_fraction:.0f} % of the turn and {1e3 * tacho.response_time:g} ms of response"
    if speed > highest:
        advice = (
            f"with {mark} pulses are missed from {limit} on, quietly: paint half of the turn, or use a faster sensor"
        )
        return Check.failed(name, Finding.SPEED, value, limit, advice)
    if speed > WARNING_FRACTION * highest:
        advice = f"with {mark} the sensor misses pulses soon above: watch for a speed that halves"
        return Check.warned(name, Finding.SPEED, value, limit, advice)
    return Check.passed(name, value, limit)


def _one_level_check(signal: TachoSignal, *, motion: bool) -> Check:
    level = float(np.median(signal.volts))
    low, high = _switching(signal.tacho)
    name, value, limit = "tacho levels", f"{level:.2f} V, no pulse", f"below {low:g} and above {high:g} V in turn"
    if motion:
        advice = (
            f"the probes see the shaft turn, the tacho stands at {level:.2f} V: unplugged, without supply, or not "
            "aimed at the mark"
        )
        return Check.failed(name, Finding.SILENT, value, limit, advice)
    if low <= level <= high:
        advice = f"the tacho stands at {level:.2f} V, between its switching levels: unplugged, or levels set wrong"
        return Check.failed(name, Finding.LEVELS, value, limit, advice)
    advice = (
        "nothing turns, so neither the mark nor the direction of the orbit can be judged: turn the shaft by hand and "
        "look again"
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
            advice = f"the tacho uses up the range of {signal.channel.physical}: a larger range_v, or a divider"
            return Check.warned(name, Finding.CLIPPED, value, limit, advice)
        return Check.passed(name, value, limit)
    if -levels.high < low and -levels.low > high:
        advice = (
            f"the tacho switches between {value}: the two wires at {signal.channel.physical} are exchanged, or the "
            "sensor is wired to the wrong pole of its supply"
        )
        return Check.failed(name, Finding.REVERSED, value, limit, advice)
    advice = (
        f"the tacho switches between {value}, the rig reads it at {low:g} and {high:g} V: wrong divider or supply, or "
        f"[tacho] should be {proposal} (rig calibrate tacho)"
    )
    return Check.failed(name, Finding.LEVELS, value, limit, advice)


def _hysteresis_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    least, most = HYSTERESIS_RANGE
    share = signal.tacho.hysteresis / levels.separation
    name, value = "tacho hysteresis", f"{signal.tacho.hysteresis:g} V, {100 * share:.0f} % of the swing"
    limit = f"{100 * least:.0f} to {100 * most:.0f} % of {levels.separation:.2f} V"
    if least <= share <= most:
        return Check.passed(name, value, limit)
    trouble = "noise on a slow edge counts twice" if share < least else "a pulse that is a little weaker is missed"
    advice = f"{trouble}: hysteresis_v = {levels.hysteresis:.2g} would suit the tacho's levels (rig calibrate tacho)"
    return Check.warned(name, Finding.LEVELS, value, limit, advice)


def _noise_check(signal: TachoSignal, levels: SignalLevels) -> Check:
    low, high = _switching(signal.tacho)
    least = MIN_NOISE_MARGIN * levels.scatter
    room = min(low - levels.low, levels.high - high, signal.tacho.hysteresis)
    name, value = "tacho noise", f"{1e3 * levels.scatter:.0f} mV rms"
    limit = f"{1e3 * room / MIN_NOISE_MARGIN:.0f} mV rms"
    if room >= least:
        return Check.passed(name, value, limit)
    advice = (
        f"noise can switch the tacho: threshold_v = {levels.middle:.2g}, hysteresis_v = {levels.hysteresis:.2g} would "
        "suit its levels; look at its shield"
    )
    return Check.warned(name, Finding.NOISE, value, limit, advice)


def _pulses_check(signal: TachoSignal, most: float) -> Check:
    name, limit = "tacho pulses", f"scatter below {100 * most:g} % of the period"
    if signal.edges.size < MIN_EDGES:
        advice = "too few marks passed for a speed: let it turn faster and look again"
        return Check.warned(name, Finding.STILL, f"{signal.edges.size} marks", f"at least {MIN_EDGES}", advice)
    speed, scatter = signal.speed / RPM, signal.scatter
    if np.isnan(scatter):
        return Check.passed(name, f"{speed:,.0f} r/min", limit)
    value = f"{speed:,.0f} r/min, scatter {100 * scatter:.2f} %"
    if scatter <= most:
        return Check.passed(name, value, limit)
    advice = "the marks come unevenly: not as many as pulses_per_revolution, a dirty mark, or the sensor too far off"
    return Check.warned(name, Finding.SCATTER, value, limit, advice)


def _mark_check(signal: TachoSignal, levels: SignalLevels, tolerance: float) -> Check:
    configured, seen = signal.tacho.mark_fraction, levels.high_fraction
    name, value = "tacho mark", f"light for {100 * seen:.0f} % of the time"
    limit = f"{100 * configured:.0f} ± {100 * tolerance:.0f} %"
    whole_turns = signal.edges.size > 1 / tolerance  # else a part of a turn counts too much
    if abs(seen - configured) <= tolerance or not whole_turns:
        return Check.passed(name, value, limit)
    if abs(1.0 - seen - configured) <= tolerance:
        other = Edge.FALLING if signal.tacho.edge is Edge.RISING else Edge.RISING
        advice = (
            f"light and dark are exchanged (NPN for PNP, dark-on for light-on): edge = {other.value!r} may be meant"
        )
        return Check.warned(name, Finding.REVERSED, value, limit, advice)
    advice = (
        "the mark is not as wide as mark_fraction says, or the sensor's sensitivity is off: the speed limit is wrong"
    )
    return Check.warned(name, Finding.DUTY, value, limit, advice)


def _switching(tacho: Tacho) -> tuple[float, float]:
    return tacho.threshold - 0.5 * tacho.hysteresis, tacho.threshold + 0.5 * tacho.hysteresis
