"""Wiring checks of probes and tacho against the configuration, from about a second of samples."""

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, Verdict, WiringLimits
from analysis.preflight.probe_checks import (
    ProbeSignal,
    calibrated_check,
    clipping_check,
    contact_check,
    gap_check,
    hum_check,
    open_intervals,
)
from analysis.preflight.switching_levels import find_state_levels
from analysis.preflight.tacho_checks import TachoSignal, tacho_checks
from analysis.signals.header import Acquisition, Channel, Role
from analysis.signals.units import MICROMETRE
from analysis.spectra.disturbances import LowFrequencySignal

FloatArray = NDArray[np.float64]

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


def wiring_checks(
    acquisition: Acquisition, codes: NDArray[np.int16], limits: WiringLimits | None = None
) -> tuple[Check, ...]:
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


def _is_intermittent(probe: ProbeSignal, intervals: NDArray[np.int64], tacho: TachoSignal) -> bool:
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
        advice = f"{probe.name} has the tacho pulses, the tacho has none: the wires at {own} and {other} are exchanged"
        return Check.failed(f"{probe.name} signal", Finding.TACHO_EXCHANGED, seen, "a probe's voltage", advice)
    advice = f"{probe.name} and the tacho both have pulses: {own} and {other} touch, or one wire goes to both"
    return Check.failed(f"{probe.name} signal", Finding.BRIDGED, seen, "a probe's voltage", advice)


def _separate_signals_check(first: ProbeSignal, second: ProbeSignal) -> Check:
    whole, noise = (
        _correlation(first.volts, second.volts),
        _correlation(np.diff(first.volts, 2), np.diff(second.volts, 2)),
    )
    name = f"probes {first.channel.name} and {second.channel.name} apart"
    value, limit = (
        f"correlation {whole:.3f}, noise {noise:.2f}",
        f"below {MAX_CORRELATION:g}, noise {MAX_NOISE_CORRELATION:g}",
    )
    differ = whole < MAX_CORRELATION or abs(first.mean - second.mean) > MAX_EQUAL_MEAN
    if differ and noise < MAX_NOISE_CORRELATION:
        return Check.passed(name, value, limit)
    advice = (
        f"{first.name} and {second.name} have the same signal: {first.channel.physical} and "
        f"{second.channel.physical} touch, one wire goes to both, or one is open and reads the charge of the other"
    )
    return Check.failed(name, Finding.BRIDGED, value, limit, advice)


def _correlation(first: FloatArray, second: FloatArray) -> float:
    """Return the correlation of two signals; 0 where one is constant."""
    first, second = first - np.mean(first), second - np.mean(second)
    power = float(np.sum(first**2) * np.sum(second**2))
    return float(np.sum(first * second)) / np.sqrt(power) if power > 0.0 else 0.0


def _direction_check(probes: list[ProbeSignal], slow: list[LowFrequencySignal]) -> Check:
    """Return the check that 1X precesses forward, as run-out and unbalance do."""
    forward, backward = _circles([probe.channel for probe in probes], [signal.vectors[0] for signal in slow])
    name, limit = "1X direction", "forward"
    value = f"forward {forward / MICROMETRE:.2f}, backward {backward / MICROMETRE:.2f} µm peak"
    if backward < MAX_BACKWARD_RATIO * forward or backward < MIN_CIRCLE:
        return Check.passed(name, value, limit)
    first, second = (probe.channel for probe in probes)
    advice = (
        f"the orbit precesses backward: probes {first.name} and {second.name} are exchanged (cables at "
        f"{first.physical} and {second.physical}), or their angle_deg is wrong"
    )
    return Check.failed(name, Finding.PROBES_EXCHANGED, value, limit, advice)


def _circles(channels: list[Channel], vectors: list[complex]) -> tuple[float, float]:
    """Return the amplitudes of the forward and the backward circle of an ellipse, m peak."""
    seats = np.array([channel.angle for channel in channels])
    # X_k = F exp(-i a_k) + conj(B) exp(i a_k) for the probe at a_k
    parts = np.linalg.solve(np.stack([np.exp(-1j * seats), np.exp(1j * seats)], axis=1), np.array(vectors))
    return float(np.abs(parts[0])), float(np.abs(parts[1]))
