"""What stands where on the operator's screen."""

import rerun.blueprint as rrb

from analysis.signals.header import RunHeader
from daq.view import banner, bode, colour_map, orbit, spectrum, traces, trend, words
from daq.view.palette import PAPER

_Bounds = tuple[tuple[float, float], tuple[float, float]]


def timeline(header: RunHeader) -> str:
    """Return the name of the timeline on which a run is shown: its sample time."""
    return f"time in {header.run}"


def operator_blueprint(header: RunHeader) -> rrb.Blueprint:
    """Return the layout for a run: status over orbit, spectrum and cascade over Bode plot, traces and words."""
    return rrb.Blueprint(
        rrb.Vertical(
            _drawn("banner", "Rig", banner.BOUNDS, titlebar=False),
            rrb.Horizontal(
                _drawn("orbit", "Orbit (µm, seen from the compressor end)", orbit.BOUNDS),
                _drawn("spectrum", "Order spectrum (µm peak over shaft orders)", spectrum.BOUNDS),
                rrb.Tabs(
                    _drawn("cascade", "Cascade (spectra over speed, r/min)", colour_map.BOUNDS),
                    _drawn("waterfall", "Waterfall (spectra over time, s)", colour_map.BOUNDS),
                    active_tab=0,
                ),
                column_shares=[1.05, 1.35, 1.4],
            ),
            rrb.Horizontal(
                _drawn("bode", "1X and 2X against speed (µm peak, ° lag)", bode.BOUNDS),
                rrb.Tabs(
                    _drawn("traces", "Traces (µm and V over ms)", traces.BOUNDS),
                    _drawn("trend", "Trend (µm peak-to-peak and r/min over time)", trend.BOUNDS),
                    active_tab=0,
                ),
                rrb.Tabs(
                    _drawn("words", "Signals", words.BOUNDS),
                    rrb.TextDocumentView(origin="/details", name="In words"),
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


def _drawn(origin: str, name: str, bounds: _Bounds, *, titlebar: bool = True) -> rrb.Spatial2DView:
    across, down = bounds
    return rrb.Spatial2DView(
        origin=f"/{origin}",
        name=name,
        titlebar=titlebar,
        background=PAPER,
        visual_bounds=rrb.VisualBounds2D(x_range=across, y_range=down),
    )
