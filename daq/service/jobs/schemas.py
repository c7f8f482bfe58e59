"""Request and response schemas of jobs."""

import json
from collections.abc import Callable, Collection, Mapping
from datetime import datetime
from enum import StrEnum
from functools import partial
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError, WithJsonSchema
from pydantic_core import ErrorDetails

from daq.config.calibration import CalibrationRecord
from daq.config.import_mapping import ChannelMapping
from daq.reports.parameters import (
    MAX_TIME,
    QueryParameters,
    TrendQuery,
)
from daq.reports.registry import KINDS
from daq.schemas.live import PredictedVibrationSchema
from daq.schemas.runs import RunId
from daq.schemas.study import StudyRequest
from daq.schemas.units import Schema
from daq.service.results_reader import ANALYSIS_PREFIX
from recordings.exchange.formats import EXPORT_FORMATS

JOBS = "/api/v1/jobs"

ParameterValue: TypeAlias = str | float | bool | None

RESULT_QUERIES: Final[Mapping[str, type[QueryParameters]]] = {
    "summary": QueryParameters,
    "findings": QueryParameters,
    "trend": TrendQuery,
    **{f"{ANALYSIS_PREFIX}{name}": kind.parameters for name, kind in KINDS.items()},
}
"""Results by their path below `/api/v1/runs/{run}/`, with the query parameters of each."""
EXPORT_SUFFIXES: Final = tuple(suffix.removeprefix(".") for suffix in EXPORT_FORMATS)


def _require_one_of(values: Collection[str], value: str) -> str:
    """Return a value; ValueError unless it is one of these."""
    if value not in values:
        raise ValueError(f"{value!r}: expected one of {', '.join(values)}")
    return value


ResultPath: TypeAlias = Annotated[
    str,
    AfterValidator(partial(_require_one_of, RESULT_QUERIES)),
    WithJsonSchema({"type": "string", "enum": list(RESULT_QUERIES)}),
]
ExportFormat: TypeAlias = Annotated[
    str,
    AfterValidator(partial(_require_one_of, EXPORT_SUFFIXES)),
    WithJsonSchema({"type": "string", "enum": list(EXPORT_SUFFIXES)}),
]


def validate_as_file(model: type[BaseModel]) -> Callable[[object], object]:
    """Return a validator that treats a value as the content of a file; its ValueError names every error."""

    def validate(value: object) -> object:
        try:
            return model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise ValueError("; ".join(map(_error_text, error.errors()))) from error

    return validate


def _error_text(fault: ErrorDetails) -> str:
    return f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].removeprefix('Value error, ')}"


CalibrationFile: TypeAlias = Annotated[CalibrationRecord, BeforeValidator(validate_as_file(CalibrationRecord))]


class ExportContent(StrEnum):
    """Exported content."""

    SAMPLES = "samples"
    RESULTS = "results"
    PULSES = "pulses"


class ResultRequest(Schema):
    """Compute a result of a run without the time limit of its route."""

    kind: Literal["result"]
    run: RunId
    path: ResultPath = Field(
        description="Path of the result below `/api/v1/runs/{run}/`", examples=["analyses/cascade"]
    )
    parameters: dict[str, ParameterValue] = Field(
        default_factory=dict,
        description="Query parameters of the path, by name",
        examples=[{"source": "recorded", "rows": 100}],
    )


class ReanalysisRequest(Schema):
    """Analyse a run's samples again, optionally with corrected calibrations; the recording is not changed."""

    kind: Literal["reanalysis"]
    run: RunId
    calibrations: dict[str, CalibrationFile] = Field(
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


MAX_TOML_LENGTH = 200_000  # characters


class RigFromRun(Schema):
    """The rig of a recorded run: channels, calibrations, tacho and limits at the time of recording."""

    source: Literal["run"]
    run: RunId


class RigFromToml(Schema):
    """A rig as TOML text; files that the text names are not read."""

    source: Literal["toml"]
    toml: str = Field(description="Content of a rig.toml", max_length=MAX_TOML_LENGTH, examples=['rig = "gj90c"\n…'])
    calibrations: dict[str, CalibrationFile] = Field(
        default_factory=dict,
        description="By name of the probe's channel, each with the content of a calibration file; they replace the "
        "files that the text names",
        examples=[{}],
    )


class ImportRequest(Schema):
    """Import an uploaded file as a run, as `rig import` does; the result is the run."""

    kind: Literal["import"]
    upload: str = Field(description="Id of the upload", max_length=200, examples=["5d41402abc4b2a76"])
    rig: Annotated[RigFromRun | RigFromToml, Field(discriminator="source")] = Field(
        description="The rig that the channels belong to",
        examples=[{"source": "run", "run": "2026-11-24T09-12-07-gj90c"}],
    )
    mapping: Annotated[ChannelMapping, BeforeValidator(validate_as_file(ChannelMapping))] = Field(
        description="Columns of the channels: the content of a mapping file of `rig import`",
        examples=[{"channel": {"x": {"source": "Kaman 1", "unit": "V"}}}],
    )


RunJobRequest: TypeAlias = (
    ResultRequest | ReanalysisRequest | PredictionRequest | ExportRequest | VerificationRequest | RecoveryRequest
)
JobRequest: TypeAlias = Annotated[
    RunJobRequest | IndexRequest | ImportRequest | StudyRequest, Field(discriminator="kind")
]


class JobState(StrEnum):
    """State of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_final(self) -> bool:
        """Whether the job has ended."""
        return self not in {JobState.WAITING, JobState.RUNNING}


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
