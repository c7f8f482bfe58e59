"""A probe's calibration record: a small TOML file beside rig.toml."""

import datetime as dt
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, ValidationError

from analysis.run import Calibration
from daq.config.faults import plain_json, read_tables, read_text, validation_faults
from daq.config.schema import NotNegative, Section
from daq.errors import ConfigError

MICRO = 1e-6
ROUNDING = 0.1  # µm by which a point may lie farther off than the residual says


def _day(value: str) -> str:
    try:
        dt.date.fromisoformat(value)
    except ValueError as error:
        raise ValueError('expected a day like "2026-11-24"') from error
    return value


class CalibrationTable(Section):
    """`[calibration]`: gap = sum of ``coefficients_um[k]`` · volts**k."""

    coefficients_um: Annotated[tuple[float, ...], Field(min_length=2, max_length=8)]  # in rising order, µm per volt**k
    volts_low: float  # the span that was calibrated
    volts_high: float
    residual_um: NotNegative = 0.0  # largest deviation of a calibration point
    sensor: str = ""  # serial numbers
    conditioner: str = ""
    date: Annotated[str, AfterValidator(_day)]
    target: str = ""  # material and diameter of what it was calibrated against
    note: str = ""


class CalibrationPoint(Section):
    """`[[point]]`: what was measured."""

    gap_um: NotNegative
    volts: float


class CalibrationRecord(Section):
    """A whole calibration file."""

    calibration: CalibrationTable
    point: tuple[CalibrationPoint, ...] = ()


def load_calibration(path: Path) -> Calibration:
    """Return the calibration in a file.

    Raises
    ------
    ConfigError
        The file is missing or wrong; names every fault.
    """
    data = read_tables(read_text(path), str(path))
    try:
        record = CalibrationRecord.model_validate_json(plain_json(data), strict=True)
    except ValidationError as error:
        faults = [fault.text for fault in validation_faults(error, CalibrationRecord, data)]
        raise ConfigError(str(path), faults) from error
    table = record.calibration
    if faults := _cross_faults(record):
        raise ConfigError(str(path), faults)
    return Calibration(
        coefficients=tuple(coefficient * MICRO for coefficient in table.coefficients_um),
        volts_low=table.volts_low,
        volts_high=table.volts_high,
        residual=table.residual_um * MICRO,
        sensor=table.sensor,
        conditioner=table.conditioner,
        date=table.date,
    )


def _cross_faults(record: CalibrationRecord) -> list[str]:
    """Return what single keys cannot show."""
    table = record.calibration
    if table.volts_low >= table.volts_high:
        return [f"calibration.volts_low = {table.volts_low:g}: expected less than volts_high = {table.volts_high:g}"]
    faults = []
    volts = np.linspace(table.volts_low, table.volts_high, 1001)
    if np.any(np.diff(np.polynomial.polynomial.polyval(volts, table.coefficients_um)) <= 0):
        faults.append(
            f"calibration.coefficients_um = {list(table.coefficients_um)}: expected a gap that rises with the voltage "
            f"from {table.volts_low:g} to {table.volts_high:g} V"
        )
    for number, point in enumerate(record.point):
        off = abs(float(np.polynomial.polynomial.polyval(point.volts, table.coefficients_um)) - point.gap_um)
        if off > table.residual_um + ROUNDING:
            faults.append(
                f"point[{number}] = {point.gap_um:g} µm at {point.volts:g} V: expected within {table.residual_um:g} µm "
                f"of the polynomial, lies {off:.2f} µm off"
            )
    return faults
