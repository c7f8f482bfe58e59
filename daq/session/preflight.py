"""Preflight checks: a short capture of samples, and the card, calibrations, disk and planned speed, each judged."""

import datetime as dt
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Finding, Verdict, worst_verdict
from analysis.preflight.tacho_checks import counter_check, speed_limit_check
from analysis.preflight.wiring import wiring_checks
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition, Calibration
from analysis.signals.units import MICROMETRE, RPM
from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers.factory import open_source
from daq.drivers.ni import self_test
from daq.errors import DeviceError, DeviceFault
from recordings.file_operations import free_bytes

RATE_TOLERANCE = 1e-3  # relative, between the configured rate and the card's: more makes the frequency axis wrong
BYTES_PER_SAMPLE = 2
_FINDINGS = {
    DeviceFault.MISSING: Finding.MISSING,
    DeviceFault.TIMEOUT: Finding.MISSING,
    DeviceFault.BUSY: Finding.BUSY,
    DeviceFault.DRIVER: Finding.DRIVER,
}
CAPTURE_DURATION = 1.0  # s of samples

OnProgress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """The first segment of an acquisition, captured for checks.

    Parameters
    ----------
    acquisition : Acquisition
        Read back from the opened device.
    blocks : tuple of SampleBlock
        Blocks of the segment, in order of arrival.
    end : SegmentEnd or None
        End of the segment; None where the source ended without one.
    """

    acquisition: Acquisition
    blocks: tuple[SampleBlock, ...]
    end: SegmentEnd | None

    @property
    def codes(self) -> NDArray[np.int16]:
        """All samples, shape (n_channels, n); empty where none arrived."""
        if not self.blocks:
            return np.empty((0, 0), dtype=np.int16)
        return np.concatenate([block.codes for block in self.blocks], axis=1)

    @property
    def ticks(self) -> NDArray[np.int64] | None:
        """Counter timestamps of the tacho's edges; None where a block has none."""
        stamped = [block.ticks for block in self.blocks if block.ticks is not None]
        return np.concatenate(stamped) if stamped and len(stamped) == len(self.blocks) else None


def capture(rig: Rig, duration: float, on_progress: OnProgress = lambda _step: None) -> Capture:
    """Return at least `duration` s of a rig's samples; DeviceError where the device cannot be opened."""
    blocks: list[SampleBlock] = []
    end = None
    on_progress("opening the device")
    with closing(open_source(rig)) as source:
        on_progress(f"capturing {duration:g} s of samples")
        for item in source.blocks():
            if isinstance(item, SegmentEnd):
                end = item
                break
            blocks.append(item)
            if item.end >= round(duration * source.acquisition.rate):
                source.stop()
        return Capture(source.acquisition, tuple(blocks), end)


def warn_unless(is_good: bool, check: Check, finding: Finding, advice: str) -> Check:  # noqa: FBT001 - like an if
    """Return a check, with a warning unless it is good."""
    return check if is_good else check.warn(finding, advice)


def device_checks(rig: Rig, acquisition: Acquisition) -> Iterator[Check]:
    """Yield the checks of the opened card: product, serial number, sample rate."""
    section, device = rig.config.device, acquisition.device
    value = f"{device.product}" + (f", serial number {device.serial}" if device.serial else "")
    if device.simulated:
        simulator = "the rig file" if section.backend is Backend.SIMULATED else "the NI driver (NI MAX)"
        advice = f'{simulator} simulates the card: nothing is measured; backend = "nidaqmx" and a real card measure'
        yield Check("device", f"{value}, simulated", section.product).warn(Finding.SIMULATED, advice)
    else:
        yield Check("device", value, section.product)
    if section.backend is Backend.NIDAQMX:
        yield warn_unless(
            bool(section.serial),
            Check("device serial", device.serial, section.serial or "a serial number in [device]"),
            Finding.SERIAL,
            f"the card is known only as {section.name}, a name that moves with the USB port: enter "
            f'serial = "{device.serial}" in [device]',
        )
    configured, actual = rig.config.timing.rate_hz, acquisition.rate
    limit = f"{configured:,.0f} Hz ± {100 * RATE_TOLERANCE:g} %"
    yield warn_unless(
        abs(actual - configured) <= RATE_TOLERANCE * configured,
        Check("sample rate", f"{actual:,.1f} Hz a channel", limit),
        Finding.RATE,
        f"the card divides its clock by whole numbers only: enter the actual rate, rate_hz = {actual:.6g}",
    )


def device_error_check(rig: Rig, error: DeviceError, *, in_self_test: bool) -> Check:
    """Return the failed check of a card that delivers no samples or fails its self-test."""
    section = rig.config.device
    finding = _FINDINGS.get(error.fault)
    if finding is None and in_self_test:
        return Check("self-test", "failed", "the card's own test").fail(Finding.SELF_TEST, str(error))
    finding = finding or Finding.REFUSED
    which = f"serial number {section.serial}" if section.serial else section.name
    return Check("device", finding.value, f"{section.product}, {which}").fail(finding, str(error))


def self_calibration_check(rig: Rig, calibrated: dt.date, today: dt.date) -> Check:
    """Return the check of the age of the card's self-calibration."""
    age, max_age = (today - calibrated).days, rig.config.preflight.self_calibration_days
    return warn_unless(
        age <= max_age,
        Check("card self-calibration", f"{calibrated}, {age} days old", f"{max_age} days"),
        Finding.CALIBRATION,
        "run the self-calibration in NI MAX after 15 min of warm-up: the card's scaling drifts",
    )


def sample_checks(blocks: Sequence[SampleBlock], end: SegmentEnd | None, wanted: int, rig: Rig) -> Iterator[Check]:
    """Yield the checks that the wanted samples per channel arrive complete, in time and without driver warnings."""
    count, in_order = 0, True
    for block in blocks:
        in_order = in_order and block.first_sample == count and block.segment == 0
        count = block.end
    check = Check("samples", f"{count:,} samples a channel", f"{wanted:,} without a gap")
    if end is None or not (in_order and end.is_gap_free and end.samples == count and count >= wanted):
        reason = "" if end is None else f": {end.reason.value}" + (f", {end.detail}" if end.detail else "")
        advice = f"the card did not deliver a whole second{reason}; connect it to a USB port of its own, without a hub"
        check = check.fail(Finding.COUNT, advice)
    yield check
    if end is not None and end.is_gap_free and end.detail:
        yield Check("driver", "warnings", "none").warn(Finding.DRIVER_WARNING, end.detail)
    backlog = max((block.backlog for block in blocks), default=0) / rig.config.timing.rate_hz
    limit = rig.config.timing.buffer_s / 4
    yield warn_unless(
        backlog <= limit,
        Check("backlog", f"{backlog:.2f} s", f"{limit:.2g} s, a quarter of buffer_s"),
        Finding.BACKLOG,
        "this computer is too slow: close other programs, lower rate_hz, or raise buffer_s",
    )


def calibration_checks(rig: Rig, today: dt.date) -> Iterator[Check]:
    """Yield the checks of the rig's calibrations: age, residual, serial numbers."""
    for name, calibration in rig.calibrations.items():
        yield _age_check(name, calibration, today, rig.config.preflight.calibration_days)
        yield _residual_check(name, calibration, rig.config.preflight.residual_fraction)
    yield _serials_check(rig)


def disk_check(free: int, rig: Rig, rate: float, duration: float | None) -> Check:
    """Return the check that the planned run fits on the disk.

    Parameters
    ----------
    free : int
        Free bytes of the data folder's disk.
    rig : Rig
        The rig.
    rate : float
        Sample rate, Hz.
    duration : float or None
        Duration of the planned run, s; None where not given.
    """
    available = free - rig.config.storage.reserve_gb * 1e9
    lasts = max(available, 0.0) / disk_rate(rig, rate)
    needed = 3600.0 * rig.config.preflight.disk_duration_h if duration is None else duration
    check = Check("disk", _duration_text(lasts), _duration_text(needed))
    advice = "free disk space, or record elsewhere (storage.folder, RIG_DATA)"
    if duration is None and lasts > 0.0:
        return warn_unless(lasts >= needed, check, Finding.DISK, advice)
    return check if lasts >= needed else check.fail(Finding.DISK, f"a full disk would end the run: {advice}")


def _duration_text(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:,.0f} h"


def disk_rate(rig: Rig, rate: float) -> float:
    """Return the maximum data rate of a run, bytes per second, before compression."""
    return rate * len(rig.config.channel) * BYTES_PER_SAMPLE


def planned_speed_check(rig: Rig, speed: float) -> Check:
    """Return the check of the planned speed, rad/s, against the rig's limit."""
    limit_speed = rig.limits.speed
    check = Check("planned speed", f"{speed / RPM:,.0f} r/min", f"{limit_speed / RPM:,.0f} r/min")
    if speed <= limit_speed * (1.0 + 1e-9):
        return check
    advice = "the planned speed is above limits.speed_rpm, the maximum speed of the rig: plan a lower one"
    return check.fail(Finding.SPEED, advice)


def _age_check(name: str, calibration: Calibration, today: dt.date, max_age: int) -> Check:
    age = (today - dt.date.fromisoformat(calibration.date)).days
    label, limit = f"probe {name} calibration", f"{max_age} days"
    if age < 0:
        advice = "the calibration date is in the future: the computer's date or the record's is wrong"
        return Check(label, f"{calibration.date}, today is {today}", limit).warn(Finding.CALIBRATION, advice)
    return warn_unless(
        age <= max_age,
        Check(label, f"{calibration.date}, {age} days old", limit),
        Finding.CALIBRATION,
        f"calibrate the probe again: rig calibrate gap RIG.TOML {name}",
    )


def _residual_check(name: str, calibration: Calibration, fraction: float) -> Check:
    ends = np.array([calibration.volts_low, calibration.volts_high])
    low, high = np.polynomial.polynomial.polyval(ends, calibration.coefficients)
    allowed = fraction * float(high - low)
    label, limit = f"probe {name} fit", f"{allowed / MICROMETRE:.1f} µm, {100 * fraction:g} % of the span"
    if calibration.residual == 0.0:
        advice = "the record does not state the residual of its polynomial: rig calibrate gap stores it"
        return Check(label, "unknown", limit).warn(Finding.CALIBRATION, advice)
    return warn_unless(
        0.0 < calibration.residual <= allowed,
        Check(label, f"{calibration.residual / MICROMETRE:.2f} µm maximum error", limit),
        Finding.CALIBRATION,
        "the polynomial fits the points badly: use a higher order, or measure the points again",
    )


def _serials_check(rig: Rig) -> Check:
    serials = {name: (c.sensor, c.conditioner) for name, c in rig.calibrations.items()}
    value = "; ".join(f"{name}: {' + '.join(filter(None, pair)) or 'none'}" for name, pair in serials.items())
    check = Check("probe serials", value, "a sensor and conditioner for each probe, all different")
    if not all(all(pair) for pair in serials.values()):
        advice = "a record without serial numbers may belong to another sensor: enter them"
        return check.warn(Finding.CALIBRATION, advice)
    return warn_unless(
        min(len(set(numbers)) for numbers in zip(*serials.values(), strict=True)) == len(serials),
        check,
        Finding.CALIBRATION,
        "two probes cannot share a sensor or a conditioner: one of the records is the wrong file",
    )


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """The planned run.

    Parameters
    ----------
    folder : Path
        Data folder of the run.
    duration : float or None
        Its duration, s; None where not given.
    speed : float or None
        Its maximum speed, rad/s; None for the rig's limit.
    """

    folder: Path
    duration: float | None = None
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class PreflightReport:
    """Result of the preflight checks.

    Parameters
    ----------
    acquisition : Acquisition or None
        Read back from the opened device; None where it cannot be opened.
    checks : tuple of Check
        In the order in which an operator checks a rig.
    device_error : DeviceError or None
        Why there are no samples; checks that need none are made.
    """

    acquisition: Acquisition | None
    checks: tuple[Check, ...]
    device_error: DeviceError | None = None

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all checks."""
        return worst_verdict(self.checks)


def run_preflight_checks(rig: Rig, plan: PlannedRun, today: dt.date, on_progress: OnProgress) -> PreflightReport:
    """Open the rig's device, capture a second of samples, and return the checks.

    A device that is missing, busy or fails its self-test is a failed check; checks that need no samples follow.

    Parameters
    ----------
    rig : Rig
        The rig.
    plan : PlannedRun
        The planned run.
    today : date
        Today's date, for the age of calibrations.
    on_progress : callable
        Receives the name of each step.
    """
    acquisition, device_error = None, None
    checks: list[Check] = []
    in_self_test = rig.config.device.backend is Backend.NIDAQMX
    try:
        if in_self_test:
            on_progress("self-test of the card")
            calibrated = self_test(rig.config.device)  # before the acquisition: a card cannot test itself during one
            checks.append(Check("self-test", "passed", "the card's own test"))
            if calibrated is not None:  # this card reports it
                checks.append(self_calibration_check(rig, calibrated, today))
            in_self_test = False
        captured = capture(rig, CAPTURE_DURATION, on_progress)
    except DeviceError as error:
        device_error = error
        checks.append(device_error_check(rig, error, in_self_test=in_self_test))
    else:
        acquisition = captured.acquisition
        checks = [*device_checks(rig, acquisition), *checks]
        checks += sample_checks(captured.blocks, captured.end, round(CAPTURE_DURATION * acquisition.rate), rig)
        if captured.codes.size:
            checks += wiring_checks(acquisition, captured.codes, rig.wiring_limits)
            if rig.tacho.counter is not None:
                checks.append(counter_check(acquisition, captured.codes, captured.ticks))
    speed = rig.limits.speed if plan.speed is None else plan.speed
    checks += [planned_speed_check(rig, speed), speed_limit_check(rig.tacho, speed)]
    checks += calibration_checks(rig, today)
    rate = rig.config.timing.rate_hz if acquisition is None else acquisition.rate
    checks.append(disk_check(free_bytes(plan.folder), rig, rate, plan.duration))
    return PreflightReport(acquisition, tuple(checks), device_error)
