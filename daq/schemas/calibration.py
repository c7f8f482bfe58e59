"""What a calibration found."""

from pathlib import Path

from pydantic import Field

from analysis.preflight.calibration_fit import CalibrationFit
from analysis.preflight.switching_levels import Levels
from analysis.signals.header import Tacho
from daq.config.calibration import CalibrationRecord
from daq.schemas.document import Document
from daq.schemas.units import finite


class CalibratedPointDocument(Document):
    """A point and how well the polynomial meets it."""

    gap_um: float = Field(description="Set with the micrometer, µm")
    volts: float = Field(description="The conditioner's mean output, V")
    off_um: float | None = Field(description="The polynomial's gap less the point's, µm")


class GapCalibrationDocument(Document):
    """A probe's new calibration."""

    channel: str = Field(description="The probe", examples=["x"])
    file: str = Field(description="The record that was written")
    coefficients_um: tuple[float, ...] = Field(description="gap = sum of coefficients_um[k] · volts**k, µm per V**k")
    volts_low: float | None = Field(description="Lower end of the calibrated span, V")
    volts_high: float | None = Field(description="Upper end of the calibrated span, V")
    residual_um: float | None = Field(description="Largest deviation of a point, µm")
    points: tuple[CalibratedPointDocument, ...] = Field(description="As they were measured")


class TachoCalibrationDocument(Document):
    """Switching levels for the tacho; the proposal is null where its signal does not switch."""

    level_low_v: float | None = Field(description="Lower level of the signal, V")
    level_high_v: float | None = Field(description="Upper level of the signal, V")
    noise_v: float | None = Field(description="Scatter about its level, V rms")
    light_fraction: float | None = Field(description="Part of the time at the upper level, 0 to 1")
    threshold_v: float | None = Field(description="Proposed middle of the switching levels, V")
    hysteresis_v: float | None = Field(description="Proposed distance of the switching levels, V")
    present_threshold_v: float = Field(description="As the rig file has it, V")
    present_hysteresis_v: float = Field(description="As the rig file has it, V")


def gap_document(channel: str, path: Path, record: CalibrationRecord, fit: CalibrationFit) -> GapCalibrationDocument:
    """Return a probe's new calibration as a document."""
    table = record.calibration
    return GapCalibrationDocument(
        channel=channel,
        file=str(path),
        coefficients_um=table.coefficients_um or (),
        volts_low=table.volts_low,
        volts_high=table.volts_high,
        residual_um=table.residual_um,
        points=tuple(
            CalibratedPointDocument(gap_um=point.gap_um, volts=point.volts, off_um=finite(float(off) * 1e6))
            for point, off in zip(record.point, fit.residuals, strict=True)
        ),
    )


def tacho_document(tacho: Tacho, levels: Levels | None) -> TachoCalibrationDocument:
    """Return the tacho's levels and what they ask for as a document."""
    return TachoCalibrationDocument(
        level_low_v=None if levels is None else finite(levels.low),
        level_high_v=None if levels is None else finite(levels.high),
        noise_v=None if levels is None else finite(levels.scatter),
        light_fraction=None if levels is None else finite(levels.high_fraction),
        threshold_v=None if levels is None else finite(levels.middle),
        hysteresis_v=None if levels is None else finite(levels.hysteresis),
        present_threshold_v=tacho.threshold,
        present_hysteresis_v=tacho.hysteresis,
    )
