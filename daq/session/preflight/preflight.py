"""Preflight checks: a short capture of the rig's samples and its configuration, judged check by check."""

import datetime as dt
import shutil
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.check_result import Check, Verdict, worst_verdict
from analysis.preflight.tacho_checks import counter_check, speed_limit_check
from analysis.preflight.wiring import wiring_checks
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition
from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers.factory import open_source
from daq.drivers.ni import self_test
from daq.drivers.source import Source
from daq.errors import DeviceError
from daq.session.preflight.rig_checks import (
    calibration_checks,
    device_checks,
    device_error_check,
    disk_check,
    planned_speed_check,
    sample_checks,
    self_calibration_checks,
)

CAPTURE_DURATION = 1.0  # s of samples

OnProgress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """The first segment of a source, captured for checks.

    Parameters
    ----------
    blocks : tuple of SampleBlock
        Blocks of the segment.
    end : SegmentEnd or None
        End of the segment; None where the source ended without one.
    """

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
        """Counter stamps of the tacho's edges; None where a block has none."""
        stamped = [block.ticks for block in self.blocks if block.ticks is not None]
        return np.concatenate(stamped) if stamped and len(stamped) == len(self.blocks) else None


def capture(source: Source, samples: int) -> Capture:
    """Return at least `samples` samples per channel of a source, and stop it; the caller closes it."""
    blocks: list[SampleBlock] = []
    for item in source.blocks():
        if isinstance(item, SegmentEnd):
            return Capture(tuple(blocks), item)
        blocks.append(item)
        if item.end >= samples:
            source.stop()
    return Capture(tuple(blocks), None)


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
            checks += self_calibration_checks(rig, calibrated, today)
            in_self_test = False
        acquisition, captured = _capture_from(rig, on_progress)
    except DeviceError as error:
        device_error = error
        checks.append(device_error_check(rig, error, in_self_test=in_self_test))
    else:
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
    checks.append(disk_check(_free_bytes(plan.folder), rig, rate, plan.duration))
    return PreflightReport(acquisition, tuple(checks), device_error)


def _capture_from(rig: Rig, on_progress: OnProgress) -> tuple[Acquisition, Capture]:
    """Return a second of the rig's samples; DeviceError where the device cannot be opened."""
    on_progress("opening the device")
    with closing(open_source(rig)) as source:
        on_progress(f"capturing {CAPTURE_DURATION:g} s of samples")
        return source.acquisition, capture(source, round(CAPTURE_DURATION * source.acquisition.rate))


def _free_bytes(folder: Path) -> int:
    """Return the free bytes on the disk of a folder that exists or will be created."""
    existing = folder.absolute()
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    return shutil.disk_usage(existing).free
