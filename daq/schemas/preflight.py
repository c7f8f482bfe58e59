"""What a preflight found.

What is connected.
Whether a rig file is good, and what was understood of it.

What a calibration found.
"""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from analysis.preflight.calibration_fit import CalibrationFit
from analysis.preflight.checks import Check, Finding, Verdict
from analysis.preflight.switching_levels import SignalLevels
from analysis.signals.header import Role, Tacho
from daq.config.calibration import CalibrationRecord
from daq.config.rig import Rig
from daq.drivers.ni import FoundDevice
from daq.errors import ConfigError
from daq.schemas.header import DeviceSchema, device_schema
from daq.schemas.units import Schema, finite
from daq.session.preflight.preflight import PreflightReport


class CalibratedPointSchema(Schema):
    """A point and how well the polynomial meets it."""

    gap_um: float = Field(description="Set with the micrometer, µm")
    volts: float = Field(description="The conditioner's mean output, V")
    residual_um: float | None = Field(description="The polynomial's gap less the point's, µm")


class GapCalibrationSchema(Schema):
    """A probe's new calibration."""

    channel: str = Field(description="The probe", examples=["x"])
    file: str = Field(description="The record that was written")
    coefficients_um: tuple[float, ...] = Field(description="gap = sum of coefficients_um[k] · volts**k, µm per V**k")
    volts_low: float | None = Field(description="Lower end of the calibrated span, V")
    volts_high: float | None = Field(description="Upper end of the calibrated span, V")
    residual_um: float | None = Field(description="Largest deviation of a point, µm")
    points: tuple[CalibratedPointSchema, ...] = Field(description="As they were measured")


class TachoCalibrationSchema(Schema):
    """Switching levels for the tacho; the proposal is null where its signal does not switch."""

    level_low_v: float | None = Field(description="Lower level of the signal, V")
    level_high_v: float | None = Field(description="Upper level of the signal, V")
    noise_v: float | None = Field(description="Scatter about its level, V rms")
    duty_cycle: float | None = Field(description="Part of the time at the upper level, 0 to 1")
    threshold_v: float | None = Field(description="Proposed middle of the switching levels, V")
    hysteresis_v: float | None = Field(description="Proposed distance of the switching levels, V")
    current_threshold_v: float = Field(description="As the rig file has it, V")
    current_hysteresis_v: float = Field(description="As the rig file has it, V")


def gap_calibration_schema(
    channel: str, path: Path, record: CalibrationRecord, fit: CalibrationFit
) -> GapCalibrationSchema:
    """Return a probe's new calibration as a document."""
    table = record.calibration
    return GapCalibrationSchema(
        channel=channel,
        file=str(path),
        coefficients_um=table.coefficients_um or (),
        volts_low=table.volts_low,
        volts_high=table.volts_high,
        residual_um=table.residual_um,
        points=tuple(
            CalibratedPointSchema(gap_um=point.gap_um, volts=point.volts, residual_um=finite(float(off) * 1e6))
            for point, off in zip(record.point, fit.residuals, strict=True)
        ),
    )


def tacho_calibration_schema(tacho: Tacho, levels: SignalLevels | None) -> TachoCalibrationSchema:
    """Return the tacho's levels and what they ask for as a document."""
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
    """One line of the table."""

    name: str = Field(description="What was looked at", examples=["probe y gap"])
    verdict: Verdict = Field(description="How it came out")
    finding: Finding | None = Field(description="What is wrong; null where the check passed")
    value: str = Field(description="What was seen, with its unit", examples=["0.02 V"])
    limit: str = Field(description="What was expected, with its unit", examples=["1.5 to 8.5 V"])
    advice: str = Field(description="What it means at the bench and what to do; empty where nothing is to be done")


class PreflightSchema(Schema):
    """Whether a rig is ready."""

    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    verdict: Verdict = Field(description="The worst of all checks; FAIL stands against a run")
    device: DeviceSchema | None = Field(description="What delivered the samples; null where nothing did")
    sample_rate_hz: float | None = Field(description="Samples per channel and second as the card does it, Hz")
    convert_rate_hz: float | None = Field(description="Clock of the multiplexer between channels, Hz")
    checks: tuple[PreflightCheckSchema, ...] = Field(description="In the order in which an operator would look")


def preflight_schema(rig: str, found: PreflightReport) -> PreflightSchema:
    """Return what was found as a document."""
    acquisition = found.acquisition
    return PreflightSchema(
        rig=rig,
        verdict=found.verdict,
        device=None if acquisition is None else device_schema(acquisition.device),
        sample_rate_hz=None if acquisition is None else acquisition.rate,
        convert_rate_hz=None if acquisition is None else acquisition.convert_rate,
        checks=tuple(_check_schema(check) for check in found.checks),
    )


def _check_schema(check: Check) -> PreflightCheckSchema:
    return PreflightCheckSchema(
        name=check.name,
        verdict=check.verdict,
        finding=check.finding,
        value=check.value,
        limit=check.limit,
        advice=check.advice,
    )


class FoundDeviceSchema(Schema):
    """A device that the driver lists."""

    name: str = Field(description="The driver's name for it, which moves with the port", examples=["Dev1"])
    product: str = Field(description="Product name as the device gives it", examples=["USB-6251"])
    serial: str = Field(description="Serial number as printed on it", examples=["1A2B3C"])
    simulated: bool = Field(description="Whether the driver only simulates it")
    busy: bool | None = Field(description="Whether another acquisition holds it; null where it cannot be asked")
    driver: str = Field(description="Name and version of the driver, and where it is", examples=["NI-DAQmx 24.5.1"])


def found_device_schema(device: FoundDevice) -> FoundDeviceSchema:
    """Return a device as a document."""
    return FoundDeviceSchema(
        name=device.name,
        product=device.product,
        serial=device.serial,
        simulated=device.simulated,
        busy=device.busy,
        driver=device.driver,
    )


class CheckedChannelSchema(Schema):
    """One input and what is wired to it."""

    name: str = Field(description="The operator's name for it", examples=["x"])
    role: Role = Field(description="What it measures")
    physical: str = Field(description="The card's input", examples=["ai0"])
    calibration: str = Field(description="The calibration file as the rig file names it; empty for the tacho")


class RigCheckSchema(Schema):
    """Whether a rig file is good; what was understood is null, and channels are none, where it is not."""

    file: str = Field(description="The rig file")
    is_valid: bool = Field(description="Whether there is no fault in it or in a file that it names")
    faults: tuple[str, ...] = Field(description="Every fault, with key, value and what was expected")
    rig: str | None = Field(description="Name of the rig", examples=["gj90c"])
    channels: tuple[CheckedChannelSchema, ...] = Field(description="In the order in which they are sampled")
    sample_rate_hz: float | None = Field(description="Samples per channel and second that the card will do, Hz")
    convert_rate_hz: float | None = Field(description="Clock of the multiplexer to be expected, Hz")
    tacho_reference: str | None = Field(
        description='What speed and phase are taken from: "samples" of the tacho, or a "counter" that stamps its edges'
    )
    counter_resolution_ns: float | None = Field(description="Of the stamps, ns; null where no counter stamps")
    disk_bytes_per_hour: Annotated[int, Field(ge=0)] | None = Field(
        description="What a run takes at most, bytes an hour"
    )


def invalid_rig_schema(error: ConfigError) -> RigCheckSchema:
    """Return the faults of a rig file as a document."""
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
    """Return what was understood of a rig file as a document; rates in Hz, the disk's in bytes a second."""
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
