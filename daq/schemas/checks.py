"""Schemas of checks: preflight, connected devices, rig file, calibration; verification and recovery of recordings."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from analysis.preflight.calibration import CalibrationFit, SignalLevels
from analysis.preflight.check_result import Finding, Verdict
from analysis.signals.header import Role, Tacho
from daq.config.calibration import CalibrationRecord
from daq.config.rig import Rig
from daq.errors import ConfigError
from daq.schemas.runs import DeviceSchema
from daq.schemas.units import Number, Schema, finite, micrometres
from daq.session.preflight import PreflightReport
from recordings.integrity import file_checks, verify
from recordings.integrity.recover import MissingSamples, RecoveredSegment, Recovery


class CalibratedPointSchema(Schema):
    """A calibration point and its residual."""

    gap_um: float = Field(description="Gap set with the micrometer, µm")
    volts: float = Field(description="Mean output of the conditioner, V")
    residual_um: Number = Field(description="Gap of the polynomial minus that of the point, µm")


class GapCalibrationSchema(Schema):
    """A new calibration of a probe."""

    channel: str = Field(description="Name of the probe", examples=["x"])
    file: str = Field(description="Calibration file that was written")
    coefficients_um: tuple[float, ...] = Field(description="gap = sum of coefficients_um[k] · volts**k, µm per V**k")
    volts_low: Number = Field(description="Lower end of the calibrated span, V")
    volts_high: Number = Field(description="Upper end of the calibrated span, V")
    residual_um: Number = Field(description="Largest deviation of a point, µm")
    points: tuple[CalibratedPointSchema, ...] = Field(description="Points in order of measurement")


class TachoCalibrationSchema(Schema):
    """Proposed switching levels of the tacho; null where its signal does not switch."""

    level_low_v: Number = Field(description="Lower level of the signal, V")
    level_high_v: Number = Field(description="Upper level of the signal, V")
    noise_v: Number = Field(description="Noise about the levels, V RMS")
    duty_cycle: Number = Field(description="Fraction of the time at the upper level, 0 to 1")
    threshold_v: Number = Field(description="Proposed middle of the switching levels, V")
    hysteresis_v: Number = Field(description="Proposed distance of the switching levels, V")
    current_threshold_v: float = Field(description="Present value in the rig file, V")
    current_hysteresis_v: float = Field(description="Present value in the rig file, V")


def gap_calibration_schema(
    channel: str, path: Path, record: CalibrationRecord, fit: CalibrationFit
) -> GapCalibrationSchema:
    """Return the schema of a probe's new calibration."""
    table = record.calibration
    return GapCalibrationSchema(
        channel=channel,
        file=str(path),
        coefficients_um=table.coefficients_um or (),
        volts_low=table.volts_low,
        volts_high=table.volts_high,
        residual_um=table.residual_um,
        points=tuple(
            CalibratedPointSchema(gap_um=point.gap_um, volts=point.volts, residual_um=micrometres(float(off)))
            for point, off in zip(record.point, fit.residuals, strict=True)
        ),
    )


def tacho_calibration_schema(tacho: Tacho, levels: SignalLevels | None) -> TachoCalibrationSchema:
    """Return the schema of the tacho's levels and proposed thresholds."""
    return TachoCalibrationSchema(
        level_low_v=None if levels is None else finite(levels.low),
        level_high_v=None if levels is None else finite(levels.high),
        noise_v=None if levels is None else finite(levels.scatter),
        duty_cycle=None if levels is None else finite(levels.high_fraction),
        threshold_v=None if levels is None else finite(levels.middle),
        hysteresis_v=None if levels is None else finite(levels.hysteresis),
        current_threshold_v=tacho.threshold,
        current_hysteresis_v=tacho.hysteresis,
    )


class PreflightCheckSchema(Schema):
    """Result of one preflight check."""

    name: str = Field(description="Name of the check", examples=["probe y gap"])
    verdict: Verdict = Field(description="Verdict of the check")
    finding: Finding | None = Field(description="Type of the fault; null where the check passed")
    value: str = Field(description="Measured value with its unit", examples=["0.02 V"])
    limit: str = Field(description="Expected value with its unit", examples=["1.5 to 8.5 V"])
    advice: str = Field(description="Meaning at the bench and remedy; empty where nothing is to be done")


class PreflightSchema(Schema):
    """Result of a preflight."""

    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    verdict: Verdict = Field(description="Worst verdict of all checks; FAIL blocks a run")
    device: DeviceSchema | None = Field(description="Device that delivered the samples; null without one")
    sample_rate_hz: Number = Field(description="Actual samples per channel and second, Hz")
    convert_rate_hz: Number = Field(description="Convert clock of the multiplexer, Hz")
    checks: tuple[PreflightCheckSchema, ...] = Field(description="Checks in the order of an inspection")


def preflight_schema(rig: str, report: PreflightReport) -> PreflightSchema:
    """Return the schema of a preflight of a rig."""
    acquisition = report.acquisition
    return PreflightSchema.of(
        report,
        rig=rig,
        device=None if acquisition is None else acquisition.device,
        sample_rate_hz=None if acquisition is None else acquisition.rate,
        convert_rate_hz=None if acquisition is None else acquisition.convert_rate,
    )


class FoundDeviceSchema(Schema):
    """A connected device."""

    name: str = Field(description="Name given by the driver; it changes with the USB port", examples=["Dev1"])
    product: str = Field(description="Product name as the device gives it", examples=["USB-6251"])
    serial: str = Field(description="Serial number as printed on the device", examples=["1A2B3C"])
    simulated: bool = Field(description="Whether the driver simulates the device")
    busy: bool | None = Field(description="Whether another acquisition uses the device; null where unknown")
    driver: str = Field(description="Name, version and host of the driver", examples=["NI-DAQmx 24.5.1"])


class CheckedChannelSchema(Schema):
    """An input of the card and the sensor wired to it."""

    name: str = Field(description="Name of the channel", examples=["x"])
    role: Role = Field(description="Measured quantity")
    physical: str = Field(description="Input of the card", examples=["ai0"])
    calibration: str = Field(description="Calibration file as given in the rig file; empty for the tacho")


class RigCheckSchema(Schema):
    """Check of a rig file; values are null and channels empty where it is invalid."""

    file: str = Field(description="Path of the rig file")
    is_valid: bool = Field(description="Whether the rig file and the files it names are free of errors")
    faults: tuple[str, ...] = Field(description="All errors, with key, value and what was expected")
    rig: str | None = Field(description="Name of the rig", examples=["gj90c"])
    channels: tuple[CheckedChannelSchema, ...] = Field(description="Channels in sampling order")
    sample_rate_hz: Number = Field(description="Samples per channel and second that the card will use, Hz")
    convert_rate_hz: Number = Field(description="Expected convert clock of the multiplexer, Hz")
    tacho_reference: str | None = Field(
        description='Source of speed and phase: "samples" of the tacho, or a "counter" that timestamps its edges'
    )
    counter_resolution_ns: Number = Field(description="Resolution of the timestamps, ns; null without a counter")
    disk_bytes_per_hour: Annotated[int, Field(ge=0)] | None = Field(
        description="Upper limit of the data rate of a run, bytes per hour"
    )


def invalid_rig_schema(error: ConfigError) -> RigCheckSchema:
    """Return the schema of an invalid rig file with its errors."""
    return RigCheckSchema(
        file=error.file,
        is_valid=False,
        faults=tuple(error.faults),
        rig=None,
        channels=(),
        sample_rate_hz=None,
        convert_rate_hz=None,
        tacho_reference=None,
        counter_resolution_ns=None,
        disk_bytes_per_hour=None,
    )


def valid_rig_schema(rig: Rig, *, rate: float, convert_rate: float, disk_rate: float) -> RigCheckSchema:
    """Return the schema of a valid rig file; rates in Hz, ``disk_rate`` in bytes per second."""
    return RigCheckSchema(
        file=str(rig.path),
        is_valid=True,
        faults=(),
        rig=rig.config.rig,
        channels=tuple(
            CheckedChannelSchema(
                name=channel.name, role=channel.role, physical=channel.physical, calibration=channel.calibration
            )
            for channel in rig.config.channel
        ),
        sample_rate_hz=finite(rate),
        convert_rate_hz=finite(convert_rate),
        tacho_reference=rig.tacho.reference,
        counter_resolution_ns=None if rig.tacho.counter is None else finite(1e9 / rig.tacho.counter.timebase),
        disk_bytes_per_hour=round(disk_rate * 3600),
    )


class VerificationFindingSchema(Schema, of=(file_checks.Finding,)):
    """A finding of a verification."""

    check: file_checks.Check = Field()
    location: str = Field()
    description: str = Field()
    is_fault: bool = Field()


class VerificationSchema(Schema, of=(verify.Verification,)):
    """Result of verifying a recording's file."""

    run: str = Field()
    path: str = Field()
    verdict: verify.Verdict = Field()
    size_bytes: int = Field()
    chunks: int = Field()
    segments: int = Field()
    samples: int = Field()
    pulses: int = Field()
    findings: list[VerificationFindingSchema] = Field()


class MissingSamplesSchema(Schema, of=(MissingSamples,)):
    """Samples of a segment that were not recovered; null where the end of the segment is unknown."""

    segment: int = Field()
    first_sample: int = Field()
    stop_sample: int | None = Field()
    samples: int | None = Field()


class RecoveredSegmentSchema(Schema, of=(RecoveredSegment,)):
    """A segment of the copy and the position of its samples in the damaged recording."""

    segment: int = Field()
    from_segment: int = Field()
    first_sample: int = Field()
    stop_sample: int = Field()


class RecoverySchema(Schema, of=(Recovery,)):
    """Result of a recovery."""

    source: str = Field()
    target: str = Field()
    samples: int = Field()
    damaged_chunks: int = Field()
    segments: list[RecoveredSegmentSchema] = Field()
    missing: list[MissingSamplesSchema] = Field()
