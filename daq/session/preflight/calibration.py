"""Measuring for a calibration: a probe at a gap that a micrometer sets, and the tacho's levels."""

import csv
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.preflight.probe_checks import MAX_CARD_NOISE, MAX_OPEN_VOLTS, MAX_STUCK_NOISE
from analysis.preflight.switching_levels import SignalLevels, find_state_levels
from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Role
from daq.config.rig import MICRO, Rig
from daq.config.schema import Backend, ProfilePoint
from daq.drivers.factory import open_source
from daq.errors import DeviceError, DeviceFault, UsageError
from daq.session.preflight.preflight import capture

STEP = 0.5  # s of samples at a step: whole periods of 50 and 60 Hz
TACHO_CAPTURE_DURATION = 1.0  # s


@dataclass(frozen=True, slots=True)
class CalibrationPoint:
    """A measured point of a calibration.

    Parameters
    ----------
    gap : float
        That the micrometer set, m.
    volts : float
        Mean voltage, V.
    scatter : float
        Standard deviation of the voltage, V; NaN where it is not known.
    """

    gap: float
    volts: float
    scatter: float = np.nan


def probe_row(rig: Rig, name: str) -> int:
    """Return the number of a probe's channel in a rig.

    Raises
    ------
    UsageError
        There is no probe of this name.
    """
    probes = [channel.name for channel in rig.config.channel if channel.role is not Role.TACHO]
    for row, channel in enumerate(rig.config.channel):
        if channel.name == name and name in probes:
            return row
    raise UsageError(f"{rig.path} has no probe {name!r}: expected {' or '.join(probes)}")


def measure_point(rig: Rig, name: str, gap: float) -> CalibrationPoint:
    """Return a probe's voltage at a gap, m, that has been set.

    With the simulated backend the gap is set here: the shaft stands still, where the micrometer puts it.

    Raises
    ------
    DeviceError
        The device is missing or busy, gave no samples, or the voltage is out of its range or dead.
    """
    set_up = _at_gap(rig, name, gap) if rig.config.device.backend is Backend.SIMULATED else rig
    with closing(open_source(set_up)) as source:
        acquisition = source.acquisition
        seen = capture(source, round(STEP * acquisition.rate))
    row = [channel.name for channel in acquisition.channels].index(name)
    if seen.codes.size == 0:
        raise DeviceError(DeviceFault.OTHER, f"no samples came{_why(seen.end)}")
    codes = seen.codes[row]
    if np.any((codes == CODE_MIN) | (codes == CODE_MAX)):
        raise DeviceError(
            DeviceFault.REJECTED,
            f"probe {name} is at the end of what {acquisition.channels[row].physical} can read at {gap / MICRO:g} µm: "
            "leave this step out, or set a larger range_v",
        )
    volts = acquisition.channels[row].volts(codes)
    noise = float(np.std(codes))
    if noise < MAX_STUCK_NOISE or (noise < MAX_CARD_NOISE and abs(float(np.mean(volts))) < MAX_OPEN_VOLTS):
        raise DeviceError(
            DeviceFault.REJECTED,
            f"probe {name} shows not even a sensor's noise at {gap / MICRO:g} µm: unplugged, without supply or out of "
            "its reach",
        )
    return CalibrationPoint(gap, float(np.mean(volts)), float(np.std(volts)))


def measure_tacho_levels(rig: Rig) -> SignalLevels | None:
    """Return the levels between which the tacho switches in a second; None where it does not.

    Raises
    ------
    DeviceError
        The device is missing or busy, or gave no samples.
    """
    with closing(open_source(rig)) as source:
        acquisition = source.acquisition
        seen = capture(source, round(TACHO_CAPTURE_DURATION * acquisition.rate))
    if seen.codes.size == 0:
        raise DeviceError(DeviceFault.OTHER, f"no samples came{_why(seen.end)}")
    row = acquisition.row(Role.TACHO)
    return find_state_levels(acquisition.channels[row].volts(seen.codes[row]))


def read_points(path: Path) -> list[CalibrationPoint]:
    """Return the points in a CSV file: gap in µm, volts; a head line and further columns are passed over.

    Raises
    ------
    UsageError
        There is no such file, or a line holds no two numbers.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            text = file.read()
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: byte {error.start} is not UTF-8, expected a text file") from error
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror or error})") from error
    delimiter = ";" if ";" in text else "\t" if "\t" in text else ","
    points = []
    for number, fields in enumerate(csv.reader(text.splitlines(), delimiter=delimiter), start=1):
        if not any(field.strip() for field in fields):
            continue
        try:
            gap, volts = (float(_decimal(field, delimiter)) for field in fields[:2])
        except ValueError as error:
            if number == 1 and not fields[0][:1].isdigit():
                continue  # a head line
            raise UsageError(f"{path}, line {number}: {delimiter.join(fields)!r}: expected gap_um, volts") from error
        points.append(CalibrationPoint(gap * MICRO, volts))
    return points


def _decimal(field: str, delimiter: str) -> str:
    """Return a number as Python reads it; where commas do not part the fields they are decimal commas."""
    return field if delimiter == "," else field.replace(",", ".")


def _why(end: SegmentEnd | None) -> str:
    detail = "" if end is None else end.detail
    return f": {detail}" if detail else ""


def _at_gap(rig: Rig, name: str, gap: float) -> Rig:
    """Return the simulated rig with its shaft at rest, so far from a probe."""
    bench = rig.config.simulation
    role = rig.config.channel[probe_row(rig, name)].role
    gaps = (gap / MICRO, bench.gap_um[1]) if role is Role.PROBE_X else (bench.gap_um[0], gap / MICRO)
    still = bench.model_copy(
        update={
            "motion": "bench",
            "pace": "flat out",
            "profile": (ProfilePoint(time_s=0, speed_rpm=0), ProfilePoint(time_s=1, speed_rpm=0)),
            "whirl": (),
            "run_out_um": 0.0,
            "second_order_um": 0.0,
            "sag_um": 0.0,
            "glitches_per_s": 0.0,
            "gap_um": gaps,
        }
    )
    return replace(rig, config=rig.config.model_copy(update={"simulation": still}))
