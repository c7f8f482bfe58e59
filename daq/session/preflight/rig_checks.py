"""What is known of a rig before its samples are looked at: card, calibrations, disk, as checks of a preflight."""

import datetime as dt
from collections.abc import Iterator, Sequence

import numpy as np

from analysis.preflight.checks import Check, Finding
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition, Calibration
from daq.config.rig import MICRO, RPM, Rig
from daq.config.schema import Backend
from daq.errors import DeviceError, DeviceFault

RATE_TOLERANCE = 1e-3  # relative, between the rate that was asked for and the card's: more is a wrong frequency axis
BYTES = 2  # of a sample
_FINDINGS = {
    DeviceFault.MISSING: Finding.MISSING,
    DeviceFault.TIMEOUT: Finding.MISSING,
    DeviceFault.BUSY: Finding.BUSY,
    DeviceFault.DRIVER: Finding.DRIVER,
}


def device_checks(rig: Rig, acquisition: Acquisition) -> Iterator[Check]:
    """Yield what is to be said of the card that was opened."""
    section, device = rig.config.device, acquisition.device
    value = f"{device.product}" + (f", serial number {device.serial}" if device.serial else "")
    if device.simulated:
        simulator = "the rig file" if section.backend is Backend.SIMULATED else "the NI driver (NI MAX)"
        advice = f'{simulator} simulates the card: nothing is measured; backend = "nidaqmx" and a real card measure'
        yield Check.warned("device", Finding.SIMULATED, f"{value}, simulated", section.product, advice)
    else:
        yield Check.passed("device", value, section.product)
    if section.backend is Backend.NIDAQMX:
        if section.serial:
            yield Check.passed("device serial", device.serial, section.serial)
        else:
            advice = (
                f"the card is known only as {section.name}, a name that moves with the USB port: enter "
                f'serial = "{device.serial}" in [device]'
            )
            yield Check.warned("device serial", Finding.SERIAL, device.serial, "a serial number in [device]", advice)
    asked, got = rig.config.timing.rate_hz, acquisition.rate
    value, limit = f"{got:,.1f} Hz a channel", f"{asked:,.0f} Hz ± {100 * RATE_TOLERANCE:g} %"
    if abs(got - asked) <= RATE_TOLERANCE * asked:
        yield Check.passed("sample rate", value, limit)
    else:
        advice = f"the card's clock divides by whole numbers only: rate_hz = {got:.6g} says what it does"
        yield Check.warned("sample rate", Finding.RATE, value, limit, advice)


def device_error_check(rig: Rig, error: DeviceError, *, in_self_test: bool) -> Check:
    """Return what is to be said of a card that gives no samples, or fails its own test."""
    section = rig.config.device
    finding = _FINDINGS.get(error.fault)
    if finding is None and in_self_test:
        return Check.failed("self-test", Finding.SELF_TEST, "failed", "the card's own test", str(error))
    finding = finding or Finding.REFUSED
    which = f"serial number {section.serial}" if section.serial else section.name
    return Check.failed("device", finding, finding.value, f"{section.product}, {which}", str(error))


def self_calibration_checks(rig: Rig, calibrated: dt.date | None, today: dt.date) -> Iterator[Check]:
    """Yield how long ago the card calibrated itself, where it tells."""
    if calibrated is None:
        return
    age, oldest = (today - calibrated).days, rig.config.preflight.self_calibration_days
    name, value, limit = "card self-calibration", f"{calibrated}, {age} days old", f"{oldest} days"
    if age <= oldest:
        yield Check.passed(name, value, limit)
    else:
        advice = "let the card calibrate itself in NI MAX when it has been on for 15 min: its scaling drifts"
        yield Check.warned(name, Finding.CALIBRATION, value, limit, advice)


def sample_checks(blocks: Sequence[SampleBlock], end: SegmentEnd | None, wanted: int, rig: Rig) -> Iterator[Check]:
    """Yield whether the samples came whole, in time and without a remark of the driver's.

    Parameters
    ----------
    blocks : sequence of SampleBlock
        As they came.
    end : SegmentEnd or None
        Of their segment; None where the source gave none.
    wanted : int
        Samples per channel that were waited for.
    rig : Rig
        The rig.
    """
    count, in_order = 0, True
    for block in blocks:
        in_order = in_order and block.first_sample == count and block.segment == 0
        count = block.end
    value, limit = f"{count:,} samples a channel", f"{wanted:,}, each of them"
    name = "samples"
    if end is not None and in_order and end.is_gap_free and end.samples == count and count >= wanted:
        yield Check.passed(name, value, limit)
    else:
        told = "" if end is None else f": {end.reason.value}" + (f", {end.detail}" if end.detail else "")
        advice = f"the card did not deliver a whole second{told}; give it a USB port of its own, without a hub"
        yield Check.failed(name, Finding.COUNT, value, limit, advice)
    if end is not None and end.is_gap_free and end.detail:
        yield Check.warned("driver", Finding.DRIVER_WARNING, "remarks", "none", end.detail)
    backlog = max((block.backlog for block in blocks), default=0) / rig.config.timing.rate_hz
    limit_s = rig.config.timing.buffer_s / 4
    value, limit = f"{backlog:.2f} s", f"{limit_s:.2g} s, a quarter of buffer_s"
    if backlog <= limit_s:
        yield Check.passed("backlog", value, limit)
    else:
        advice = "this computer does not keep up: close other programs, lower rate_hz, or raise buffer_s"
        yield Check.warned("backlog", Finding.BACKLOG, value, limit, advice)


def calibration_checks(rig: Rig, today: dt.date) -> Iterator[Check]:
    """Yield what is to be said of the calibrations that the rig names."""
    for name, calibration in rig.calibrations.items():
        yield _age_check(name, calibration, today, rig.config.preflight.calibration_days)
        yield _residual_check(name, calibration, rig.config.preflight.residual_fraction)
    yield _serials_check(rig)


def disk_check(free: int, rig: Rig, rate: float, duration: float | None) -> Check:
    """Return whether the planned run fits on the disk.

    Parameters
    ----------
    free : int
        Bytes that are free where runs go.
    rig : Rig
        The rig.
    rate : float
        Samples per channel and second, Hz.
    duration : float or None
        Of the planned run, s; None where none is planned.
    """
    room = free - rig.config.storage.reserve_gb * 1e9
    lasts = max(room, 0.0) / disk_rate(rig, rate)
    needed = 3600.0 * rig.config.preflight.disk_duration_h if duration is None else duration
    value, limit = _span(lasts), _span(needed)
    if lasts >= needed:
        return Check.passed("disk", value, limit)
    advice = "make room, or record elsewhere (storage.folder, RIG_DATA)"
    if duration is None and lasts > 0.0:
        return Check.warned("disk", Finding.DISK, value, limit, advice)
    return Check.failed("disk", Finding.DISK, value, limit, f"the run would be ended by a full disk: {advice}")


def _span(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:,.0f} h"


def disk_rate(rig: Rig, rate: float) -> float:
    """Return the bytes a second that a run takes at most, before they are packed."""
    return rate * len(rig.config.channel) * BYTES


def planned_speed_check(rig: Rig, speed: float) -> Check:
    """Return whether a planned speed, rad/s, is one that the rig is made for."""
    highest = rig.limits.speed
    value, limit = f"{speed / RPM:,.0f} r/min", f"{highest / RPM:,.0f} r/min"
    if speed <= highest * (1.0 + 1e-9):
        return Check.passed("planned speed", value, limit)
    advice = "the run is planned above limits.speed_rpm, the highest speed of the rig: plan a lower one"
    return Check.failed("planned speed", Finding.SPEED, value, limit, advice)


def _age_check(name: str, calibration: Calibration, today: dt.date, oldest: int) -> Check:
    age = (today - dt.date.fromisoformat(calibration.date)).days
    label, limit = f"probe {name} calibration", f"{oldest} days"
    value = f"{calibration.date}, {age} days old"
    if age < 0:
        advice = "the calibration is from the future: the computer's date or the record's is wrong"
        return Check.warned(label, Finding.CALIBRATION, f"{calibration.date}, today is {today}", limit, advice)
    if age <= oldest:
        return Check.passed(label, value, limit)
    advice = f"calibrate the probe anew: rig calibrate gap RIG.TOML {name}"
    return Check.warned(label, Finding.CALIBRATION, value, limit, advice)


def _residual_check(name: str, calibration: Calibration, fraction: float) -> Check:
    ends = np.array([calibration.volts_low, calibration.volts_high])
    low, high = np.polynomial.polynomial.polyval(ends, calibration.coefficients)
    allowed = fraction * float(high - low)
    label = f"probe {name} fit"
    value, limit = (
        f"{calibration.residual / MICRO:.2f} µm off at most",
        f"{allowed / MICRO:.1f} µm, {100 * fraction:g} % of the span",
    )
    if 0.0 < calibration.residual <= allowed:
        return Check.passed(label, value, limit)
    if calibration.residual == 0.0:
        advice = "the record does not say how well its polynomial fits: keep the points in it (rig calibrate gap)"
        return Check.warned(label, Finding.CALIBRATION, "unknown", limit, advice)
    advice = "the polynomial does not follow the points: a higher order, or measure the points again"
    return Check.warned(label, Finding.CALIBRATION, value, limit, advice)


def _serials_check(rig: Rig) -> Check:
    label, limit = "probe serials", "sensor and conditioner of each, no two alike"
    serials = {name: (c.sensor, c.conditioner) for name, c in rig.calibrations.items()}
    value = "; ".join(f"{name}: {' + '.join(filter(None, pair)) or 'none'}" for name, pair in serials.items())
    advice = ""
    if not all(all(pair) for pair in serials.values()):
        advice = "a record without serial numbers may belong to any sensor: enter them"
    else:
        sensors, conditioners = ({pair[number] for pair in serials.values()} for number in (0, 1))
        if min(len(sensors), len(conditioners)) < len(serials):
            advice = "two probes cannot share a sensor or a conditioner: one of the records is the wrong file"
    if advice:
        return Check.warned(label, Finding.CALIBRATION, value, limit, advice)
    return Check.passed(label, value, limit)
