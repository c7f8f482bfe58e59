"""Schemas of the catalogue: runs, the list of runs, the report of an indexing."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

from pydantic import Field

from daq.schemas.header import ChannelSchema, DeviceSchema, channel_schema, device_schema
from daq.schemas.units import Schema, finite, utc_time
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.indexing import IndexReport

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
