"""Jobs: what is to be done, and how it stands."""

from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, Field

from daq.config.calibration import CalibrationRecord
from daq.reports.parameters import MAX_TIME
from daq.schemas.live import PredictedVibrationSchema
from daq.schemas.runs import RunId
from daq.schemas.study import StudyRequest
from daq.schemas.units import Schema
from daq.service.jobs.queue import Job, JobState
from daq.service.schemas.importing import ImportRequest, as_a_file

JOBS = "/api/v1/jobs"

Parameter: TypeAlias = str | float | bool | None


class ResultPath(StrEnum):
    """The last part of the address of a run's results."""

    SUMMARY = "summary"
    ORDER_VECTORS = "order-vectors"
    FINDINGS = "findings"
    TREND = "trend"
    CASCADE = "cascade"
    WATERFALL = "waterfall"
    ORDER_SPECTRUM = "order-spectrum"
    FULL_SPECTRUM = "full-spectrum"
    ORBIT = "orbit"
    ANALYSES_ORDER_SPECTRUM = "analyses/order-spectrum"
    ANALYSES_FULL_SPECTRUM = "analyses/full-spectrum"
    ANALYSES_FREQUENCY_SPECTRUM = "analyses/frequency-spectrum"
    ANALYSES_CASCADE = "analyses/cascade"
    ANALYSES_WATERFALL = "analyses/waterfall"
    ANALYSES_BODE = "analyses/bode"
    ANALYSES_POLAR = "analyses/polar"
    ANALYSES_ORBIT = "analyses/orbit"
    ANALYSES_CENTRELINE = "analyses/centreline"
    ANALYSES_ENVELOPES = "analyses/envelopes"
    ANALYSES_WAVEFORMS = "analyses/waveforms"
    ANALYSES_AVERAGE = "analyses/average"
    ANALYSES_POINCARE = "analyses/poincare"
    ANALYSES_BIFURCATION = "analyses/bifurcation"
    ANALYSES_SUB_SYNCHRONOUS = "analyses/sub-synchronous"
    ANALYSES_OVERALL = "analyses/overall"
    ANALYSES_SLOW_ROLL = "analyses/slow-roll"


class ExportFormat(StrEnum):
    """Form of an exported file."""

    CSV = "csv"
    PARQUET = "parquet"
    HDF5 = "h5"
    TDMS = "tdms"
    MATLAB = "mat"
    UFF = "uff"


class ExportContent(StrEnum):
    """What is exported."""

    SAMPLES = "samples"
    RESULTS = "results"
    PULSES = "pulses"


class ResultRequest(Schema):
    """Make the answer of a run's address, without the time limit that it has."""

    kind: Literal["result"]
    run: RunId
    path: ResultPath = Field(description="Last part of the URL", examples=["cascade"])
    parameters: dict[str, Parameter] = Field(
        default_factory=dict, description="Its parameters, by name", examples=[{"rows": 100}]
    )


class ReanalysisRequest(Schema):
    """Analyse a run's samples anew, with corrected calibrations where some are given; the recording stays as it is."""

    kind: Literal["analysis"]
    run: RunId
    calibrations: dict[str, Annotated[CalibrationRecord, BeforeValidator(as_a_file(CalibrationRecord))]] = Field(
        default_factory=dict,
        description="By the name of the probe's channel, each in the form of a calibration file",
        examples=[{}],
    )


class PredictionRequest(Schema):
    """Compute the model over speed for a run's rig, with other parameters where some are given."""

    kind: Literal["prediction"]
    run: RunId
    imbalance_kg_m: Annotated[float, Field(strict=True, ge=0, le=1)] | None = Field(
        None, description="Of the first imbalance, kg m", examples=[5e-7]
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
    """Write a run, or a part of it, in the form of another program."""

    kind: Literal["export"]
    run: RunId
    format: ExportFormat = Field(description="Form of the file", examples=["csv"])
    content: ExportContent = Field(
        ExportContent.SAMPLES,
        description="Samples in µm and V, results over time, or the tacho's edges as a counter stamped them",
        examples=["results"],
    )
    segment: Annotated[int, Field(strict=True, ge=0, le=1_000_000)] | None = Field(
        None, description="Which gap-free stretch, where there are several", examples=[0]
    )
    from_s: Annotated[float, Field(strict=True, ge=0, le=MAX_TIME)] = Field(
        0.0, description="Time in it, s", examples=[0.0]
    )
    until_s: Annotated[float, Field(strict=True, gt=0, le=MAX_TIME)] | None = Field(
        None, description="Time in it, s; null: to its end", examples=[0.5]
    )


class VerificationRequest(Schema):
    """Look through a recording's whole file and keep the verdict."""

    kind: Literal["verification"]
    run: RunId


class RecoveryRequest(Schema):
    """Copy all that is intact of a damaged recording into a run of its own, RUN-recovered."""

    kind: Literal["recovery"]
    run: RunId


class IndexRequest(Schema):
    """Bring the catalogue up to date with the files, and sum up the runs that have not been."""

    kind: Literal["index"]
    verify: bool = Field(
        False, strict=True, description="Whether files are verified too that have not been", examples=[False]
    )


RunJobRequest: TypeAlias = (
    ResultRequest | ReanalysisRequest | PredictionRequest | ExportRequest | VerificationRequest | RecoveryRequest
)
JobRequest: TypeAlias = Annotated[
    RunJobRequest | IndexRequest | ImportRequest | StudyRequest, Field(discriminator="kind")
]


class JobSchema(Schema):
    """A job as it stands."""

    job: str = Field(description="Its id", examples=["9f3c0f6e2d1b4a57"])
    kind: str = Field(description="What kind of work it is", examples=["export"])
    description: str = Field(
        description="What it does, in words", examples=["samples of 2026-11-24T09-12-07-gj90c as csv"]
    )
    run: str | None = Field(description="Id of the run that it is about; null where it is about none")
    state: JobState = Field(description="How it stands", examples=["running"])
    progress: float | None = Field(
        description="What part of what it does now is done, 0 to 1; null where that cannot be told",
        ge=0, le=1, examples=[0.42],
    )  # fmt: skip
    step: str = Field(description="What it does now; empty before it begins", examples=["reading samples"])
    detail: str = Field(description="Why it failed; empty where it has not", examples=[""])
    created_at: datetime = Field(description="When it was asked for, UTC", examples=["2026-11-24T10:00:00Z"])
    started_at: datetime | None = Field(description="When it began, UTC", examples=["2026-11-24T10:00:01Z"])
    ended_at: datetime | None = Field(description="When it ended, UTC", examples=[None])
    events: str = Field(
        description="Address of its progress as server-sent events", examples=[f"{JOBS}/9f3c0f6e2d1b4a57/events"]
    )
    result: str | None = Field(
        description="Address of its result; null until it is done", examples=[f"{JOBS}/9f3c0f6e2d1b4a57/result"]
    )


class JobListSchema(Schema):
    """All jobs that are known."""

    jobs: tuple[JobSchema, ...] = Field(description="The one asked for last first")


class PredictionMapSchema(Schema):
    """The model over speed."""

    run: RunId
    by_speed: tuple[PredictedVibrationSchema, ...] = Field(
        description="In rising order of speed, about every 250 r/min"
    )


def job_schema(job: Job) -> JobSchema:
    """Return a job as a document."""
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
        created_at=_clock(job.submitted),
        started_at=_clock(job.started) if job.started else None,
        ended_at=_clock(job.ended) if job.ended else None,
        events=f"{location}/events",
        result=f"{location}/result" if job.result is not None else None,
    )


def _clock(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
