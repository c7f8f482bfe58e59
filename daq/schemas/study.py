"""Studies of the model: what is to be computed, and the table that comes of it, as `rig model … --json` gives it."""

import math
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from daq.schemas.runs import RunId
from daq.schemas.units import Schema
from model.studies.study import Cell, Study

MOST_SPEEDS = 2000
FASTEST = 1e6  # rad/s
STIFFEST = 1e15  # N/m

Count = Annotated[int, Field(strict=True, ge=1, le=100, examples=[10])]
Station = Annotated[
    int | None, Field(strict=True, ge=1, le=1000, description="That is looked at; null: the probes'", examples=[1])
]
SpringStiffness = Annotated[float, Field(strict=True, gt=0, le=STIFFEST)]
SPRINGS = "Of a spring at each journal in the film's place, N/m; null: "


class Speeds(Schema):
    """Evenly spaced speeds of the shaft, both ends with them; they rise."""

    from_rad_s: Annotated[float, Field(strict=True, ge=0, le=FASTEST)] = Field(
        description="Lowest, rad/s", examples=[100.0]
    )
    to_rad_s: Annotated[float, Field(strict=True, gt=0, le=FASTEST)] = Field(
        description="Highest, rad/s", examples=[4000.0]
    )
    count: Annotated[int, Field(strict=True, ge=2, le=MOST_SPEEDS)] = Field(description="How many", examples=[79])

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.to_rad_s <= self.from_rad_s:
            raise ValueError(f"to_rad_s {self.to_rad_s:g}, expected more than from_rad_s {self.from_rad_s:g}")
        return self


class TurningSpeeds(Speeds):
    """Evenly spaced speeds of a shaft that turns, both ends with them; they rise."""

    from_rad_s: Annotated[float, Field(strict=True, gt=0, le=FASTEST)] = Field(
        description="Lowest, rad/s", examples=[100.0]
    )


class Stiffnesses(Schema):
    """Stiffnesses of equal ratio, both ends with them; they rise."""

    from_n_m: SpringStiffness = Field(description="Lowest, N/m", examples=[1e3])
    to_n_m: SpringStiffness = Field(description="Highest, N/m", examples=[1e10])
    count: Annotated[int, Field(strict=True, ge=2, le=MOST_SPEEDS)] = Field(description="How many", examples=[71])

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.to_n_m <= self.from_n_m:
            raise ValueError(f"to_n_m {self.to_n_m:g}, expected more than from_n_m {self.from_n_m:g}")
        return self


CAMPBELL_SPEEDS = Speeds(from_rad_s=0.0, to_rad_s=8000.0, count=81)
THESIS_SPEEDS = TurningSpeeds(from_rad_s=100.0, to_rad_s=4000.0, count=79)
ALL_STIFFNESSES = Stiffnesses(from_n_m=1e3, to_n_m=1e10, count=71)


class RotorStudyRequest(Schema):
    """Of which rotor a study is."""

    run: RunId | None = Field(
        None, description="A run whose rig's rotor it is; null: the thesis's GJ90C", examples=[None]
    )


class ModesRequest(RotorStudyRequest):
    """Natural frequencies and mode shapes, free or on springs: `rig model modes`."""

    kind: Literal["modes"]
    stiffness_n_m: SpringStiffness | None = Field(
        None, description=f"{SPRINGS}free, or on the rotor's own supports", examples=[1e7]
    )
    speed_rad_s: Annotated[float, Field(strict=True, ge=0, le=FASTEST)] = Field(
        0.0, description="Of the shaft, rad/s", examples=[1000.0]
    )
    count: Count = Field(10, description="How many modes")


class CampbellRequest(RotorStudyRequest):
    """Natural frequencies over speed, each mode followed, and critical speeds: `rig model campbell`."""

    kind: Literal["campbell"]
    stiffness_n_m: SpringStiffness | None = Field(
        None, description=f"{SPRINGS}none on supports that hold the rotor, else 10,000", examples=[1e7]
    )
    speeds: Speeds = Field(CAMPBELL_SPEEDS, description="Of the shaft, rad/s", examples=[CAMPBELL_SPEEDS.model_dump()])
    count: Count = Field(10, description="How many branches, both senses")


class CriticalSpeedsRequest(RotorStudyRequest):
    """Undamped critical speeds over the stiffness of the bearings: `rig model critical`."""

    kind: Literal["critical"]
    stiffnesses: Stiffnesses = Field(
        ALL_STIFFNESSES, description="Of each bearing, N/m", examples=[ALL_STIFFNESSES.model_dump()]
    )
    highest_rad_s: Annotated[float, Field(strict=True, gt=0, le=FASTEST)] = Field(
        2e5, description="Speeds up to it, rad/s", examples=[2e5]
    )


class ResponseRequest(RotorStudyRequest):
    """1X over speed, run-up and run-down on the films, or linear on springs: `rig model response`."""

    kind: Literal["response"]
    stiffness_n_m: SpringStiffness | None = Field(None, description=f"{SPRINGS}on the films", examples=[1e7])
    speeds: TurningSpeeds = Field(
        THESIS_SPEEDS, description="Of the shaft, rad/s", examples=[THESIS_SPEEDS.model_dump()]
    )
    station: Station = None


class InstabilityOnsetRequest(RotorStudyRequest):
    """Where the films let go: growth of the least stable whirl over speed: `rig model onset`."""

    kind: Literal["onset"]
    speeds: TurningSpeeds = Field(
        THESIS_SPEEDS, description="Of the shaft, rad/s", examples=[THESIS_SPEEDS.model_dump()]
    )


StudyRequest: TypeAlias = (
    ModesRequest | CampbellRequest | CriticalSpeedsRequest | ResponseRequest | InstabilityOnsetRequest
)


class StudySchema(Schema):
    """What came of a study: a table, the same that `rig model … --json` gives, unrounded."""

    title: str = Field(description="What was studied", examples=["Campbell diagram, springs of 1e+04 N/m"])
    rows: tuple[dict[str, float | str | None], ...] = Field(
        description="The table by rows; its names carry units, null where there is no number",
        examples=[[{"speed_rad_s": 100.0, "branch_1_hz": -19.5}]],
    )
    remarks: tuple[str, ...] = Field(description="What must be known to read the table", examples=[[]])


def study_schema(study: Study) -> StudySchema:
    """Return a study as a document."""
    rows = tuple({name: _plain(cell) for name, cell in row.items()} for row in study.rows())
    return StudySchema(title=study.title, rows=rows, remarks=study.remarks)


def _plain(cell: Cell) -> Cell | None:
    return cell if isinstance(cell, str) or math.isfinite(cell) else None
