"""Wiring checks of probes and tacho against the configuration, from about a second of samples.

Per probe: connection, gap voltage, clipping, calibrated range and mains hum; then exchanged and bridged inputs.
"""

from dataclasses import dataclass

import numpy as np

from analysis.preflight.calibration import find_state_levels
from analysis.preflight.check_result import Check, Finding, Verdict, WiringLimits
from analysis.preflight.tacho_checks import TachoSignal, tacho_checks
from analysis.signals import CodeArray, FloatArray, IntArray
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Calibration, Channel, Role
from analysis.signals.probes import ProbePair
from analysis.signals.uncertainty import MAD_TO_SIGMA
from analysis.signals.units import MICROMETRE
from analysis.spectra.disturbances import LowFrequencySignal

MAX_STUCK_NOISE = 0.5  # codes rms: the card alone is noisier
MAX_CARD_NOISE = 1.5  # codes rms: noise of the card alone; a conditioner adds more
MAX_OPEN_VOLTS = 0.3  # V: an open input, pulled to zero by its bias resistor
MIN_OPEN_DURATION = 1e-3  # s: ten times a spark; a cable that moves loses contact for longer
MIN_OPEN_SAMPLES = 8  # of an interval whose noise is compared
MAX_CLIPPED_FRACTION = 1e-3  # of the samples; more is a voltage out of range, not a spark
MAX_CORRELATION = 0.999  # of two separate signals, unless their means differ
MAX_EQUAL_MEAN = 0.01  # V: a straight-line orbit is possible, but not two equal gaps
MAX_NOISE_CORRELATION = 0.6  # of the noise of two conditioners, which is independent
MIN_MOTION = 0.5 * MICROMETRE  # m rms, of both probes between 2 and 1000 Hz, of a turning shaft
MAX_OPEN_FRACTION = 0.4  # of the time that a cable with intermittent contact is open; more is an open input
MIN_PULSE_CORRELATION = 0.9  # with the tacho, of the same pulses on another input
MAX_PULSE_SCATTER = 0.2  # relative, of the intervals between pulses of a turning shaft
MAX_BACKWARD_RATIO = 3.0  # of the backward to the forward 1X circle of a light rotor on oil films
MIN_CIRCLE = 0.05 * MICROMETRE  # m peak, of a circle whose direction is checked
ROLES = (Role.PROBE_X, Role.PROBE_Y)


@dataclass(frozen=True, slots=True, eq=False)
class ProbeSignal:
    """A stretch of one probe's samples.

    Parameters
    ----------
    channel : Channel
        Channel of the probe, with its calibration.
    codes : ndarray of int16, shape (n,)
        Consecutive samples.
    volts : ndarray of float64, shape (n,)
        The same samples, V.
    """

    channel: Channel
    codes: CodeArray
    volts: FloatArray

    @classmethod
    def from_codes(cls, channel: Channel, codes: CodeArray) -> "ProbeSignal":
        """Return the signal of a probe channel; ValueError without calibration or samples."""
        if channel.calibration is None or codes.ndim != 1 or codes.size == 0:
            raise ValueError(f"channel {channel.name!r}: codes {codes.shape}, expected a probe's samples, (n,)")
        return cls(channel, codes, channel.volts(codes))

    @property
    def name(self) -> str:
        """Name of the probe in checks."""
        return f"probe {self.channel.name}"

    @property
    def mean(self) -> float:
        """Mean voltage, V."""
        return float(np.mean(self.volts))

    @property
    def sensitivity(self) -> float:
        """Displacement per voltage at the mean voltage, m/V, limited to the calibrated range."""
        calibration = _calibration(self.channel)
        at = min(max(self.mean, calibration.volts_low), calibration.volts_high)
        slope = np.polynomial.polynomial.polyder(np.array(calibration.coefficients))
        return float(np.polynomial.polynomial.polyval(at, slope))

    @property
    def displacement(self) -> FloatArray:
        """Motion about the mean, m, with the sensitivity at the mean; positive away from the probe."""
        return self.sensitivity * (self.volts - self.mean)


def open_intervals(probe: ProbeSignal, rate: float) -> IntArray:
    """Return the intervals in which a probe reads like an open input: near zero, without sensor noise.

    Parameters
    ----------
    probe : ProbeSignal
        The probe.
    rate : float
        Sample rate, Hz.

    Returns
    -------
    ndarray of int64, shape (n_intervals, 2)
        First sample and one past the last; none if the allowed mean voltage of the probe includes zero.
    """
    allowed = max(probe.channel.gap_low, -probe.channel.gap_high)  # nearest to zero
    near_zero = np.abs(probe.volts) < min(MAX_OPEN_VOLTS, allowed)
    ends = np.flatnonzero(np.diff(near_zero.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    long_enough = ends[ends[:, 1] - ends[:, 0] >= max(MIN_OPEN_DURATION * rate, MIN_OPEN_SAMPLES)]
    return np.array(
        [(start, stop) for start, stop in long_enough if _robust_noise(probe.codes[start:stop]) < MAX_CARD_NOISE],
        dtype=np.int64,
    ).reshape(-1, 2)


def _robust_noise(codes: CodeArray) -> float:
    """Return the noise about the median, codes rms; insensitive to the edges of the interval."""
    return MAD_TO_SIGMA * float(np.median(np.abs(codes - np.median(codes))))


def contact_check(probe: ProbeSignal, intervals: IntArray, rate: float) -> Check:
    """Return the failed check of a probe that reads like an open input in some intervals."""
    lengths = intervals[:, 1] - intervals[:, 0]
    value = f"{lengths.size} losses, {100 * lengths.sum() / probe.volts.size:.1f} % of the time"
    longest = 1e3 * lengths.max() / rate  # ms
    return Check(f"{probe.name} contact", value, "no loss").fail(
        Finding.INTERMITTENT,
        f"{probe.name} loses contact for up to {longest:.0f} ms: loose connector or broken wire; check "
        f"its cable and the terminals of {probe.channel.physical}, and read the voltage while you move the cable",
    )


def gap_check(probe: ProbeSignal) -> Check:
    """Return the check that the probe is connected and its mean voltage within limits."""
    channel, mean = probe.channel, probe.mean
    check = Check(f"{probe.name} gap", f"{mean:.2f} V", f"{channel.gap_low:g} to {channel.gap_high:g} V")
    at_rails = float(np.mean((probe.codes == CODE_MIN) | (probe.codes == CODE_MAX)))
    if at_rails > MAX_CLIPPED_FRACTION:
        return check.fail(
            Finding.CLIPPED,
            f"{probe.name} reads {mean:.2f} V, for {100 * at_rails:.0f} % of the time at the end of the range of "
            f"{channel.physical}: gap too wide, or range_v too small for the conditioner",
        )
    noise = float(np.std(probe.codes))
    if noise < MAX_CARD_NOISE and abs(mean) < MAX_OPEN_VOLTS:
        return check.fail(
            Finding.OPEN,
            f"{probe.name} reads {mean:.2f} V without sensor noise: unplugged, or its conditioner has no supply; check "
            f"the cable to {channel.physical}",
        )
    if noise < MAX_STUCK_NOISE:
        return check.fail(
            Finding.OPEN, f"{probe.name} reads a constant {mean:.2f} V without noise: stuck, or not connected"
        )
    if channel.gap_low <= mean <= channel.gap_high:
        return check
    if channel.gap_low <= -mean <= channel.gap_high:
        return check.fail(
            Finding.REVERSED, f"{probe.name} reads {mean:.2f} V: the two wires at {channel.physical} are exchanged"
        )
    if mean < channel.gap_low:
        return check.fail(
            Finding.GAP_CLOSED,
            f"{probe.name} reads {mean:.2f} V: gap closed, the tip touches or almost touches: retract the probe",
        )
    return check.fail(
        Finding.GAP_WIDE,
        f"{probe.name} reads {mean:.2f} V: gap too wide, the shaft is almost out of range: move the probe closer",
    )


def clipping_check(probe: ProbeSignal) -> Check:
    """Return the check that no sample reached the limits of the card's range."""
    rails = int(np.count_nonzero((probe.codes == CODE_MIN) | (probe.codes == CODE_MAX)))
    check = Check(f"{probe.name} clipping", f"{rails:,} samples", "none")
    if rails == 0:
        return check
    return check.warn(
        Finding.CLIPPED,
        f"{probe.name} occasionally reaches the limit of the card's range: wrong gap, or a loose contact",
    )


def calibrated_check(probe: ProbeSignal) -> Check:
    """Return the check that all samples lie in the calibrated range."""
    calibration = _calibration(probe.channel)
    low, high = calibration.volts_low, calibration.volts_high
    beyond = int(np.count_nonzero((probe.volts < low) | (probe.volts > high)))
    value = f"{probe.volts.min():.2f} to {probe.volts.max():.2f} V"
    check = Check(f"{probe.name} calibrated span", value, f"{low:g} to {high:g} V")
    if beyond == 0:
        return check
    part = 100 * beyond / probe.volts.size
    return check.warn(
        Finding.BEYOND_CALIBRATION,
        f"{part:.1f} % of the samples of {probe.name} lie outside the calibrated range and are extrapolated",
    )


def hum_check(probe: ProbeSignal, slow: LowFrequencySignal, turning: float, limits: WiringLimits) -> Check:
    """Return the check of mains hum.

    Parameters
    ----------
    probe : ProbeSignal
        The probe.
    slow : LowFrequencySignal
        Its displacement, m.
    turning : float
        Rotational frequency of the shaft, Hz; whirl may lie anywhere below it. 0 at rest, infinite where unknown.
    limits : WiringLimits
        Amplitudes for a warning and a failure.
    """
    limit = f"{limits.hum_warn / MICROMETRE:g} µm peak at 50 or 60 Hz"
    line = slow.mains_line()
    value = f"{line.amplitude / MICROMETRE:.2f} µm at {line.frequency:.0f} Hz"
    check = Check(f"{probe.name} mains hum", value, limit)
    if line.amplitude <= limits.hum_warn:
        return check
    if not line.is_separable:
        return check.warn(
            Finding.INCONCLUSIVE,
            "the shaft turns at the mains frequency or a fraction of it: repeat the check at rest or at another speed",
        )
    if line.frequency < turning:
        return check.warn(
            Finding.HUM,
            f"{probe.name} shows mains hum, or the shaft whirls at that frequency: repeat the check at rest, then "
            "check the shields",
        )
    judge = check.fail if line.amplitude > limits.hum_fail else check.warn
    return judge(
        Finding.HUM,
        f"{probe.name} shows mains hum: earth its shield at one end only, look for a ground loop through the "
        "conditioner's supply, keep the cable away from the inverter's",
    )


def _calibration(channel: Channel) -> Calibration:
    if channel.calibration is None:
        raise ValueError(f"channel {channel.name!r} has no calibration: it is not a probe")
    return channel.calibration


def wiring_checks(acquisition: Acquisition, codes: CodeArray, limits: WiringLimits | None = None) -> tuple[Check, ...]:
    """Return the checks of the wiring of probes and tacho.

    Each fault is reported once: an unplugged probe gets no further checks.

    Parameters
    ----------
    acquisition : Acquisition
        Channels, rates, calibrations and tacho.
    codes : ndarray of int16, shape (n_channels, n)
        About a second of consecutive samples, with the shaft at rest or turning.
    limits : WiringLimits or None
        Limits of the checks; None for the defaults.

    Raises
    ------
    ValueError
        The samples do not match the acquisition.
    """
    if codes.ndim != 2 or codes.shape[0] != len(acquisition.channels) or codes.shape[1] == 0:
        raise ValueError(f"codes: shape {codes.shape}, expected ({len(acquisition.channels)}, n) with n > 0")
    limits = limits or WiringLimits()
    rows = {role: acquisition.row(role) for role in Role}
    probes = [ProbeSignal.from_codes(acquisition.channels[rows[role]], codes[rows[role]]) for role in ROLES]
    channel, tacho_codes = acquisition.channels[rows[Role.TACHO]], codes[rows[Role.TACHO]]
    tacho = TachoSignal.from_codes(channel, acquisition.tacho, tacho_codes, acquisition.rate)
    losses = [(probe, open_intervals(probe, acquisition.rate)) for probe in probes]
    losses = [(probe, intervals) for probe, intervals in losses if _is_intermittent(probe, intervals, tacho)]
    intermittent = [probe for probe, _ in losses]
    pulsing = [probe for probe in probes if probe not in intermittent and _is_switching(probe, tacho)]
    checks = [contact_check(probe, intervals, acquisition.rate) for probe, intervals in losses]
    checks += [_pulsing_check(probe, tacho) for probe in pulsing]
    is_exchanged = bool(pulsing) and tacho.levels is None  # then the tacho input has the voltage of a probe
    angle = None if is_exchanged else tacho.angle
    rest = [probe for probe in probes if probe not in intermittent + pulsing]
    gaps = [gap_check(probe) for probe in rest]
    sound = [probe for probe, gap in zip(rest, gaps, strict=True) if gap.verdict is Verdict.GOOD]
    slow = [LowFrequencySignal(probe.displacement, acquisition.rate, angle) for probe in sound]
    checks += gaps
    motion = bool(slow) and all(signal.motion_rms() > MIN_MOTION for signal in slow)
    without_tacho = np.inf if motion else 0.0
    turning = without_tacho if angle is None else tacho.speed / (2.0 * np.pi)
    for probe, signal in zip(sound, slow, strict=True):
        checks += [clipping_check(probe), calibrated_check(probe), hum_check(probe, signal, turning, limits)]
    if len(sound) == len(ROLES):
        checks.append(_separate_signals_check(*sound))
        if angle is not None and checks[-1].verdict is Verdict.GOOD:
            checks.append(_direction_check(sound, slow))
    if not is_exchanged:
        checks += tacho_checks(tacho, limits, motion=motion)
    return tuple(checks)


def _is_intermittent(probe: ProbeSignal, intervals: IntArray, tacho: TachoSignal) -> bool:
    """Return whether a probe is open in some intervals only, which are not the dark part of the tacho's pulses."""
    n_open = int(np.sum(intervals[:, 1] - intervals[:, 0]))
    if not 0 < n_open <= MAX_OPEN_FRACTION * probe.volts.size:
        return False
    if tacho.levels is not None:
        return _correlation(probe.volts, tacho.volts) < MIN_PULSE_CORRELATION
    periods = np.diff(intervals[:, 0])
    return periods.size < 2 or float(np.std(periods)) > MAX_PULSE_SCATTER * float(np.mean(periods))


def _is_switching(probe: ProbeSignal, tacho: TachoSignal) -> bool:
    """Return whether the input of a probe has the voltage of a switching sensor."""
    levels = find_state_levels(probe.volts)
    return levels is not None and levels.separation > tacho.tacho.hysteresis


def _pulsing_check(probe: ProbeSignal, tacho: TachoSignal) -> Check:
    levels = find_state_levels(probe.volts)
    seen = "pulses" if levels is None else f"pulses, {levels.low:.2f} and {levels.high:.2f} V"
    own, other = probe.channel.physical, tacho.channel.physical
    if tacho.levels is None:
        return Check(f"{probe.name} signal", seen, "a probe's voltage").fail(
            Finding.TACHO_EXCHANGED,
            f"{probe.name} has the tacho pulses, the tacho has none: the wires at {own} and {other} are exchanged",
        )
    return Check(f"{probe.name} signal", seen, "a probe's voltage").fail(
        Finding.BRIDGED,
        f"{probe.name} and the tacho both have pulses: {own} and {other} touch, or one wire goes to both",
    )


def _separate_signals_check(first: ProbeSignal, second: ProbeSignal) -> Check:
    whole = _correlation(first.volts, second.volts)
    noise = _correlation(np.diff(first.volts, 2), np.diff(second.volts, 2))
    check = Check(
        f"probes {first.channel.name} and {second.channel.name} apart",
        f"correlation {whole:.3f}, noise {noise:.2f}",
        f"below {MAX_CORRELATION:g}, noise {MAX_NOISE_CORRELATION:g}",
    )
    differ = whole < MAX_CORRELATION or abs(first.mean - second.mean) > MAX_EQUAL_MEAN
    if differ and noise < MAX_NOISE_CORRELATION:
        return check
    return check.fail(
        Finding.BRIDGED,
        f"{first.name} and {second.name} have the same signal: {first.channel.physical} and "
        f"{second.channel.physical} touch, one wire goes to both, or one is open and reads the charge of the other",
    )


def _correlation(first: FloatArray, second: FloatArray) -> float:
    """Return the correlation of two signals; 0 where one is constant."""
    first, second = first - np.mean(first), second - np.mean(second)
    power = float(np.sum(first**2) * np.sum(second**2))
    return float(np.sum(first * second)) / np.sqrt(power) if power > 0.0 else 0.0


def _direction_check(probes: list[ProbeSignal], slow: list[LowFrequencySignal]) -> Check:
    """Return the check that 1X precesses forward, as run-out and unbalance do."""
    first, second = (probe.channel for probe in probes)
    pair = ProbePair(first.angle, second.angle)
    ellipse = pair.ellipse(np.array([signal.vectors[0] for signal in slow]))
    forward, backward = abs(ellipse.forward), abs(ellipse.backward)
    value = f"forward {forward / MICROMETRE:.2f}, backward {backward / MICROMETRE:.2f} µm peak"
    check = Check("1X direction", value, "forward")
    if backward < MAX_BACKWARD_RATIO * forward or backward < MIN_CIRCLE:
        return check
    return check.fail(
        Finding.PROBES_EXCHANGED,
        f"the orbit precesses backward: probes {first.name} and {second.name} are exchanged (cables at "
        f"{first.physical} and {second.physical}), or their angle_deg is wrong",
    )
