"""Measurements for calibrations: a probe's voltage at a micrometer gap, and the tacho's switching levels."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.preflight.calibration import SignalLevels, find_state_levels
from analysis.preflight.wiring import MAX_CARD_NOISE, MAX_OPEN_VOLTS, MAX_STUCK_NOISE
from analysis.signals import CodeArray
from analysis.signals.header import CODE_MAX, CODE_MIN, Channel, Role
from analysis.signals.units import MICROMETRE
from daq.config.rig import Rig
from daq.config.schema import Backend, ProfilePoint
from daq.config.toml_files import read_text
from daq.errors import DeviceError, DeviceFault, UsageError
from daq.session.preflight import capture

STEP_DURATION = 0.5  # s of samples per gap: whole periods of 50 and 60 Hz
TACHO_CAPTURE_DURATION = 1.0  # s


@dataclass(frozen=True, slots=True)
class CalibrationPoint:
    """A measured point of a calibration.

    Parameters
    ----------
    gap : float
        Gap set with the micrometer, m.
    volts : float
        Mean voltage, V.
    scatter : float
        Standard deviation of the voltage, V; NaN where unknown.
    """

    gap: float
    volts: float
    scatter: float = np.nan


def probe_row(rig: Rig, name: str) -> int:
    """Return the index of a probe's channel in a rig.

    Raises
    ------
    UsageError
        The rig has no probe of this name.
    """
    probes = {channel.name: row for row, channel in enumerate(rig.config.channel) if channel.role is not Role.TACHO}
    if name in probes:
        return probes[name]
    raise UsageError(f"{rig.path} has no probe {name!r}: expected {' or '.join(probes)}")


def measure_point(rig: Rig, name: str, gap: float) -> CalibrationPoint:
    """Return a probe's mean voltage at a gap, m, set with the micrometer.

    The simulated backend sets the gap itself, with the shaft at rest.

    Raises
    ------
    DeviceError
        The device is missing or busy, delivers no samples, or the voltage is out of range or without noise.
    """
    at_gap = _with_gap(rig, name, gap) if rig.config.device.backend is Backend.SIMULATED else rig
    channel, codes = _captured_channel(at_gap, STEP_DURATION, rig.config.channel[probe_row(rig, name)].role)
    if np.any((codes == CODE_MIN) | (codes == CODE_MAX)):
        raise DeviceError(
            DeviceFault.REJECTED,
            f"probe {name} reads at the limit of {channel.physical} at {gap / MICROMETRE:g} µm: "
            "skip this gap, or set a larger range_v",
        )
    volts = channel.volts(codes)
    noise = float(np.std(codes))
    if noise < MAX_STUCK_NOISE or (noise < MAX_CARD_NOISE and abs(float(np.mean(volts))) < MAX_OPEN_VOLTS):
        raise DeviceError(
            DeviceFault.REJECTED,
            f"probe {name} shows no sensor noise at {gap / MICROMETRE:g} µm: unplugged, without supply or out of range",
        )
    return CalibrationPoint(gap, float(np.mean(volts)), float(np.std(volts)))


def measure_tacho_levels(rig: Rig) -> SignalLevels | None:
    """Return the tacho's low and high level from a second of samples; None where it does not switch.

    Raises
    ------
    DeviceError
        The device is missing or busy, or delivers no samples.
    """
    channel, codes = _captured_channel(rig, TACHO_CAPTURE_DURATION, Role.TACHO)
    return find_state_levels(channel.volts(codes))


def _captured_channel(rig: Rig, duration: float, role: Role) -> tuple[Channel, CodeArray]:
    """Return a channel and its samples of a duration, s; DeviceError where there are none."""
    captured = capture(rig, duration)
    if captured.codes.size == 0:
        detail = "" if captured.end is None else captured.end.detail
        message = "the device delivered no samples" + (f": {detail}" if detail else "")
        raise DeviceError(DeviceFault.OTHER, message)
    row = captured.acquisition.row(role)
    return captured.acquisition.channels[row], captured.codes[row]


def read_points(path: Path) -> list[CalibrationPoint]:
    """Return the points of a CSV file with gap in µm and volts; a header line and further columns are ignored.

    Raises
    ------
    UsageError
        There is no such file, or a line does not start with two numbers.
    """
    text = read_text(path, "CSV")
    delimiter = ";" if ";" in text else "\t" if "\t" in text else ","
    points = []
    for number, fields in enumerate(csv.reader(text.splitlines(), delimiter=delimiter), start=1):
        if not any(field.strip() for field in fields):
            continue
        try:
            gap, volts = (float(field if delimiter == "," else field.replace(",", ".")) for field in fields[:2])
        except ValueError as error:
            if number == 1 and not fields[0][:1].isdigit():
                continue  # a header line
            raise UsageError(f"{path}, line {number}: {delimiter.join(fields)!r}: expected gap_um, volts") from error
        points.append(CalibrationPoint(gap * MICROMETRE, volts))
    return points


def _with_gap(rig: Rig, name: str, gap: float) -> Rig:
    """Return the simulated rig with its shaft at rest at a gap, m, from a probe."""
    simulation = rig.config.simulation
    role = rig.config.channel[probe_row(rig, name)].role
    gap_um = gap / MICROMETRE
    gaps = (gap_um, simulation.gap_um[1]) if role is Role.PROBE_X else (simulation.gap_um[0], gap_um)
    at_rest = simulation.model_copy(
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
    return replace(rig, config=rig.config.model_copy(update={"simulation": at_rest}))
