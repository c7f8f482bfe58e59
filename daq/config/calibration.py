"""A probe's calibration file: its schema, reading, checking and writing."""

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from analysis.preflight.calibration import ORDER_RANGE, CalibrationFit, default_order, fit_calibration
from analysis.signals.errors import CalibrationFitError
from analysis.signals.header import Calibration
from analysis.signals.units import MICROMETRE
from daq.config.schema import NotNegative, Section
from daq.config.toml_files import read_tables, read_text, to_toml, validated
from daq.errors import ConfigError, UsageError

FloatArray = NDArray[np.float64]

MAX_ROUNDING_ERROR_UM = 0.1  # µm by which a point's deviation may exceed the stated residual


def _iso_date(value: str) -> str:
    try:
        dt.date.fromisoformat(value)
    except ValueError as error:
        raise ValueError('expected a date like "2026-11-24"') from error
    return value


class CalibrationMetadata(Section):
    """The data of a calibration other than its curve and points."""

    sensor: str = ""  # serial numbers
    conditioner: str = ""
    date: Annotated[str, AfterValidator(_iso_date)]
    target: str = ""  # material and diameter of the calibration target
    operator: str = ""  # name of the person who calibrated
    note: str = ""


class CalibrationTable(CalibrationMetadata):
    """`[calibration]`: gap = sum of ``coefficients_um[k]`` · volts**k; without coefficients, a fit to the points."""

    coefficients_um: Annotated[tuple[float, ...], Field(min_length=2, max_length=8)] | None = None  # µm per volt**k
    order: Annotated[int, Field(ge=ORDER_RANGE[0], le=ORDER_RANGE[1])] | None = None  # of the fit to the points
    volts_low: float | None = None  # the span that was calibrated; left out: that of the points
    volts_high: float | None = None
    residual_um: NotNegative | None = None  # largest deviation of a calibration point


class CalibrationPoint(Section):
    """`[[point]]`: a measured point."""

    gap_um: NotNegative
    volts: float


class CalibrationRecord(Section):
    """A calibration file."""

    calibration: CalibrationTable
    point: tuple[CalibrationPoint, ...] = ()


def load_calibration(path: Path) -> Calibration:
    """Return the calibration in a file.

    Raises
    ------
    ConfigError
        The file is missing or wrong; lists all errors.
    """
    return to_calibration(load_record(path), str(path))


def to_calibration(record: CalibrationRecord, file: str) -> Calibration:
    """Return the calibration in a record.

    Parameters
    ----------
    record : CalibrationRecord
        The record.
    file : str
        Its file name, for error messages.

    Raises
    ------
    ConfigError
        It does not describe a curve; lists all errors.
    """
    faults: list[str] = []
    curve = _curve(record, faults)
    if curve is None or (faults := faults + _cross_field_faults(curve, record)):
        raise ConfigError(file, faults)
    return Calibration(
        coefficients=tuple(coefficient * MICROMETRE for coefficient in curve.coefficients_um),
        volts_low=curve.volts_low,
        volts_high=curve.volts_high,
        residual=curve.residual_um * MICROMETRE,
        **record.calibration.model_dump(include={"sensor", "conditioner", "date", "target", "operator"}),
    )


def load_record(path: Path) -> CalibrationRecord:
    """Return the content of a calibration file, even if it does not describe a curve.

    Raises
    ------
    ConfigError
        The file is missing or violates the schema; lists all errors.
    """
    return validated(CalibrationRecord, read_tables(read_text(path), str(path)), str(path))


@dataclass(frozen=True, slots=True)
class _Curve:
    """A record's polynomial, stated or fitted to its points; µm and V."""

    coefficients_um: tuple[float, ...]
    volts_low: float
    volts_high: float
    residual_um: float


def _curve(record: CalibrationRecord, faults: list[str]) -> _Curve | None:
    """Return a record's polynomial; None, with errors appended to `faults`, if it cannot be determined."""
    table, volts = record.calibration, [point.volts for point in record.point]
    low = min(volts, default=None) if table.volts_low is None else table.volts_low
    high = max(volts, default=None) if table.volts_high is None else table.volts_high
    coefficients, residual = table.coefficients_um, table.residual_um
    if coefficients is None and volts:
        order = default_order(len(volts)) if table.order is None else table.order
        try:
            gaps = np.array([point.gap_um for point in record.point]) * MICROMETRE
            fit = fit_calibration(gaps, np.array(volts), order)
        except CalibrationFitError as error:
            faults.append(f"point: {error}")
            return None
        coefficients = tuple(coefficient / MICROMETRE for coefficient in fit.coefficients)
        residual = fit.residual / MICROMETRE if residual is None else residual
    elif table.order is not None:
        faults.append(f"calibration.order = {table.order}: expected none with coefficients_um")
    for key, value in (("coefficients_um", coefficients), ("volts_low", low), ("volts_high", high)):
        if value is None:
            expected = "a list in brackets" if key == "coefficients_um" else "a number"
            faults.append(
                f"calibration.{key}: missing, expected {expected}, or the measured points as [[point]] tables"
            )
    if coefficients is None or low is None or high is None:
        return None
    return _Curve(coefficients, low, high, residual or 0.0)


def _cross_field_faults(curve: _Curve, record: CalibrationRecord) -> list[str]:
    """Return the contradictions between keys."""
    if curve.volts_low >= curve.volts_high:
        return [f"calibration.volts_low = {curve.volts_low:g}: expected less than volts_high = {curve.volts_high:g}"]
    faults = []
    volts = np.linspace(curve.volts_low, curve.volts_high, 1001)
    if np.any(np.diff(np.polynomial.polynomial.polyval(volts, curve.coefficients_um)) <= 0):
        faults.append(
            f"calibration.coefficients_um = {list(curve.coefficients_um)}: expected a gap that rises with the voltage "
            f"from {curve.volts_low:g} to {curve.volts_high:g} V"
        )
    for number, point in enumerate(record.point):
        deviation = abs(float(np.polynomial.polynomial.polyval(point.volts, curve.coefficients_um)) - point.gap_um)
        if deviation > curve.residual_um + MAX_ROUNDING_ERROR_UM:
            faults.append(
                f"point[{number}] = {point.gap_um:g} µm at {point.volts:g} V: expected within {curve.residual_um:g} µm "
                f"of the polynomial, deviates by {deviation:.2f} µm"
            )
    return faults


def fitted_record(
    fit: CalibrationFit, gaps: FloatArray, volts: FloatArray, metadata: CalibrationMetadata
) -> CalibrationRecord:
    """Return the record of a fit.

    Parameters
    ----------
    fit : CalibrationFit
        The polynomial.
    gaps, volts : ndarray of float64, shape (n,)
        The points, m and V.
    metadata : CalibrationMetadata
        The record's other data.
    """
    table = CalibrationTable(
        **metadata.model_dump(),
        coefficients_um=tuple(float(f"{coefficient / MICROMETRE:.9g}") for coefficient in fit.coefficients),
        volts_low=round(fit.volts_low, 6),
        volts_high=round(fit.volts_high, 6),
        residual_um=float(f"{fit.residual / MICROMETRE:.4g}"),
    )
    points = tuple(
        CalibrationPoint(gap_um=round(float(gap) / MICROMETRE, 4), volts=round(float(volt), 6))
        for gap, volt in zip(gaps, volts, strict=True)
    )
    return CalibrationRecord(calibration=table, point=points)


def write_record(path: Path, record: CalibrationRecord) -> None:
    """Write a record to a new file; an existing file is never overwritten.

    Raises
    ------
    UsageError
        The file exists, or it cannot be written.
    """
    text = to_toml(record.model_dump(mode="json", exclude_none=True))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise UsageError(f"{path}: exists already, and a calibration is never overwritten") from error
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror or error})") from error
