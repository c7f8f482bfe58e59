"""What is asked of a recorded run: the parameters of its addresses."""

from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Segment = Annotated[
    int | None, Field(description="Only in this gap-free stretch of the run, from 0", ge=0, le=1_000_000, examples=[0])
]
LONGEST = 1e7  # s
FASTEST = 1e6  # r/min


class Question(BaseModel):
    """Parameters of an address; others than these are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class At(Question):
    """A moment of a run: the recorded frame nearest to it is taken."""

    segment: Segment = None
    time_s: Annotated[
        float | None,
        Field(
            description="Sample time in the segment, s; no frame within 1 s is a 404", ge=0, le=LONGEST, examples=[98.4]
        ),
    ] = None
    speed_rpm: Annotated[
        float | None,
        Field(
            description="Shaft speed, r/min; no frame within 2 % (or 100 r/min) is a 404. With `time_s`, the frame of "
            "about this speed that is nearest to that time; without either, the frame of the largest vibration",
            gt=0,
            le=FASTEST,
            examples=[11_000.0],
        ),
    ] = None


class Speed(Question):
    """A speed."""

    speed_rpm: Annotated[float, Field(description="Shaft speed, r/min", gt=0, le=FASTEST, examples=[11_000.0])]


class TrendQuery(Question):
    """A stretch of time."""

    segment: Segment = None
    from_s: Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=LONGEST, examples=[0.0])] = 0.0
    duration_s: Annotated[
        float | None, Field(description="How much of it, s; all where left out", gt=0, le=LONGEST, examples=[60.0])
    ] = None
    entries: Annotated[
        int, Field(description="At most about so many entries: the width of a screen", ge=1, le=5000, examples=[600])
    ] = 600


class PictureSize(Question):
    """The size of a picture of many spectra."""

    rows: Annotated[int, Field(description="Bins of speed or time, at most", ge=1, le=400, examples=[100])] = 100
    columns: Annotated[int, Field(description="Orders, at most", ge=1, le=1024, examples=[256])] = 256
    highest_order: Annotated[float | None, Field(description="Orders up to it", ge=0, le=1000, examples=[4.0])] = None
    full: Annotated[
        bool,
        Field(
            description="Full spectra: circles with (positive orders) and against (negative) the rotation",
            examples=[False],
        ),
    ] = False


class CascadeQuery(PictureSize):
    """Spectra over speed."""


class WaterfallQuery(PictureSize):
    """Spectra over a stretch of time."""

    segment: Annotated[int, Field(description="Gap-free stretch of the run", ge=0, le=1_000_000, examples=[0])] = 0
    from_s: Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=LONGEST, examples=[0.0])] = 0.0
    duration_s: Annotated[
        float | None, Field(description="How much of it, s; all where left out", gt=0, le=LONGEST, examples=[60.0])
    ] = None


class SampleUnit(StrEnum):
    """What samples are given as."""

    ENGINEERING = "engineering"  # µm towards the probe; V for the tacho
    VOLTS = "volts"
    CODES = "codes"


class SampleFormat(StrEnum):
    """How samples are sent."""

    JSON = "json"
    NPZ = "npz"
    ARROW = "arrow"


class SamplesQuery(Question):
    """A stretch of samples."""

    segment: Annotated[int, Field(description="Gap-free stretch of the run", ge=0, le=1_000_000, examples=[0])] = 0
    from_s: Annotated[
        float,
        Field(description="Time in the segment, s; past its end is a 404", ge=0, le=LONGEST, examples=[1.0]),
    ] = 0.0
    duration_s: Annotated[
        float,
        Field(
            description="How much, s; cut at the segment's end. JSON holds 100,000 values, npz and Arrow 6,000,000",
            gt=0,
            le=60,
            examples=[0.1],
        ),
    ] = 0.1
    unit: Annotated[
        SampleUnit,
        Field(
            description="µm at probes and V at the tacho; V; or the converter's codes",
            examples=["volts"],
        ),
    ] = SampleUnit.ENGINEERING
    format: Annotated[
        SampleFormat | None, Field(description="Before the header Accept, which else decides", examples=["json"])
    ] = None
