"""Whether a header can turn codes into volts and micrometres: its scalings and calibrations are sane."""

import math
from collections.abc import Iterator

import numpy as np

from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Calibration, Channel, Role
from recordings.integrity.findings import Check, Finding

POINTS = 501


def check_acquisition(acquisition: Acquisition) -> Iterator[Finding]:
    """Yield what is wrong with rates, channels, scalings and calibrations."""
    for name, rate in (("rate", acquisition.rate), ("convert rate", acquisition.convert_rate)):
        if not 0 < rate < math.inf:
            yield Finding(Check.CALIBRATION, "header", f"{name} of {rate} Hz, expected a positive one")
    for role in Role:
        names = [channel.name for channel in acquisition.channels if channel.role is role]
        if len(names) != 1:
            yield Finding(Check.CALIBRATION, "header", f"{len(names)} channels have the role {role.value}, expected 1")
    for channel in acquisition.channels:
        where = f"channel {channel.name}"
        for what in _channel_faults(channel):
            yield Finding(Check.CALIBRATION, where, what)
        if channel.calibration is not None and not channel.calibration.date:
            yield Finding(Check.CALIBRATION, where, "the calibration has no date", is_fault=False)


def _channel_faults(channel: Channel) -> Iterator[str]:
    if not channel.scaling or not np.isfinite(channel.scaling).all():
        yield f"scaling {channel.scaling}, expected finite coefficients"
        return
    volts = channel.volts(np.array([CODE_MIN, CODE_MAX], dtype=np.int16))
    if not volts[0] < volts[1]:
        yield f"the scaling gives {volts[0]:g} V at the lowest code and {volts[1]:g} V at the highest"
    if channel.role is Role.TACHO:
        return
    if channel.calibration is None:
        yield "a probe without calibration: its samples cannot become micrometres"
    else:
        yield from _calibration_faults(channel.calibration)


def _calibration_faults(calibration: Calibration) -> Iterator[str]:
    if not calibration.coefficients or not np.isfinite(calibration.coefficients).all():
        yield f"calibration {calibration.coefficients}, expected finite coefficients"
    elif not calibration.volts_low < calibration.volts_high:
        yield f"calibrated from {calibration.volts_low:g} to {calibration.volts_high:g} V, expected a rising span"
    else:
        volts = np.linspace(calibration.volts_low, calibration.volts_high, POINTS)
        steps = np.diff(np.polynomial.polynomial.polyval(volts, calibration.coefficients))
        if not ((steps > 0).all() or (steps < 0).all()):
            yield "the calibration gives one gap for two voltages within its span"
