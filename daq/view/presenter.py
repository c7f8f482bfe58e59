"""Layout of the live view, and logging of live updates to rerun; the same live and in replay."""

from collections.abc import Callable, Hashable

import rerun as rr
import rerun.blueprint as rrb

from analysis.signals.header import RunHeader
from daq.colours import BACKGROUND
from daq.session.live_update import LiveUpdate
from daq.view import banner, bode, orbit, spectral_maps, spectrum, status_text, traces
from daq.view.bode import BodePlot
from daq.view.drawing import Drawing
from daq.view.orbit import OrbitPlot
from daq.view.spectral_maps import CascadePlot, WaterfallPlot
from daq.view.spectrum import SpectrumPlot
from daq.view.status_text import details, signal_table
from daq.view.traces import TracePlot, TrendPlot

_Bounds = tuple[tuple[float, float], tuple[float, float]]


def timeline(header: RunHeader) -> str:
    """Return the name of a run's timeline, which is its sample time."""
    return f"time in {header.run}"


def operator_blueprint(header: RunHeader) -> rrb.Blueprint:
    """Return the layout for a run: banner; orbit, spectrum, cascade; Bode plot, traces, signals."""
    return rrb.Blueprint(
        rrb.Vertical(
            _view_2d("banner", "Rig", banner.BOUNDS, titlebar=False),
            rrb.Horizontal(
                _view_2d("orbit", "Orbit (µm, seen from the compressor end)", orbit.BOUNDS),
                _view_2d("spectrum", "Order spectrum (µm peak over shaft orders)", spectrum.BOUNDS),
                rrb.Tabs(
                    _view_2d("cascade", "Cascade (spectra over speed, r/min)", spectral_maps.MAP_BOUNDS),
                    _view_2d("waterfall", "Waterfall (spectra over time, s)", spectral_maps.MAP_BOUNDS),
                    active_tab=0,
                ),
                column_shares=[1.05, 1.35, 1.4],
            ),
            rrb.Horizontal(
                _view_2d("bode", "1X and 2X against speed (µm peak, ° lag)", bode.BOUNDS),
                rrb.Tabs(
                    _view_2d("traces", "Traces (µm and V over ms)", traces.TRACE_BOUNDS),
                    _view_2d("trend", "Trend (µm peak-to-peak and r/min over time)", traces.TREND_BOUNDS),
                    active_tab=0,
                ),
                rrb.Tabs(
                    _view_2d("signals", "Signals", status_text.BOUNDS),
                    rrb.TextDocumentView(origin="/details", name="Details"),
                    active_tab=0,
                ),
                column_shares=[1.25, 1.25, 1.1],
            ),
            row_shares=[1.0, 2.75, 2.25],
        ),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="hidden", timeline=timeline(header), play_state="following"),  # "playing" falls behind
        auto_layout=False,
        auto_views=False,
    )


def _view_2d(origin: str, name: str, bounds: _Bounds, *, titlebar: bool = True) -> rrb.Spatial2DView:
    across, down = bounds
    return rrb.Spatial2DView(
        origin=f"/{origin}",
        name=name,
        titlebar=titlebar,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=across, y_range=down),
    )


_UNDER, _OVER, _TOP = 10.0, 20.0, 30.0  # draw order
# Plots are drawn every so many updates, of ten per second. A browser without a graphics card draws about 25 entities
# per second and skips none, so that sending more delays the display.
_FAST = 3  # orbit and banner
_MIDDLE = 6  # spectra, traces, signals
_SLOW = 12  # cascade and Bode plot
_SLOWEST = 24  # waterfall, trend, details
_REPEAT = 50  # updates between repeated axes, for late viewers whose oldest data was dropped


class Presenter:
    """Logs the live updates of one run to one stream.

    Not thread-safe. Memory does not grow with the length of the run.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Stream of the viewer.
    header : RunHeader
        Header of the run. Each run has its own timeline, which hides data of previous runs in the viewer.
    """

    def __init__(self, stream: rr.RecordingStream, header: RunHeader) -> None:
        self._stream = stream
        self._timeline = timeline(header)
        self._count = 0
        self._shown: dict[str, tuple[Hashable, int]] = {}
        self._orbit = OrbitPlot(header)
        self._spectrum = SpectrumPlot()
        self._cascade = CascadePlot(header)
        self._waterfall = WaterfallPlot(header)
        self._bode = BodePlot(header)
        self._traces = TracePlot()
        self._trend = TrendPlot()
        self._model_points = header.settings.points_per_revolution

    def show(self, update: LiveUpdate) -> None:
        """Log the plots that are due for an update."""
        self._stream.set_time(self._timeline, duration=update.status.elapsed)
        snapshot = update.snapshot
        if snapshot is not None:
            self._cascade.add(snapshot, update.prediction)
            self._waterfall.add(snapshot, update.prediction, update.status.elapsed)
            self._bode.add(snapshot.frame, update.prediction)
            self._trend.add(snapshot, update.prediction, update.status.elapsed)
        if self._count % _FAST == 0:
            banner.banner(update).log(self._stream, "banner")
            self._show_orbit(update)
        if self._count % _MIDDLE == 0:
            self._show_spectrum(update)
            self._show_traces(update)
            signal_table(update).log(self._stream, "signals")
        if self._count % _SLOW == 0:
            self._show_by_speed(update)
        if self._count % _SLOWEST == 0:
            self._show_waterfall(update)
            self._show_trend(update)
            self._stream.log("details", rr.TextDocument(details(update), media_type=rr.MediaType.MARKDOWN))
        self._count += 1

    def _show_orbit(self, update: LiveUpdate) -> None:
        order_frame = update.snapshot.frame if update.snapshot is not None else None
        self._axes("orbit/axes", self._orbit.follow(order_frame, update.prediction), self._orbit.axes)
        self._orbit.model(update.prediction, self._model_points).log(self._stream, "orbit/model", draw_order=_OVER)
        self._orbit.measured(order_frame).log(self._stream, "orbit/measured", draw_order=_TOP)

    def _show_spectrum(self, update: LiveUpdate) -> None:
        order_frame = update.snapshot.frame if update.snapshot is not None else None
        self._axes("spectrum/axes", self._spectrum.follow(order_frame, update.prediction), self._spectrum.axes)
        self._spectrum.model(update.prediction).log(self._stream, "spectrum/model", draw_order=_OVER)
        self._spectrum.measured(order_frame).log(self._stream, "spectrum/measured", draw_order=_TOP)
        labels = self._spectrum.labels(order_frame, update.prediction)
        labels.log(self._stream, "spectrum/labels", draw_order=_TOP + 1.0)

    def _show_traces(self, update: LiveUpdate) -> None:
        self._axes("traces/axes", self._traces.follow(update.snapshot), self._traces.axes)
        self._traces.lines(update.snapshot, update.status.markers).log(self._stream, "traces/lines", draw_order=_OVER)

    def _show_by_speed(self, update: LiveUpdate) -> None:
        order_frame = update.snapshot.frame if update.snapshot is not None else None
        self._axes("cascade/axes", 0, self._cascade.axes)
        self._stream.log("cascade/measured", self._cascade.picture())
        self._cascade.lines(order_frame).log(self._stream, "cascade/model", draw_order=_TOP)
        self._axes("bode/axes", self._bode.follow(), self._bode.axes)
        self._bode.model().log(self._stream, "bode/model", draw_order=_OVER)
        self._bode.measured().log(self._stream, "bode/measured", draw_order=_TOP)

    def _show_waterfall(self, update: LiveUpdate) -> None:
        self._axes("waterfall/axes", 0, self._waterfall.axes)
        self._stream.log("waterfall/measured", self._waterfall.picture())
        lines = self._waterfall.lines(update.status.elapsed, update.status.markers)
        lines.log(self._stream, "waterfall/model", draw_order=_TOP)

    def _show_trend(self, update: LiveUpdate) -> None:
        elapsed = update.status.elapsed
        self._axes("trend/axes", self._trend.follow(elapsed), lambda: self._trend.axes(elapsed))
        self._trend.lines(elapsed, update.status.markers).log(self._stream, "trend/lines", draw_order=_OVER)

    def _axes(self, path: str, state: Hashable, draw: Callable[[], Drawing]) -> None:
        """Log the axes of a plot when its scale has changed, and every `_REPEAT` updates."""
        state_before, count = self._shown.get(path, (None, -_REPEAT))
        if state != state_before or self._count - count >= _REPEAT:
            draw().log(self._stream, path, draw_order=_UNDER)
            self._shown[path] = (state, self._count)
