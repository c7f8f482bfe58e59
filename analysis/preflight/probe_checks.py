"""Preflight checks of one probe: connection, gap voltage, clipping, calibrated range and mains hum."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, WiringLimits
from analysis.preflight.switching_levels import MAD_TO_RMS
from analysis.signals.header import CODE_MAX, CODE_MIN, Calibration, Channel
from analysis.signals.units import MICROMETRE
from analysis.spectra.disturbances import LowFrequencySignal

FloatArray = NDArray[np.float64]

MAX_STUCK_NOISE = 0.5  # codes rms: the card alone is noisier
MAX_CARD_NOISE = 1.5  # codes rms: noise of the card alone; a conditioner adds more
MAX_OPEN_VOLTS = 0.3  # V: an open input, pulled to zero by its bias resistor
MIN_OPEN_DURATION = 1e-3  # s: ten times a spark; a cable that moves loses contact for longer
MIN_OPEN_SAMPLES = 8  # of an interval whose noise is compared
MAX_CLIPPED_FRACTION = 1e-3  # of the samples; more is a voltage out of range, not a spark


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
    codes: NDArray[np.int16]
    volts: FloatArray

    @classmethod
    def from_codes(cls, channel: Channel, codes: NDArray[np.int16]) -> "ProbeSignal":
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


def open_intervals(probe: ProbeSignal, rate: float) -> NDArray[np.int64]:
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


def _robust_noise(codes: NDArray[np.int16]) -> float:
    """Return the noise about the median, codes rms; insensitive to the edges of the interval."""
    return MAD_TO_RMS * float(np.median(np.abs(codes - np.median(codes))))


def contact_check(probe: ProbeSignal, intervals: NDArray[np.int64], rate: float) -> Check:
    """Return the failed check of a probe that reads like an open input in some intervals."""
    lengths = intervals[:, 1] - intervals[:, 0]
    value = f"{lengths.size} losses, {100 * lengths.sum() / probe.volts.size:.1f} % of the time"
    longest = 1e3 * lengths.max() / rate  # ms
    advice = (
        f"{probe.name} loses contact for up to {longest:.0f} ms: loose connector or broken wire; check "
        f"its cable and the terminals of {probe.channel.physical}, and read the voltage while you move the cable"
    )
    return Check.failed(f"{probe.name} contact", Finding.INTERMITTENT, value, "no loss", advice)


def gap_check(probe: ProbeSignal) -> Check:
    """Return the check that the probe is connected and its mean voltage within limits."""
    channel, mean = probe.channel, probe.mean
    name = f"{probe.name} gap"
    value, limit = f"{mean:.2f} V", f"{channel.gap_low:g} to {channel.gap_high:g} V"
    at_rails = float(np.mean((probe.codes == CODE_MIN) | (probe.codes == CODE_MAX)))
    if at_rails > MAX_CLIPPED_FRACTION:
        advice = (
            f"{probe.name} reads {mean:.2f} V, for {100 * at_rails:.0f} % of the time at the end of the range of "
            f"{channel.physical}: gap too wide, or range_v too small for the conditioner"
        )
        return Check.failed(name, Finding.CLIPPED, value, limit, advice)
    noise = float(np.std(probe.codes))
    if noise < MAX_CARD_NOISE and abs(mean) < MAX_OPEN_VOLTS:
        advice = (
            f"{probe.name} reads {mean:.2f} V without sensor noise: unplugged, or its conditioner has no supply; check "
            f"the cable to {channel.physical}"
        )
        return Check.failed(name, Finding.OPEN, value, limit, advice)
    if noise < MAX_STUCK_NOISE:
        advice = f"{probe.name} reads a constant {mean:.2f} V without noise: stuck, or not connected"
        return Check.failed(name, Finding.OPEN, value, limit, advice)
    if channel.gap_low <= mean <= channel.gap_high:
        return Check.passed(name, value, limit)
    if channel.gap_low <= -mean <= channel.gap_high:
        advice = f"{probe.name} reads {mean:.2f} V: the two wires at {channel.physical} are exchanged"
        return Check.failed(name, Finding.REVERSED, value, limit, advice)
    if mean < channel.gap_low:
        advice = f"{probe.name} reads {mean:.2f} V: gap closed, the tip touches or almost touches: retract the probe"
        return Check.failed(name, Finding.GAP_CLOSED, value, limit, advice)
    advice = f"{probe.name} reads {mean:.2f} V: gap too wide, the shaft is almost out of range: move the probe closer"
    return Check.failed(name, Finding.GAP_WIDE, value, limit, advice)


def clipping_check(probe: ProbeSignal) -> Check:
    """Return the check that no sample reached the limits of the card's range."""
    rails = int(np.count_nonzero((probe.codes == CODE_MIN) | (probe.codes == CODE_MAX)))
    name, value, limit = f"{probe.name} clipping", f"{rails:,} samples", "none"
    if rails == 0:
        return Check.passed(name, value, limit)
    advice = f"{probe.name} occasionally reaches the limit of the card's range: wrong gap, or a loose contact"
    return Check.warned(name, Finding.CLIPPED, value, limit, advice)


def calibrated_check(probe: ProbeSignal) -> Check:
    """Return the check that all samples lie in the calibrated range."""
    calibration = _calibration(probe.channel)
    low, high = calibration.volts_low, calibration.volts_high
    beyond = int(np.count_nonzero((probe.volts < low) | (probe.volts > high)))
    name, limit = f"{probe.name} calibrated span", f"{low:g} to {high:g} V"
    value = f"{probe.volts.min():.2f} to {probe.volts.max():.2f} V"
    if beyond == 0:
        return Check.passed(name, value, limit)
    part = 100 * beyond / probe.volts.size
    advice = f"{part:.1f} % of the samples of {probe.name} lie outside the calibrated range and are extrapolated"
    return Check.warned(name, Finding.BEYOND_CALIBRATION, value, limit, advice)


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
    name = f"{probe.name} mains hum"
    limit = f"{limits.hum_warn / MICROMETRE:g} µm peak at 50 or 60 Hz"
    line = slow.mains_line()
    value = f"{line.amplitude / MICROMETRE:.2f} µm at {line.frequency:.0f} Hz"
    if line.amplitude <= limits.hum_warn:
        return Check.passed(name, value, limit)
    if not line.is_separable:
        advice = (
            "the shaft turns at the mains frequency or a fraction of it: repeat the check at rest or at another speed"
        )
        return Check.warned(name, Finding.INCONCLUSIVE, value, limit, advice)
    if line.frequency < turning:
        advice = (
            f"{probe.name} shows mains hum, or the shaft whirls at that frequency: repeat the check at rest, then "
            "check the shields"
        )
        return Check.warned(name, Finding.HUM, value, limit, advice)
    advice = (
        f"{probe.name} shows mains hum: earth its shield at one end only, look for a ground loop through the "
        "conditioner's supply, keep the cable away from the inverter's"
    )
    make = Check.failed if line.amplitude > limits.hum_fail else Check.warned
    return make(name, Finding.HUM, value, limit, advice)


def _calibration(channel: Channel) -> Calibration:
    if channel.calibration is None:
        raise ValueError(f"channel {channel.name!r} has no calibration: it is not a probe")
    return channel.calibration
