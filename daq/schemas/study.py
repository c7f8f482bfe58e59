"""Schemas of model studies: requests and the resulting table, as in `rig model … --json`."""

import math
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from daq.schemas.runs import RunId
from daq.schemas.units import Schema
from model.studies.study import Cell, Study

MAX_POINTS = 2000
MAX_SPEED = 1e6  # rad/s
MAX_STIFFNESS = 1e15  # N/m

Count = Annotated[int, Field(strict=True, ge=1, le=100, examples=[10])]
Station = Annotated[
    int | None,
    Field(
        strict=True,
        ge=1,
        le=1000,
        description="Station of the shaft to report; null: the station of the probes",
        examples=[1],
    ),
]
SpringStiffness = Annotated[float, Field(strict=True, gt=0, le=MAX_STIFFNESS)]
SPRINGS = "Stiffness of a spring at each journal in place of the film, N/m; null: "


class Speeds(Schema):
    """Evenly spaced rising shaft speeds, both ends included."""

    from_rad_s: Annotated[float, Field(strict=True, ge=0, le=MAX_SPEED)] = Field(
        description="Lowest, rad/s", examples=[100.0]
    )
    to_rad_s: Annotated[float, Field(strict=True, gt=0, le=MAX_SPEED)] = Field(
        description="Highest, rad/s", examples=[4000.0]
    )
    count: Annotated[int, Field(strict=True, ge=2, le=MAX_POINTS)] = Field(
        description="Number of speeds", examples=[79]
    )

    @model_validator(mode="after")
    def _check_rising(self) -> Self:
        if self.to_rad_s <= self.from_rad_s:
            raise ValueError(f"to_rad_s {self.to_rad_s:g}, expected more than from_rad_s {self.from_rad_s:g}")
        return self


class TurningSpeeds(Speeds):
    """Evenly spaced rising shaft speeds above zero, both ends included."""

    from_rad_s: Annotated[float, Field(strict=True, gt=0, le=MAX_SPEED)] = Field(
        description="Lowest, rad/s", examples=[100.0]
    )


class Stiffnesses(Schema):
    """Geometrically spaced rising stiffnesses, both ends included."""

    from_n_m: SpringStiffness = Field(description="Lowest, N/m", examples=[1e3])
    to_n_m: SpringStiffness = Field(description="Highest, N/m", examples=[1e10])
    count: Annotated[int, Field(strict=True, ge=2, le=MAX_POINTS)] = Field(
        description="Number of stiffnesses", examples=[71]
    )

    @model_validator(mode="after")
    def _check_rising(self) -> Self:
        if self.to_n_m <= self.from_n_m:
            raise ValueError(f"to_n_m {self.to_n_m:g}, expected more than from_n_m {self.from_n_m:g}")
        return self


CAMPBELL_SPEEDS = Speeds(from_rad_s=0.0, to_rad_s=8000.0, count=81)
THESIS_SPEEDS = TurningSpeeds(from_rad_s=100.0, to_rad_s=4000.0, count=79)
ALL_STIFFNESSES = Stiffnesses(from_n_m=1e3, to_n_m=1e10, count=71)


class RotorStudyRequest(Schema):
    """Base of the study requests: selects the rotor."""

    run: RunId | None = Field(
        None, description="Run whose rotor is studied; null: the GJ90C of the thesis", examples=[None]
    )


class ModesRequest(RotorStudyRequest):
    """Natural frequencies and mode shapes, free or on springs: `rig model modes`."""

    kind: Literal["modes"]
    stiffness_n_m: SpringStiffness | None = Field(
        None, description=f"{SPRINGS}free, or on the rotor's own supports", examples=[1e7]
    )
    speed_rad_s: Annotated[float, Field(strict=True, ge=0, le=MAX_SPEED)] = Field(
        0.0, description="Shaft speed, rad/s", examples=[1000.0]
    )
    count: Count = Field(10, description="Number of modes")


class CampbellRequest(RotorStudyRequest):
    """Campbell diagram with critical speeds: `rig model campbell`."""

    kind: Literal["campbell"]
    stiffness_n_m: SpringStiffness | None = Field(
        None, description=f"{SPRINGS}none on supports that hold the rotor, else 10,000", examples=[1e7]
    )
    speeds: Speeds = Field(CAMPBELL_SPEEDS, description="Shaft speed, rad/s", examples=[CAMPBELL_SPEEDS.model_dump()])
    count: Count = Field(10, description="Number of branches, forward and backward")


class CriticalSpeedsRequest(RotorStudyRequest):
    """Undamped critical speeds over bearing stiffness: `rig model critical`."""

    kind: Literal["critical"]
    stiffnesses: Stiffnesses = Field(
        ALL_STIFFNESSES, description="Stiffness of each bearing, N/m", examples=[ALL_STIFFNESSES.model_dump()]
    )
    highest_rad_s: Annotated[float, Field(strict=True, gt=0, le=MAX_SPEED)] = Field(
        2e5, description="Highest speed searched, rad/s", examples=[2e5]
    )


class ResponseRequest(RotorStudyRequest):
    """1X response over speed: run-up and run-down on the oil films, or linear on springs: `rig model response`."""

    kind: Literal["response"]
    stiffness_n_m: SpringStiffness | None = Field(None, description=f"{SPRINGS}on the films", examples=[1e7])
    speeds: TurningSpeeds = Field(
        THESIS_SPEEDS, description="Shaft speed, rad/s", examples=[THESIS_SPEEDS.model_dump()]
    )
    station: Station = None


class InstabilityOnsetRequest(RotorStudyRequest):
    """Onset speed of instability: growth rate of the least stable whirl over speed: `rig model onset`."""

    kind: Literal["onset"]
    speeds: TurningSpeeds = Field(
        THESIS_SPEEDS, description="Shaft speed, rad/s", examples=[THESIS_SPEEDS.model_dump()]
    )


StudyRequest: TypeAlias = (
    ModesRequest | CampbellRequest | CriticalSpeedsRequest | ResponseRequest | InstabilityOnsetRequest
)


class StudySchema(Schema):
    """Result of a study: the unrounded table of `rig model … --json`."""

    title: str = Field(description="Title of the study", examples=["Campbell diagram, springs of 1e+04 N/m"])
    rows: tuple[dict[str, float | str | None], ...] = Field(
        description="Rows of the table; names carry units, null where a value is undefined",
        examples=[[{"speed_rad_s": 100.0, "branch_1_hz": -19.5}]],
    )
    remarks: tuple[str, ...] = Field(description="Notes on reading the table", examples=[[]])


def study_schema(study: Study) -> StudySchema:
    """Return the schema of a study."""
    rows = tuple({name: _plain(cell) for name, cell in row.items()} for row in study.rows())
    return StudySchema(title=study.title, rows=rows, remarks=study.remarks)


def _plain(cell: Cell) -> Cell | None:
    return cell if isinstance(cell, str) or math.isfinite(cell) else None
