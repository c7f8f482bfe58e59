"""Request and response schemas of jobs."""

from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from daq.config.calibration import CalibrationRecord
from daq.reports.parameters import MAX_TIME
from daq.reports.registry import KINDS
from daq.schemas.live import PredictedVibrationSchema
from daq.schemas.runs import RunId
from daq.schemas.study import StudyRequest
from daq.schemas.units import Schema
from daq.service.jobs.queue import Job, JobState
from daq.service.schemas.uploads import ImportRequest, validate_as_file
from recordings.exchange.formats import EXPORT_FORMATS

JOBS = "/api/v1/jobs"

ParameterValue: TypeAlias = str | float | bool | None


class RecordedResult(StrEnum):
    """Path of a recorded result below `/api/v1/runs/{run}/`."""

    SUMMARY = "summary"
    ORDER_VECTORS = "order-vectors"
    FINDINGS = "findings"
    TREND = "trend"
    CASCADE = "cascade"
    WATERFALL = "waterfall"
    ORDER_SPECTRUM = "order-spectrum"
    FULL_SPECTRUM = "full-spectrum"
    ORBIT = "orbit"


ANALYSIS_PREFIX: Final = "analyses/"
RESULT_PATHS: Final = (*RecordedResult, *(f"{ANALYSIS_PREFIX}{kind}" for kind in KINDS))
EXPORT_SUFFIXES: Final = tuple(suffix.removeprefix(".") for suffix in EXPORT_FORMATS)


def one_of(values: Sequence[str]) -> AfterValidator:
    """Return a validator that accepts only these values."""

    def check(value: str) -> str:
        if value not in values:
            raise ValueError(f"{value!r}: expected one of {', '.join(values)}")
        return value

    return AfterValidator(check)


def choice_schema(values: Sequence[str]) -> WithJsonSchema:
    """Return the JSON schema of a choice of these values."""
    return WithJsonSchema({"type": "string", "enum": list(values)})


ResultPath: TypeAlias = Annotated[str, one_of(RESULT_PATHS), choice_schema(RESULT_PATHS)]
ExportFormat: TypeAlias = Annotated[str, one_of(EXPORT_SUFFIXES), choice_schema(EXPORT_SUFFIXES)]


class ExportContent(StrEnum):
    """Exported content."""

    SAMPLES = "samples"
    RESULTS = "results"
    PULSES = "pulses"


class ResultRequest(Schema):
    """Compute a result of a run without the time limit of its route."""

    kind: Literal["result"]
    run: RunId
    path: ResultPath = Field(description="Path of the result below `/api/v1/runs/{run}/`", examples=["cascade"])
    parameters: dict[str, ParameterValue] = Field(
        default_factory=dict, description="Query parameters of the path, by name", examples=[{"rows": 100}]
    )


class ReanalysisRequest(Schema):
    """Analyse a run's samples again, optionally with corrected calibrations; the recording is not changed."""

    kind: Literal["reanalysis"]
    run: RunId
    calibrations: dict[str, Annotated[CalibrationRecord, BeforeValidator(validate_as_file(CalibrationRecord))]] = Field(
        default_factory=dict,
        description="By name of the probe's channel, each with the content of a calibration file",
        examples=[{}],
    )


class PredictionRequest(Schema):
    """Compute the model over speed for a run's rig, optionally with changed parameters."""

    kind: Literal["prediction"]
    run: RunId
    imbalance_kg_m: Annotated[float, Field(strict=True, ge=0, le=1)] | None = Field(
        None, description="First imbalance, kg m", examples=[5e-7]
    )
    viscosity_pa_s: Annotated[float, Field(strict=True, gt=0, le=10)] | None = Field(
        None, description="Dynamic viscosity of the oil in both films, Pa s", examples=[0.012]
    )
    inner_clearance_um: Annotated[float, Field(strict=True, gt=0, le=1000)] | None = Field(
        None, description="Radial clearance of the inner film, µm", examples=[30.0]
    )
    outer_clearance_um: Annotated[float, Field(strict=True, gt=0, le=1000)] | None = Field(
        None, description="Radial clearance of the outer film, µm", examples=[70.0]
    )


class ExportRequest(Schema):
    """Export a run, or a part of it, in a format of another program."""

    kind: Literal["export"]
    run: RunId
    format: ExportFormat = Field(description="Format of the file", examples=["csv"])
    content: ExportContent = Field(
        ExportContent.SAMPLES,
        description="Samples in µm and V, results over time, or the tacho edges' counter timestamps",
        examples=["results"],
    )
    segment: Annotated[int, Field(strict=True, ge=0, le=1_000_000)] | None = Field(
        None, description="Index of the gap-free segment; null: the only one", examples=[0]
    )
    from_s: Annotated[float, Field(strict=True, ge=0, le=MAX_TIME)] = Field(
        0.0, description="Start time in the segment, s", examples=[0.0]
    )
    until_s: Annotated[float, Field(strict=True, gt=0, le=MAX_TIME)] | None = Field(
        None, description="End time in the segment, s; null: its end", examples=[0.5]
    )


class VerificationRequest(Schema):
    """Verify a recording's whole file and store the verdict."""

    kind: Literal["verification"]
    run: RunId


class RecoveryRequest(Schema):
    """Copy all intact data of a damaged recording into a new run, RUN-recovered."""

    kind: Literal["recovery"]
    run: RunId


class IndexRequest(Schema):
    """Update the catalogue from the files, and summarise runs that have no summary yet."""

    kind: Literal["index"]
    verify: bool = Field(
        False, strict=True, description="Whether to verify files that have not been verified yet", examples=[False]
    )


RunJobRequest: TypeAlias = (
    ResultRequest | ReanalysisRequest | PredictionRequest | ExportRequest | VerificationRequest | RecoveryRequest
)
JobRequest: TypeAlias = Annotated[
    RunJobRequest | IndexRequest | ImportRequest | StudyRequest, Field(discriminator="kind")
]


class JobSchema(Schema):
    """State of a job."""

    job: str = Field(description="Its id", examples=["9f3c0f6e2d1b4a57"])
    kind: str = Field(description="Kind of job", examples=["export"])
    description: str = Field(
        description="Description in words", examples=["samples of 2026-11-24T09-12-07-gj90c as csv"]
    )
    run: str | None = Field(
        description="Id of its run; null if it concerns none", examples=["2026-11-24T09-12-07-gj90c"]
    )
    state: JobState = Field(description="State", examples=["running"])
    progress: float | None = Field(
        description="Completed fraction of the current step, 0 to 1; null if unknown",
        ge=0, le=1, examples=[0.42],
    )  # fmt: skip
    step: str = Field(description="Current step; empty before the start", examples=["reading samples"])
    detail: str = Field(description="Why it failed; empty if it has not", examples=[""])
    created_at: datetime = Field(description="Time of the request, UTC", examples=["2026-11-24T10:00:00Z"])
    started_at: datetime | None = Field(
        description="Start time, UTC; null if not started", examples=["2026-11-24T10:00:01Z"]
    )
    ended_at: datetime | None = Field(description="End time, UTC; null if not ended", examples=[None])
    events: str = Field(
        description="URL of its progress as server-sent events", examples=[f"{JOBS}/9f3c0f6e2d1b4a57/events"]
    )
    result: str | None = Field(
        description="URL of its result; null until it is done", examples=[f"{JOBS}/9f3c0f6e2d1b4a57/result"]
    )


class JobListSchema(Schema):
    """All jobs."""

    jobs: tuple[JobSchema, ...] = Field(description="Newest first")


class PredictionMapSchema(Schema):
    """The model's prediction over speed."""

    run: RunId
    by_speed: tuple[PredictedVibrationSchema, ...] = Field(
        description="In ascending order of speed, about every 250 r/min"
    )


def job_schema(job: Job) -> JobSchema:
    """Return the schema of a job."""
    location = f"{JOBS}/{job.id}"
    return JobSchema(
        job=job.id,
        kind=job.task.kind,
        description=job.task.description,
        run=job.task.run or None,
        state=job.state,
        progress=job.progress.fraction,
        step=job.progress.step,
        detail=job.error,
        created_at=_utc(job.submitted),
        started_at=_utc(job.started) if job.started else None,
        ended_at=_utc(job.ended) if job.ended else None,
        events=f"{location}/events",
        result=f"{location}/result" if job.result is not None else None,
    )


def _utc(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
