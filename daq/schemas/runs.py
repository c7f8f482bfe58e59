"""Schemas of runs: header with device, channels, limits and run-out; list of runs; report of an indexing."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

from pydantic import Field

from analysis.signals.header import Channel, Limits, Role, RunOutSettings
from analysis.signals.snapshot import RunOut
from daq.schemas.units import Count, Number, Schema, degrees, finite, rpm, utc_time
from daq.schemas.vibration import LargestOverallSchema, ProbeVectorsSchema, probe_vectors_schema
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
    angle_deg: Number = Field(
        description="Angle of a probe from +X (right), degrees, positive with the rotation; null for the tacho",
        examples=[45.0],
    )


class LimitsSchema(Schema, of=(Limits,)):
    """Limits of vibration and speed, and the clearance."""

    peak_to_peak_alarm_um: Number = Field(examples=[80.0])
    peak_to_peak_danger_um: Number = Field(examples=[95.0])
    clearance_um: Number = Field(examples=[100.0])
    speed_rpm: Number = Field(examples=[20_000.0])
    order_1x_peak_alarm_um: Number = Field(examples=[30.0])
    order_1x_peak_danger_um: Number = Field(examples=[40.0])
    below_1x_peak_alarm_um: Number = Field(examples=[20.0])
    below_1x_peak_danger_um: Number = Field(examples=[35.0])
    speed_alarm_rpm: Number = Field(examples=[18_000.0])
    speed_danger_rpm: Number = Field(examples=[19_500.0])


def channel_schema(channel: Channel) -> ChannelSchema:
    """Return the schema of a channel."""
    angle = None if channel.role is Role.TACHO else degrees(channel.angle)
    return ChannelSchema(name=channel.name, role=channel.role, angle_deg=angle)


class RunOutSchema(Schema):
    """Run-out of the shaft surface; only values named compensated have it subtracted."""

    source: str = Field(description="Source of the run-out", examples=["slow roll of this run", "rig.toml"])
    slow_roll_rpm: Number = Field(
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


RunId = Annotated[str, Field(description="Id of the run", max_length=200, examples=["2026-11-24T09-12-07-gj90c"])]


class RunSchema(LargestOverallSchema, of=(RunEntry,)):
    """A recorded run; where its file cannot be read, values from the file are null."""

    run: str = Field(examples=["2026-11-24T09-12-07-gj90c"])
    rig: str | None = Field(description="Name of the rig", examples=["gj90c"])
    note: str | None = Field(description="Note of the operator", examples=["after the oil change"])
    device: DeviceSchema | None = Field(description="Device that delivered the samples")
    channels: tuple[ChannelSchema, ...] | None = Field(description="Channels in sampling order")
    started_at: datetime = Field(
        description="Wall clock at the start, UTC; modification time of a file that cannot be read",
        examples=["2026-11-24T09:12:07.250000Z"],
    )
    duration_s: Number = Field(description="Sampled time, s", examples=[300.0])
    sample_rate_hz: Number = Field(description="Samples per channel and second, Hz", examples=[200_000.0])
    samples: Count | None = Field(description="Samples per channel", examples=[60_000_000])
    is_complete: bool = Field(examples=[True])
    is_gap_free: bool = Field(examples=[True])
    size_bytes: Count = Field(examples=[154_000_000])
    fault: str = Field(examples=[""])
    calibration: str | None = Field(
        description="Hash of the probes' calibrations, hexadecimal; equal for equal calibrations",
        examples=["5d41402abc4b2a76"],
    )
    remark: str = Field(examples=["bearing changed after this run"])
    tags: tuple[str, ...] = Field(examples=[["reference"]])
    verdict: str = Field(examples=["intact"])


class RunListSchema(Schema):
    """A page of the list of runs."""

    runs: tuple[RunSchema, ...] = Field(description="Runs in the requested order")
    total: Count = Field(description="Number of matching runs on all pages", examples=[12])
    limit: Count = Field(description="Maximum number of runs on a page", examples=[20])
    offset: Count = Field(description="Number of runs skipped before this page", examples=[0])


def run_schema(entry: RunEntry) -> RunSchema:
    """Return the schema of a run of the catalogue."""
    header = entry.header
    return RunSchema.of(
        entry,
        rig=None if header is None else header.rig,
        note=None if header is None else header.note,
        device=None if header is None else header.acquisition.device,
        channels=None if header is None else tuple(map(channel_schema, header.acquisition.channels)),
        started_at=utc_time(entry.started_ns),
        duration_s=None if header is None else finite(entry.duration),
        sample_rate_hz=None if header is None else finite(header.acquisition.rate),
        samples=None if header is None else entry.samples,
        calibration=None if header is None else entry.calibration,
    )


def run_list_schema(entries: Sequence[RunEntry], total: int, limit: int, offset: int) -> RunListSchema:
    """Return the schema of a page of runs; ``total`` counts all pages."""
    return RunListSchema(runs=tuple(run_schema(entry) for entry in entries), total=total, limit=limit, offset=offset)


class IndexReportSchema(Schema, of=(IndexReport,)):
    """Run ids by how their files differ from the catalogue before the indexing."""

    new: tuple[str, ...] = Field()
    changed: tuple[str, ...] = Field()
    missing: tuple[str, ...] = Field()
    damaged: tuple[str, ...] = Field()
    unchanged: int = Field()
