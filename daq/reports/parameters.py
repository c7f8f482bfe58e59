"""What can be asked of an analysis: parameters of REST and options of the command line alike.

What is asked of a recorded run: the parameters of its addresses.
"""

from enum import StrEnum
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from analysis.spectra.order_map import Scaling, Window

Segment = Annotated[
    int | None, Field(description="Only in this gap-free stretch of the run, from 0", ge=0, le=1_000_000, examples=[0])
]
MAX_TIME = 1e7  # s
MAX_SPEED_RPM = 1e6  # r/min


FromTime = Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=MAX_TIME, examples=[0.0])]


class QueryParameters(BaseModel):
    """Parameters of an address; others than these are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FrameQuery(QueryParameters):
    """A moment of a run: the recorded frame nearest to it is taken."""

    segment: Segment = None
    time_s: Annotated[
        float | None,
        Field(
            description="Sample time in the segment, s; refused where no frame is within 1 s",
            ge=0,
            le=MAX_TIME,
            examples=[98.4],
        ),
    ] = None
    speed_rpm: Annotated[
        float | None,
        Field(
            description="Shaft speed, r/min; refused where no frame is within 2 % (or 100 r/min). With `time_s`, the "
            "frame near this speed that is nearest to that time. Without either, the frame of the largest vibration",
            gt=0,
            le=MAX_SPEED_RPM,
            examples=[11_000.0],
        ),
    ] = None


class SpeedQuery(QueryParameters):
    """A speed."""

    speed_rpm: Annotated[float, Field(description="Shaft speed, r/min", gt=0, le=MAX_SPEED_RPM, examples=[11_000.0])]


class TrendQuery(QueryParameters):
    """A stretch of time."""

    segment: Segment = None
    from_s: Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=MAX_TIME, examples=[0.0])] = (
        0.0
    )
    duration_s: Annotated[
        float | None, Field(description="How much of it, s; all where left out", gt=0, le=MAX_TIME, examples=[60.0])
    ] = None
    entries: Annotated[
        int, Field(description="At most about so many entries: the width of a screen", ge=1, le=5000, examples=[600])
    ] = 600


class SpectrumMapQuery(QueryParameters):
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


class RecordedCascadeQuery(SpectrumMapQuery):
    """Spectra over speed."""


class RecordedWaterfallQuery(SpectrumMapQuery):
    """Spectra over a stretch of time."""

    segment: Annotated[int, Field(description="Gap-free stretch of the run", ge=0, le=1_000_000, examples=[0])] = 0
    from_s: Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=MAX_TIME, examples=[0.0])] = (
        0.0
    )
    duration_s: Annotated[
        float | None, Field(description="How much of it, s; all where left out", gt=0, le=MAX_TIME, examples=[60.0])
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


class SamplesQuery(QueryParameters):
    """A stretch of samples."""

    segment: Annotated[int, Field(description="Gap-free stretch of the run", ge=0, le=1_000_000, examples=[0])] = 0
    from_s: Annotated[
        float,
        Field(description="Time in the segment, s; refused past its end", ge=0, le=MAX_TIME, examples=[1.0]),
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


MAX_ORDERS: Final = 6
MIN_BANDWIDTH: Final = 0.001  # Hz, or per cent
ORDER = r"\d{1,2}(\.\d{1,4})?"
ORDERS: Final = rf"^{ORDER}(,{ORDER}){{0,{MAX_ORDERS - 1}}}$"

Order = Annotated[float, Field(description="Frequency over the shaft's", ge=0.05, le=100, examples=[1.0])]
Revolutions = Annotated[
    int, Field(description="Whole revolutions in a spectrum: lines lie 1 / so many orders apart", ge=8, le=256)
]
HighestOrder = Annotated[float, Field(description="Orders up to it", ge=1, le=100, examples=[8.0])]
Width = Annotated[float, Field(description="Width of a bin of speed, r/min", ge=1, le=MAX_SPEED_RPM, examples=[100.0])]


class AnalysisForm(StrEnum):
    """How an analysis is sent: numbers, or drawn."""

    JSON = "json"
    NPZ = "npz"
    ARROW = "arrow"
    SVG = "svg"
    PNG = "png"


class MapLines(StrEnum):
    """What the lines of many spectra are."""

    ORDERS = "orders"  # the larger of the two probes
    FULL = "full"  # circles with and against the rotation
    FREQUENCIES = "frequencies"


class AnalysisQuery(QueryParameters):
    """What every analysis may be asked for."""

    format: Annotated[
        AnalysisForm | None, Field(description="Before the header Accept, which else decides", examples=["json"])
    ] = None


class ShaftAngleQuery(AnalysisQuery):
    """What everything that needs the shaft's angle may be asked for."""

    slow_roll_rpm: Annotated[
        float | None,
        Field(
            description="Take off the run-out that the run's own revolutions up to this speed tell, r/min; what is "
            "left is called compensated",
            gt=0, le=MAX_SPEED_RPM, examples=[None],
        ),
    ] = None  # fmt: skip


class TimeIntervalQuery(AnalysisQuery):
    """A stretch of time."""

    segment: Segment = None
    from_s: Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=MAX_TIME, examples=[0.0])] = (
        0.0
    )
    duration_s: Annotated[
        float | None, Field(description="How much of it, s; all where left out", gt=0, le=MAX_TIME, examples=[None])
    ] = None


class ShaftAngleIntervalQuery(TimeIntervalQuery, ShaftAngleQuery):
    """A stretch of time, against the shaft's angle."""


class FrameAnalysisQuery(FrameQuery, ShaftAngleQuery):
    """A moment of a run: what comes before the recorded frame that is nearest is looked at."""


class OrderSpectrumQuery(FrameAnalysisQuery):
    """An order spectrum."""

    revolutions: Revolutions = 16
    highest_order: HighestOrder = 8.0
    window: Annotated[
        Window,
        Field(description="hann tells lines apart, flat top reads any line to 0.1 %, uniform whole orders alone"),
    ] = Window.HANN
    scaling: Annotated[Scaling, Field(description="What amplitudes are given as")] = Scaling.PEAK


class FullSpectrumQuery(FrameAnalysisQuery):
    """A full spectrum."""

    revolutions: Revolutions = 16
    highest_order: HighestOrder = 8.0


class FrequencySpectrumQuery(TimeIntervalQuery):
    """A frequency spectrum, averaged over a stretch of time; it needs no tacho."""

    resolution_hz: Annotated[float, Field(description="Distance of the lines, Hz", ge=0.1, le=1000, examples=[2.0])] = (
        2.0
    )
    highest_hz: Annotated[float, Field(description="MapLines up to it, Hz", ge=1, le=1e6, examples=[2000.0])] = 2000.0


class OrbitFilter(StrEnum):
    """What an orbit is made of."""

    DIRECT = "direct"  # everything
    ORDERS = "orders"  # the orders that are named alone
    REST = "rest"  # all but those: not-1X


class OrbitQuery(FrameAnalysisQuery):
    """An orbit."""

    filter: Annotated[
        OrbitFilter,
        Field(
            description="direct: as it is; orders: those of `orders` alone (1X, 2X, nX); rest: all but them (not-1X)"
        ),
    ] = OrbitFilter.DIRECT
    orders: Annotated[str, Field(description="Orders with commas", pattern=ORDERS, examples=["1", "1,2"])] = "1"
    revolutions: Annotated[int, Field(description="Revolutions that are drawn", ge=1, le=64)] = 4


class AverageQuery(FrameAnalysisQuery):
    """The mean revolution, and what does not repeat."""

    revolutions: Annotated[int, Field(description="Revolutions that are averaged", ge=8, le=1024)] = 64


class PoincareQuery(FrameAnalysisQuery):
    """Where the shaft is each time the mark passes."""

    revolutions: Annotated[int, Field(description="Revolutions, of which each gives a point", ge=48, le=4096)] = 128


class SlowRollQuery(AnalysisQuery):
    """The run-out that slow turning tells."""

    segment: Segment = None
    slow_roll_rpm: Annotated[
        float,
        Field(description="Highest speed of the slow roll, r/min", gt=0, le=MAX_SPEED_RPM, examples=[1500.0]),
    ] = 1500.0


class MapQuery(ShaftAngleIntervalQuery):
    """Many spectra."""

    lines: Annotated[
        MapLines,
        Field(description="orders: the larger of the probes; full: circles with and against the rotation; frequencies"),
    ] = MapLines.ORDERS
    revolutions: Revolutions = 16
    highest_order: HighestOrder = 4.0
    resolution_hz: Annotated[
        float, Field(description="Distance of the lines of frequency, Hz", ge=0.5, le=1000, examples=[4.0])
    ] = 4.0
    highest_hz: Annotated[float, Field(description="MapLines of frequency up to it, Hz", ge=1, le=1e6)] = 1000.0


class CascadeQuery(MapQuery):
    """Spectra over speed."""

    width_rpm: Width = 200.0


class WaterfallQuery(MapQuery):
    """Spectra over time."""

    rows: Annotated[int, Field(description="Bins of time, at most", ge=1, le=400)] = 100


class VectorsQuery(ShaftAngleIntervalQuery):
    """Vectors of one order over speed."""

    order: Order = 1.0
    width_rpm: Width = 100.0
    revolutions: Revolutions = 16


class BifurcationQuery(ShaftAngleIntervalQuery):
    """Positions at the mark over speed."""

    averaging_revolutions: Annotated[
        int, Field(description="Revolutions about each whose mean position is taken off", ge=2, le=1024)
    ] = 64


class CentrelineQuery(ShaftAngleIntervalQuery):
    """Mean positions of the shaft within its clearance."""

    revolutions: Annotated[int, Field(description="Revolutions that are averaged for each position", ge=2, le=1024)] = (
        16
    )
    rest_x_um: Annotated[
        float | None,
        Field(
            description="Displacement towards probe x while the shaft lay still at the bottom, µm; left out: the mean "
            "of the slowest revolutions is taken to lie there",
            ge=-1e5, le=1e5, examples=[None],
        ),
    ] = None  # fmt: skip
    rest_y_um: Annotated[
        float | None, Field(description="The same towards probe y, µm", ge=-1e5, le=1e5, examples=[None])
    ] = None


class SubSynchronousQuery(ShaftAngleIntervalQuery):
    """Every component below 1X."""

    revolutions: Revolutions = 16


class OverallQuery(TimeIntervalQuery):
    """Overall vibration over time; it needs no tacho."""

    interval_s: Annotated[
        float, Field(description="Of which each tells one peak-to-peak, s; a turn at least", ge=0.001, le=60)
    ] = 0.1


class EnvelopesQuery(TimeIntervalQuery):
    """Orders as they swell and fade, by the Vold-Kalman filter of the second generation."""

    orders: Annotated[
        str, Field(description="Orders with commas, solved for together", pattern=ORDERS, examples=["1,2", "0.49,1,2"])
    ] = "1,2"
    bandwidth_hz: Annotated[
        float | None,
        Field(description="Full width at half power, Hz; default 4", ge=MIN_BANDWIDTH, le=1000),
    ] = None
    bandwidth_percent: Annotated[
        float | None,
        Field(description="Instead: in per cent of each order's frequency", ge=MIN_BANDWIDTH, le=100, examples=[None]),
    ] = None
    entries: Annotated[int, Field(description="At most so many times, evenly", ge=2, le=20_000)] = 600


class WaveformsQuery(FrameQuery, AnalysisQuery):
    """Waveforms of single orders."""

    orders: Annotated[
        str, Field(description="Orders with commas, solved for together", pattern=ORDERS, examples=["1,2", "0.49,1,2"])
    ] = "1,2"
    bandwidth_hz: Annotated[float, Field(description="Full width at half power, Hz", ge=MIN_BANDWIDTH, le=1000)] = 4.0
    revolutions: Annotated[int, Field(description="Revolutions that are drawn", ge=1, le=64)] = 4
