"""Is the rig ready? A second of its samples, and all that is known before, as a table of verdicts.

A short look at what a source gives.
"""

import datetime as dt
import shutil
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.preflight.checks import Check, Verdict, worst_verdict
from analysis.preflight.counter_check import counter_check
from analysis.preflight.tacho_checks import speed_limit_check
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


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """A stretch of samples from a source.

    Parameters
    ----------
    blocks : tuple of SampleBlock
        Of the first segment, as they came.
    end : SegmentEnd or None
        Of that segment; None where the source ended without one.
    """

    blocks: tuple[SampleBlock, ...]
    end: SegmentEnd | None

    @property
    def codes(self) -> NDArray[np.int16]:
        """All samples, shape (n_channels, n); n = 0 where none came."""
        if not self.blocks:
            return np.empty((0, 0), dtype=np.int16)
        return np.concatenate([block.codes for block in self.blocks], axis=1)

    @property
    def ticks(self) -> NDArray[np.int64] | None:
        """What a counter stamped of the tacho's edges; None where none did throughout."""
        stamped = [block.ticks for block in self.blocks if block.ticks is not None]
        return np.concatenate(stamped) if stamped and len(stamped) == len(self.blocks) else None


def capture(source: Source, samples: int) -> Capture:
    """Take at least so many samples per channel from a source, and stop it; it is left to be closed."""
    blocks: list[SampleBlock] = []
    for item in source.blocks():
        if isinstance(item, SegmentEnd):
            return Capture(tuple(blocks), item)
        blocks.append(item)
        if item.end >= samples:
            source.stop()
    return Capture(tuple(blocks), None)


CAPTURE_DURATION = 1.0  # s of samples

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """The run that is planned.

    Parameters
    ----------
    folder : Path
        Where it goes.
    duration : float or None
        How long it is to be, s; None where that is open.
    speed : float or None
        Highest speed, rad/s; None for the rig's limit.
    """

    folder: Path
    duration: float | None = None
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class PreflightReport:
    """What was found.

    Parameters
    ----------
    acquisition : Acquisition or None
        As the opened device reports it; None where it could not be opened.
    checks : tuple of Check
        In the order in which an operator would look.
    trouble : DeviceError or None
        Why there are no samples; what needs none is judged all the same.
    """

    acquisition: Acquisition | None
    checks: tuple[Check, ...]
    device_error: DeviceError | None = None

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        return worst_verdict(self.checks)


def run_preflight_checks(rig: Rig, plan: PlannedRun, today: dt.date, told: Progress) -> PreflightReport:
    """Open the rig's device, look at a second of samples, and judge.

    A device that is missing, busy or fails its own test is a check like any other, and what needs no samples is judged.

    Parameters
    ----------
    rig : Rig
        The rig.
    plan : Plan
        What is to be recorded.
    today : date
        Against which calibrations age.
    told : callable
        Told what is being done.
    """
    acquisition, device_error = None, None
    checks: list[Check] = []
    in_self_test = rig.config.device.backend is Backend.NIDAQMX
    try:
        if in_self_test:
            told("the card tests itself")
            calibrated = self_test(rig.config.device)  # before the acquisition: a card at work cannot
            checks.append(Check.passed("self-test", "passed", "the card's own test"))
            checks += self_calibration_checks(rig, calibrated, today)
            in_self_test = False
        acquisition, seen = _capture_from(rig, told)
    except DeviceError as error:
        device_error = error
        checks.append(device_error_check(rig, error, in_self_test=in_self_test))
    else:
        checks = [*device_checks(rig, acquisition), *checks]
        checks += sample_checks(seen.blocks, seen.end, round(CAPTURE_DURATION * acquisition.rate), rig)
        if seen.codes.size:
            checks += wiring_checks(acquisition, seen.codes, rig.wiring_limits)
            if rig.tacho.counter is not None:
                checks.append(counter_check(acquisition, seen.codes, seen.ticks))
    speed = rig.limits.speed if plan.speed is None else plan.speed
    checks += [planned_speed_check(rig, speed), speed_limit_check(rig.tacho, speed)]
    checks += calibration_checks(rig, today)
    rate = rig.config.timing.rate_hz if acquisition is None else acquisition.rate
    checks.append(disk_check(_free(plan.folder), rig, rate, plan.duration))
    return PreflightReport(acquisition, tuple(checks), device_error)


def _capture_from(rig: Rig, told: Progress) -> tuple[Acquisition, Capture]:
    """Return a second of the rig's samples; DeviceError where there is no device to give them."""
    told("opening the device")
    with closing(open_source(rig)) as source:
        told(f"looking at {CAPTURE_DURATION:g} s of samples")
        return source.acquisition, capture(source, round(CAPTURE_DURATION * source.acquisition.rate))


def _free(folder: Path) -> int:
    """Return the bytes that are free where a folder is, or will be made."""
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    return shutil.disk_usage(there).free
