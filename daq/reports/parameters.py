"""Query parameters of the results and analyses of a recorded run, for REST and the command line."""

from enum import StrEnum
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from analysis.signals.header import WindowName
from analysis.spectra.order_map import Scaling
from daq.reports.plots.panel import DEFAULT_DPI, DEFAULT_WIDTH, PlotStyle, Theme

Segment = Annotated[
    int | None, Field(description="Only this gap-free segment of the run, from 0", ge=0, le=1_000_000, examples=[0])
]
MAX_TIME = 1e7  # s
MAX_SPEED_RPM = 1e6  # r/min

FromTime = Annotated[float, Field(description="Sample time in the segment, s", ge=0, le=MAX_TIME, examples=[0.0])]
Duration = Annotated[
    float | None,
    Field(description="Duration, s; to the end of the segment where omitted", gt=0, le=MAX_TIME, examples=[60.0]),
]
Rows = Annotated[int, Field(description="Maximum number of speed or time bins", ge=1, le=400, examples=[100])]


class QueryParameters(BaseModel):
    """Base of the query parameters; unknown parameters are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FrameQuery(QueryParameters):
    """Selects the recorded frame nearest to a time or speed."""

    segment: Segment = None
    time_s: Annotated[
        float | None,
        Field(
            description="Sample time in the segment, s; a frame must be within 1 s", ge=0, le=MAX_TIME, examples=[98.4]
        ),
    ] = None
    speed_rpm: Annotated[
        float | None,
        Field(
            description="Shaft speed, r/min; refused where no frame is within 2 % (or 100 r/min). With `time_s`, the "
            "frame near this speed that is nearest to that time. Without either, the frame of the largest vibration",
            gt=0, le=MAX_SPEED_RPM, examples=[11_000.0],
        ),
    ] = None  # fmt: skip


class SpeedQuery(QueryParameters):
    """Selects a shaft speed."""

    speed_rpm: Annotated[float, Field(description="Shaft speed, r/min", gt=0, le=MAX_SPEED_RPM, examples=[11_000.0])]


class TrendQuery(QueryParameters):
    """Parameters of the trend over time."""

    segment: Segment = None
    from_s: FromTime = 0.0
    duration_s: Duration = None
    entries: Annotated[
        int, Field(description="Approximate maximum number of entries", ge=1, le=5000, examples=[600])
    ] = 600


MAX_ORDERS: Final = 6
MIN_BANDWIDTH: Final = 0.001  # Hz, or per cent
ORDER = r"\d{1,2}(\.\d{1,4})?"
ORDERS: Final = rf"^{ORDER}(,{ORDER}){{0,{MAX_ORDERS - 1}}}$"


def _require_distinct_orders(orders: str) -> str:
    numbers = [float(order) for order in orders.split(",")]
    if min(numbers) <= 0.0 or len(set(numbers)) < len(numbers):
        raise PydanticCustomError("orders", "expected orders above 0, all different")
    return orders


require_distinct_orders = AfterValidator(_require_distinct_orders)

SolvedOrders = Annotated[
    str,
    Field(description="Orders, separated by commas, solved together", pattern=ORDERS, examples=["1,2", "0.49,1,2"]),
    require_distinct_orders,
]
Order = Annotated[float, Field(description="Frequency over shaft frequency", ge=0.05, le=100, examples=[1.0])]
Revolutions = Annotated[
    int, Field(description="Whole revolutions per spectrum; the line spacing is 1 / revolutions orders", ge=8, le=256)
]
HighestOrder = Annotated[float, Field(description="Highest order", ge=1, le=100, examples=[8.0])]
Width = Annotated[float, Field(description="Width of a speed bin, r/min", ge=1, le=MAX_SPEED_RPM, examples=[100.0])]


class AnalysisFormat(StrEnum):
    """Format of an analysis: numbers or a plot."""

    JSON = "json"
    NPZ = "npz"
    ARROW = "arrow"
    SVG = "svg"
    PNG = "png"
    PDF = "pdf"


class MapLines(StrEnum):
    """Type of the spectra in a map."""

    ORDERS = "orders"  # the larger of the two probes
    FULL = "full"  # circles with and against the rotation
    FREQUENCIES = "frequencies"


class Source(StrEnum):
    """What an analysis is computed from."""

    SAMPLES = "samples"
    RECORDED = "recorded"


class AnalysisQuery(QueryParameters):
    """Base of the parameters of all analyses."""

    only_recorded: ClassVar[frozenset[str]] = frozenset()
    """Names of the parameters that only `Source.RECORDED` takes."""
    only_samples: ClassVar[frozenset[str]] = frozenset()
    """Names of the parameters that only `Source.SAMPLES` takes."""

    source: Annotated[
        Source, Field(description="samples of the run, or as recorded by the live analysis", examples=["samples"])
    ] = Source.SAMPLES
    format: Annotated[AnalysisFormat | None, Field(description="Overrides the Accept header", examples=["json"])] = None
    theme: Annotated[Theme, Field(description="Background of a plot", examples=["light"])] = Theme.LIGHT
    figure_width_mm: Annotated[
        float, Field(description="Width of a plot, mm; 85 for one column of a journal", ge=80, le=200, examples=[170.0])
    ] = DEFAULT_WIDTH
    dpi: Annotated[
        float, Field(description="Resolution of a PNG plot, pixels per inch", ge=50, le=600, examples=[200.0])
    ] = DEFAULT_DPI

    @model_validator(mode="after")
    def _refuse_parameters_of_the_other_source(self) -> Self:
        is_recorded = self.source is Source.RECORDED
        other, refused = ("samples", self.only_samples) if is_recorded else ("recorded", self.only_recorded)
        error = PydanticCustomError("source", "only source={other} takes it", {"other": other})
        given = [(name, getattr(self, name)) for name in sorted(refused & self.model_fields_set)]
        faults = [InitErrorDetails(type=error, loc=(name,), input=value) for name, value in given]
        if faults:
            raise ValidationError.from_exception_data(type(self).__name__, faults)
        return self

    def plot_style(self) -> PlotStyle:
        """Return the appearance of a plot."""
        return PlotStyle(self.theme, self.figure_width_mm, self.dpi)

    def without_appearance(self) -> Self:
        """Return the parameters that the numbers depend on; the others have their defaults."""
        appearance = AnalysisQuery.model_fields.keys() - {"source"}
        return self.model_copy(update={name: AnalysisQuery.model_fields[name].default for name in appearance})


class SampledQuery(AnalysisQuery):
    """Base of the parameters of analyses that a recording does not store."""

    source: Annotated[
        Literal[Source.SAMPLES], Field(description="Computed from the run's samples", examples=["samples"])
    ] = Source.SAMPLES


class ShaftAngleQuery(AnalysisQuery):
    """Base of the parameters of analyses against the shaft angle."""

    slow_roll_rpm: Annotated[
        float | None,
        Field(
            description="Subtract the run-out measured in the run's revolutions up to this speed, r/min; the result is "
            "named compensated",
            gt=0, le=MAX_SPEED_RPM, examples=[None]
        )
    ] = None  # fmt: skip


class TimeIntervalQuery(AnalysisQuery):
    """Base of the parameters of analyses over a time interval."""

    segment: Segment = None
    from_s: FromTime = 0.0
    duration_s: Duration = None


class ShaftAngleIntervalQuery(TimeIntervalQuery, ShaftAngleQuery):
    """Base of the parameters of analyses over a time interval, against the shaft angle."""


class FrameAnalysisQuery(FrameQuery, ShaftAngleQuery):
    """Base of the parameters of analyses of the revolutions up to a recorded frame."""


class OrderSpectrumQuery(FrameAnalysisQuery):
    """Parameters of the order spectrum."""

    only_samples = frozenset({"slow_roll_rpm", "revolutions", "highest_order", "window", "scaling"})

    revolutions: Revolutions = 16
    highest_order: HighestOrder = 8.0
    window: Annotated[
        WindowName,
        Field(description="hann separates lines; flat top reads amplitudes to 0.12 %; uniform suits whole orders only"),
    ] = WindowName.HANN
    scaling: Annotated[Scaling, Field(description="Scaling of the amplitudes")] = Scaling.PEAK


class FullSpectrumQuery(FrameAnalysisQuery):
    """Parameters of the full spectrum."""

    only_samples = frozenset({"slow_roll_rpm", "revolutions", "highest_order"})

    revolutions: Revolutions = 16
    highest_order: HighestOrder = 8.0


class FrequencySpectrumQuery(SampledQuery, TimeIntervalQuery):
    """Parameters of the frequency spectrum averaged over a time interval; needs no tacho."""

    resolution_hz: Annotated[float, Field(description="Line spacing, Hz", ge=0.1, le=1000, examples=[2.0])] = 2.0
    highest_hz: Annotated[float, Field(description="Highest frequency, Hz", ge=1, le=1e6, examples=[2000.0])] = 2000.0


class OrbitFilter(StrEnum):
    """Order filter of an orbit."""

    DIRECT = "direct"  # unfiltered
    ORDERS = "orders"  # the selected orders only
    WITHOUT = "without"  # all but the selected orders: not-1X


class OrbitQuery(FrameAnalysisQuery):
    """Parameters of the orbit."""

    only_samples = frozenset({"slow_roll_rpm", "filter", "orders", "revolutions"})

    filter: Annotated[
        OrbitFilter,
        Field(
            description="direct: unfiltered; orders: only those of `orders` (1X, 2X, nX); without: all others (not-1X)"
        ),
    ] = OrbitFilter.DIRECT
    orders: Annotated[
        str,
        Field(description="Orders, separated by commas", pattern=ORDERS, examples=["1", "1,2"]),
        require_distinct_orders,
    ] = "1"
    revolutions: Annotated[int, Field(description="Number of revolutions shown", ge=1, le=64)] = 4


class AverageQuery(SampledQuery, FrameAnalysisQuery):
    """Parameters of the synchronous average."""

    revolutions: Annotated[int, Field(description="Number of revolutions averaged", ge=8, le=1024)] = 64


class PoincareQuery(SampledQuery, FrameAnalysisQuery):
    """Parameters of the Poincaré section."""

    revolutions: Annotated[int, Field(description="Number of revolutions, one point each", ge=48, le=4096)] = 128


class SlowRollQuery(SampledQuery):
    """Parameters of the run-out of the slow roll."""

    segment: Segment = None
    slow_roll_rpm: Annotated[
        float, Field(description="Highest speed of the slow roll, r/min", gt=0, le=MAX_SPEED_RPM, examples=[1500.0])
    ] = 1500.0


class MapQuery(ShaftAngleIntervalQuery):
    """Base of the parameters of spectra over speed or time."""

    only_samples = frozenset({"slow_roll_rpm", "revolutions", "resolution_hz", "highest_hz"})
    only_recorded = frozenset({"columns"})

    lines: Annotated[
        MapLines,
        Field(
            description="orders: the larger of the probes; full: forward and backward orders; frequencies, only from "
            "samples"
        ),
    ] = MapLines.ORDERS
    columns: Annotated[
        int, Field(description="Maximum number of orders, thinned to it", ge=1, le=1024, examples=[256])
    ] = 256
    revolutions: Revolutions = 16
    highest_order: HighestOrder = 4.0
    resolution_hz: Annotated[
        float, Field(description="Line spacing of frequency spectra, Hz", ge=0.5, le=1000, examples=[4.0])
    ] = 4.0
    highest_hz: Annotated[float, Field(description="Highest frequency of frequency spectra, Hz", ge=1, le=1e6)] = 1000.0

    @field_validator("lines")
    @classmethod
    def _require_recorded_lines(cls, lines: MapLines, info: ValidationInfo) -> MapLines:
        if lines is MapLines.FREQUENCIES and info.data.get("source") is Source.RECORDED:
            raise PydanticCustomError("lines", "expected orders or full with source=recorded")
        return lines


class CascadeQuery(MapQuery):
    """Parameters of the spectra over speed."""

    only_samples = MapQuery.only_samples | {"segment", "from_s", "duration_s", "width_rpm"}
    only_recorded = MapQuery.only_recorded | {"rows"}

    width_rpm: Width = 200.0
    rows: Rows = 100


class WaterfallQuery(MapQuery):
    """Parameters of the spectra over time."""

    rows: Rows = 100


class VectorsQuery(ShaftAngleIntervalQuery):
    """Parameters of the vectors of one order over speed."""

    only_samples = frozenset({"segment", "from_s", "duration_s", "slow_roll_rpm", "width_rpm", "revolutions"})

    order: Order = 1.0
    width_rpm: Width = 100.0
    revolutions: Revolutions = 16


class BifurcationQuery(SampledQuery, ShaftAngleIntervalQuery):
    """Parameters of the bifurcation diagram."""

    averaging_revolutions: Annotated[
        int, Field(description="Width of the moving average subtracted from the positions, revolutions", ge=2, le=1024)
    ] = 64


class CentrelineQuery(SampledQuery, ShaftAngleIntervalQuery):
    """Parameters of the shaft centreline."""

    revolutions: Annotated[
        int, Field(description="Number of revolutions averaged for each position", ge=2, le=1024)
    ] = 16
    rest_x_um: Annotated[
        float | None,
        Field(
            description="Displacement towards probe x with the shaft at rest at the bottom, µm; where omitted, the "
            "mean of the slowest revolutions is taken as the rest position",
            ge=-1e5, le=1e5, examples=[None]
        )
    ] = None  # fmt: skip
    rest_y_um: Annotated[
        float | None, Field(description="Displacement towards probe y at rest, µm", ge=-1e5, le=1e5, examples=[None])
    ] = None


class SubSynchronousQuery(SampledQuery, ShaftAngleIntervalQuery):
    """Parameters of the components below 1X."""

    revolutions: Revolutions = 16


class OverallQuery(SampledQuery, TimeIntervalQuery):
    """Parameters of the overall vibration over time; needs no tacho."""

    interval_s: Annotated[
        float, Field(description="Interval of each peak-to-peak value, s; at least one revolution", ge=0.001, le=60)
    ] = 0.1


class EnvelopesQuery(SampledQuery, TimeIntervalQuery):
    """Parameters of the envelopes of orders by the second-generation Vold-Kalman filter."""

    orders: SolvedOrders = "1,2"
    bandwidth_hz: Annotated[
        float | None, Field(description="Full width at half power, Hz; default 4", ge=MIN_BANDWIDTH, le=1000)
    ] = None
    bandwidth_percent: Annotated[
        float | None,
        Field(description="Bandwidth, per cent of each order's frequency", ge=MIN_BANDWIDTH, le=100, examples=[None]),
    ] = None
    frequencies_hz: Annotated[
        str,
        Field(
            description="Fixed frequencies, Hz, separated by commas, solved together with the orders, as mains hum",
            pattern=f"^$|{ORDERS}",
            examples=["50"],
        ),
        AfterValidator(lambda text: _require_distinct_orders(text) if text else text),
    ] = ""
    entries: Annotated[int, Field(description="Number of evenly spaced times", ge=2, le=20_000)] = 600

    @field_validator("bandwidth_percent")
    @classmethod
    def _require_one_bandwidth(cls, percent: float | None, info: ValidationInfo) -> float | None:
        if percent is not None and info.data.get("bandwidth_hz") is not None:
            raise PydanticCustomError("bandwidth", "expected one of bandwidth_hz and bandwidth_percent")
        return percent


class WaveformsQuery(FrameQuery, SampledQuery):
    """Parameters of the waveforms of single orders."""

    orders: SolvedOrders = "1,2"
    bandwidth_hz: Annotated[float, Field(description="Full width at half power, Hz", ge=MIN_BANDWIDTH, le=1000)] = 4.0
    revolutions: Annotated[int, Field(description="Number of revolutions shown", ge=1, le=64)] = 4
