"""Schemas of runs: header with device, channels, limits and run-out; list of runs; report of an indexing."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

from pydantic import Field

from analysis.signals.header import Channel, Device, Limits, Role, RunOutSettings
from analysis.signals.snapshot import RunOut
from daq.schemas.units import Schema, degrees, finite, micrometres, rpm, utc_time
from daq.schemas.vibration import ProbeVectorsSchema, probe_vectors_schema
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.entry import IndexReport


class DeviceSchema(Schema):
    """The device that delivered the samples."""

    backend: str = Field(description="Driver", examples=["nidaqmx"])
    product: str = Field(description="Product name as the device gives it", examples=["USB-6251"])
    serial: str = Field(description="Serial number as printed on the device", examples=["1A2B3C"])
    simulated: bool = Field(description="Whether the device is simulated", examples=[False])


class ChannelSchema(Schema):
    """An input channel and the sensor wired to it."""

    name: str = Field(description="Name of the channel", examples=["x"])
    role: Role = Field(description="Measured quantity", examples=["probe_x"])
    angle_deg: float | None = Field(
        description="Angle of a probe from +X (right), degrees, positive with the rotation; null for the tacho",
        examples=[45.0],
    )


class LimitsSchema(Schema):
    """Limits of vibration and speed, and the clearance."""

    peak_to_peak_alarm_um: float | None = Field(
        description="Alarm limit of overall vibration, µm peak-to-peak", examples=[80.0]
    )
    peak_to_peak_danger_um: float | None = Field(
        description="Danger limit of overall vibration, µm peak-to-peak", examples=[95.0]
    )
    clearance_um: float | None = Field(description="Radius of the clearance circle, µm", examples=[100.0])
    speed_rpm: float | None = Field(description="Highest speed of the rig, r/min", examples=[20_000.0])
    order_1x_peak_alarm_um: float | None = Field(
        description="Alarm limit of 1X at either probe, as measured, µm peak; null: not watched",
        examples=[30.0],
    )
    order_1x_peak_danger_um: float | None = Field(description="Danger limit of it, µm peak", examples=[40.0])
    below_1x_peak_alarm_um: float | None = Field(
        description="Alarm limit of the sum of amplitudes of all components below 1X at either probe, µm peak; "
        "null: not watched",
        examples=[20.0],
    )
    below_1x_peak_danger_um: float | None = Field(description="Danger limit of it, µm peak", examples=[35.0])
    speed_alarm_rpm: float | None = Field(
        description="Alarm limit of the speed, r/min; null: not watched", examples=[18_000.0]
    )
    speed_danger_rpm: float | None = Field(description="Danger limit of the speed, r/min", examples=[19_500.0])


def channel_schema(channel: Channel) -> ChannelSchema:
    """Return the schema of a channel."""
    angle = None if channel.role is Role.TACHO else degrees(channel.angle)
    return ChannelSchema(name=channel.name, role=channel.role, angle_deg=angle)


def device_schema(device: Device) -> DeviceSchema:
    """Return the schema of a device."""
    return DeviceSchema(
        backend=device.backend, product=device.product, serial=device.serial, simulated=device.simulated
    )


def limits_schema(limits: Limits) -> LimitsSchema:
    """Return the schema of limits."""
    return LimitsSchema(
        peak_to_peak_alarm_um=micrometres(limits.peak_to_peak_alarm),
        peak_to_peak_danger_um=micrometres(limits.peak_to_peak_danger),
        clearance_um=micrometres(limits.clearance),
        speed_rpm=rpm(limits.speed),
        order_1x_peak_alarm_um=micrometres(limits.order_1x_alarm),
        order_1x_peak_danger_um=micrometres(limits.order_1x_danger),
        below_1x_peak_alarm_um=micrometres(limits.below_1x_alarm),
        below_1x_peak_danger_um=micrometres(limits.below_1x_danger),
        speed_alarm_rpm=rpm(limits.speed_alarm),
        speed_danger_rpm=rpm(limits.speed_danger),
    )


class RunOutSchema(Schema):
    """Run-out of the shaft surface; only values named compensated have it subtracted."""

    source: str = Field(description="Source of the run-out", examples=["slow roll of this run", "rig.toml"])
    slow_roll_rpm: float | None = Field(
        description="Highest speed of the slow roll, r/min; null where the run-out was known before the run",
        examples=[600.0],
    )
    is_known: bool = Field(description="Whether the run-out is known; a slow roll must come first", examples=[True])
    from_orbit: bool = Field(description="Whether it is subtracted from the orbit too", examples=[False])
    order_1x: ProbeVectorsSchema | None = Field(description="Run-out at 1X; null until it is known")
    order_2x: ProbeVectorsSchema | None = Field(description="Run-out at 2X; null likewise")


def runout_schema(settings: RunOutSettings, runout: RunOut | None) -> RunOutSchema | None:
    """Return the schema of the run-out; None without compensation."""
    if not settings.is_enabled:
        return None
    is_from_run = settings.slow_roll_speed > 0.0
    return RunOutSchema(
        source="slow roll of this run" if is_from_run else settings.source,
        slow_roll_rpm=rpm(settings.slow_roll_speed) if is_from_run else None,
        is_known=runout is not None,
        from_orbit=settings.from_orbit,
        order_1x=None if runout is None else probe_vectors_schema(runout.vectors[0].tolist()),
        order_2x=None if runout is None else probe_vectors_schema(runout.vectors[1].tolist()),
    )


Count = Annotated[int, Field(ge=0)]
RunId = Annotated[str, Field(description="Id of the run", max_length=200, examples=["2026-11-24T09-12-07-gj90c"])]


class RunSchema(Schema):
    """A recorded run; where its file cannot be read, values from the file are null."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    rig: str | None = Field(description="Name of the rig", examples=["gj90c"])
    note: str | None = Field(description="Note of the operator", examples=["after the oil change"])
    device: DeviceSchema | None = Field(description="Device that delivered the samples")
    channels: tuple[ChannelSchema, ...] | None = Field(description="Channels in sampling order")
    started_at: datetime = Field(
        description="Wall clock at the start, UTC; modification time of a file that cannot be read",
        examples=["2026-11-24T09:12:07.250000Z"],
    )
    duration_s: float | None = Field(description="Sampled time, s", examples=[300.0])
    sample_rate_hz: float | None = Field(description="Samples per channel and second, Hz", examples=[200_000.0])
    samples: Count | None = Field(description="Samples per channel", examples=[60_000_000])
    is_complete: bool = Field(description="Whether the recording was finished properly", examples=[True])
    is_gap_free: bool = Field(description="Whether the run is one segment without lost samples", examples=[True])
    size_bytes: Count = Field(description="Size of the file, bytes", examples=[154_000_000])
    fault: str = Field(description="Error of the file; empty without an error", examples=[""])
    calibration: str | None = Field(
        description="Hash of the probes' calibrations, hexadecimal; equal for equal calibrations",
        examples=["5d41402abc4b2a76"],
    )
    remark: str = Field(description="Remark added afterwards", examples=["bearing changed after this run"])
    tags: tuple[str, ...] = Field(description="Tags added afterwards", examples=[["reference"]])
    verdict: str = Field(
        description="Verdict of the last verification: sound, not whole, unreadable; empty without one",
        examples=["sound"],
    )


class RunListSchema(Schema):
    """A page of the list of runs."""

    runs: tuple[RunSchema, ...] = Field(description="Runs in the requested order")
    total: Count = Field(description="Number of matching runs on all pages", examples=[12])
    limit: Count = Field(description="Maximum number of runs on a page", examples=[20])
    offset: Count = Field(description="Number of runs skipped before this page", examples=[0])


def run_schema(entry: RunEntry) -> RunSchema:
    """Return the schema of a run of the catalogue."""
    header = entry.header
    return RunSchema(
        run=entry.id,
        rig=None if header is None else header.rig,
        note=None if header is None else header.note,
        device=None if header is None else device_schema(header.acquisition.device),
        channels=None if header is None else tuple(map(channel_schema, header.acquisition.channels)),
        started_at=utc_time(entry.started_ns),
        duration_s=None if header is None else finite(entry.duration),
        sample_rate_hz=None if header is None else finite(header.acquisition.rate),
        samples=None if header is None else entry.samples,
        is_complete=entry.is_complete,
        is_gap_free=entry.is_gap_free,
        size_bytes=entry.size,
        fault=entry.fault,
        calibration=None if header is None else entry.calibration,
        remark=entry.remark,
        tags=entry.tags,
        verdict=entry.verdict,
    )


def run_list_schema(entries: Sequence[RunEntry], total: int, limit: int, offset: int) -> RunListSchema:
    """Return the schema of a page of runs; ``total`` counts all pages."""
    return RunListSchema(runs=tuple(run_schema(entry) for entry in entries), total=total, limit=limit, offset=offset)


class IndexReportSchema(Schema):
    """Run ids by how their files differ from the catalogue before the indexing."""

    new: tuple[str, ...]
    changed: tuple[str, ...]
    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unchanged: int


def index_report_schema(report: IndexReport) -> IndexReportSchema:
    """Return the schema of an index report."""
    return IndexReportSchema(
        new=report.new,
        changed=report.changed,
        missing=report.missing,
        damaged=report.damaged,
        unchanged=report.unchanged,
    )
