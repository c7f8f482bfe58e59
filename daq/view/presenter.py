"""Layout of the live view, and logging of live updates to rerun; the same live and in replay."""

from collections.abc import Hashable

import rerun as rr
import rerun.blueprint as rrb

from analysis.signals.header import RunHeader
from daq.colours import BACKGROUND
from daq.session.live_update import LiveUpdate
from daq.view.bode import BODE_BOUNDS, BodePlot
from daq.view.drawing import Drawing, LivePlot
from daq.view.spectra import MAP_BOUNDS, SPECTRUM_BOUNDS, CascadePlot, SpectrumPlot, WaterfallPlot
from daq.view.status import BANNER_BOUNDS, banner, details
from daq.view.waveforms import ORBIT_BOUNDS, TRACE_BOUNDS, TREND_BOUNDS, OrbitPlot, TracePlot, TrendPlot

_Bounds = tuple[tuple[float, float], tuple[float, float]]


def timeline(header: RunHeader) -> str:
    """Return the name of a run's timeline, which is its sample time."""
    return f"time in {header.run}"


def operator_blueprint(header: RunHeader) -> rrb.Blueprint:
    """Return the layout for a run: banner; orbit, spectrum, cascade; Bode plot, traces, signals."""
    return rrb.Blueprint(
        rrb.Vertical(
            _view_2d("banner", "Rig", BANNER_BOUNDS, titlebar=False),
            rrb.Horizontal(
                _view_2d("orbit", "Orbit (µm, seen from the compressor end)", ORBIT_BOUNDS),
                _view_2d("spectrum", "Order spectrum (µm peak over shaft orders)", SPECTRUM_BOUNDS),
                rrb.Tabs(
                    _view_2d("cascade", "Cascade (spectra over speed, r/min)", MAP_BOUNDS),
                    _view_2d("waterfall", "Waterfall (spectra over time, s)", MAP_BOUNDS),
                    active_tab=0,
                ),
                column_shares=[1.05, 1.35, 1.4],
            ),
            rrb.Horizontal(
                _view_2d("bode", "1X and 2X against speed (µm peak, ° lag)", BODE_BOUNDS),
                rrb.Tabs(
                    _view_2d("traces", "Traces (µm and V over ms)", TRACE_BOUNDS),
                    _view_2d("trend", "Trend (µm peak-to-peak and r/min over time)", TREND_BOUNDS),
                    active_tab=0,
                ),
                rrb.TextDocumentView(origin="/details", name="Signals"),
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


_UNDER, _OVER = 10.0, 20.0  # draw order of the axes, and of the first layer of a plot
# Plots are drawn every so many updates, of ten per second. A browser without a graphics card draws about 25 entities
# per second and skips none, so that sending more delays the display.
_ORBIT_INTERVAL = 3  # updates, also of the banner
_SPECTRUM_INTERVAL = 6  # updates, also of traces and details
_CASCADE_INTERVAL = 12  # updates, also of the Bode plot
_WATERFALL_INTERVAL = 24  # updates, also of the trend
_AXES_PERIOD = 5.0  # s of the run between repeated axes, for late viewers whose oldest data was dropped


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
        self._shown: dict[str, tuple[Hashable, float]] = {}  # state of the axes of each plot, and when they were logged
        self._plots: dict[str, tuple[LivePlot, int]] = {
            "orbit": (OrbitPlot(header), _ORBIT_INTERVAL),
            "spectrum": (SpectrumPlot(), _SPECTRUM_INTERVAL),
            "traces": (TracePlot(), _SPECTRUM_INTERVAL),
            "cascade": (CascadePlot(header), _CASCADE_INTERVAL),
            "bode": (BodePlot(header), _CASCADE_INTERVAL),
            "waterfall": (WaterfallPlot(header), _WATERFALL_INTERVAL),
            "trend": (TrendPlot(), _WATERFALL_INTERVAL),
        }

    def show(self, update: LiveUpdate) -> None:
        """Log what is due for an update."""
        self._stream.set_time(self._timeline, duration=update.status.elapsed)
        if self._count % _ORBIT_INTERVAL == 0:
            self._stream.log("banner", banner(update).archetype(draw_order=_OVER))
        if self._count % _SPECTRUM_INTERVAL == 0:
            self._stream.log("details", rr.TextDocument(details(update), media_type=rr.MediaType.MARKDOWN))
        for name, (plot, interval) in self._plots.items():
            plot.add(update)
            if self._count % interval == 0:
                self._show_plot(name, plot, update)
        self._count += 1

    def _show_plot(self, name: str, plot: LivePlot, update: LiveUpdate) -> None:
        """Log the layers of a plot, and its axes when its scale has changed and every `_AXES_PERIOD` seconds."""
        state, elapsed = plot.follow(update), update.status.elapsed
        state_before, logged = self._shown.get(name, (None, -_AXES_PERIOD))
        if state != state_before or elapsed - logged >= _AXES_PERIOD:
            self._stream.log(f"{name}/axes", plot.axes().archetype(draw_order=_UNDER))
            self._shown[name] = (state, elapsed)
        for number, (part, layer) in enumerate(plot.layers(update).items()):
            archetype = layer.archetype(draw_order=_OVER + number) if isinstance(layer, Drawing) else layer
            self._stream.log(f"{name}/{part}", archetype)
