"""Renderer: reproducible files, text, theme, size, lag axis, legend outside the axes."""

import struct
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from daq.colours import ALARM, BACKGROUND, DANGER, MEASURED_X, MEASURED_Y, MODEL, ON_WHITE, hex_code
from daq.reports.plots.layouts import RampCurve, orbit, polar, spectrum, stacked
from daq.reports.plots.panel import Curve, Panel, PlotStyle, Style, Theme
from daq.reports.plots.render import curve_colours, draw, plot_settings, render

SVG = "{http://www.w3.org/2000/svg}"
TURN = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
CIRCLE = (30.0 * np.cos(TURN)).tolist(), (30.0 * np.sin(TURN)).tolist()
RAMP = RampCurve("", [1000.0, 2000.0, 3000.0], ([1.0, 2.0, 3.0],) * 2, ([0.0, 90.0, 120.0],) * 2)
LAG = Panel(
    "run · 1X", "speed, r/min", "phase lag of 1X, degrees",
    (Curve("x", [1000.0, 2000.0, 3000.0], [280.0, None, 500.0]), Curve("y", [1000.0, 3000.0], [300.0, 300.0])),
    "16 revolutions per vector", y_range=(270.0, 630.0), y_is_lag=True,
)  # fmt: skip
PANELS = {
    "lag": [LAG],
    "orbit": [orbit("orbit", [CIRCLE], (0.0, np.pi / 2))],
    "polar": polar("run", "1X", "µm zero-to-peak", [RAMP], (0.0, np.pi / 2), "caption"),
    "cascade": [stacked("run", "order", "speed, r/min", [0.0, 1.0, 2.0], [1000.0, 2000.0], [[0.0, 5.0, 0.0]] * 2)],
    "spectrum": spectrum("run", "order", "µm zero-to-peak", [0.0, 1.0, 2.0], [("x", [0.0, 20.0, 0.0])]),
    "dots": [
        Panel("t", "x", "y", (Curve("", [1.0], [1.0], Style.DOTS), Curve("1X", [0.0, 1.0], [0.0] * 2, Style.GUIDE)))
    ],
    "empty": [Panel("nothing", "x", "y", (Curve("", [], []),))],
}


def texts(svg: bytes) -> list[str]:
    return ["".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text")]  # noqa: S314 - our own


@pytest.mark.parametrize("name", PANELS)
@pytest.mark.parametrize("theme", Theme)
def test_every_format_is_reproducible_and_carries_no_date(name: str, theme: Theme) -> None:
    style = PlotStyle(theme, dpi=60.0)
    for file_format, magic in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")):
        made = render(PANELS[name], file_format, style)
        assert made.startswith(magic)
        assert made == render(PANELS[name], file_format, style)
        assert b"<dc:date>" not in made
        assert b"CreationDate" not in made


def test_labels_are_text_in_svg() -> None:
    found = texts(render([*PANELS["spectrum"], LAG], "svg"))
    expected = {
        "order",
        "amplitude, µm zero-to-peak, at x",
        "1X 20",
        "phase lag of 1X, degrees",
        "speed, r/min",
        "3,000",
    }
    assert expected <= set(found)


def test_free_text_is_no_mathematical_markup() -> None:
    name = r"$\frac{1$ & <b> x_1 $2$"
    found = texts(render([Panel(name, "x", "y", (Curve(name, [0.0, 1.0], [0.0, 1.0]),), name)], "svg"))
    assert found.count(name) == 3, "title, caption and legend"


@pytest.mark.parametrize(("width", "dpi"), [(170.0, 100.0), (85.0, 300.0)])
def test_width_and_resolution_set_the_pixels_of_a_png(width: float, dpi: float) -> None:
    made = render([LAG], "png", PlotStyle(width=width, dpi=dpi))
    assert struct.unpack(">I", made[16:20])[0] == pytest.approx(width / 25.4 * dpi, abs=1.0)


def test_theme_selects_colours() -> None:
    for theme, wanted, other in ((Theme.LIGHT, ON_WHITE, {}), (Theme.DARK, {}, ON_WHITE)):
        svg = render([LAG], "svg", PlotStyle(theme)).decode()
        for color in (BACKGROUND, MEASURED_X, MEASURED_Y):
            assert hex_code(wanted.get(color, color)) in svg
            assert hex_code(other.get(color, color)) not in svg
        reserved = {theme.colour(color) for color in (MODEL, ALARM, DANGER)}
        assert reserved.isdisjoint(curve_colours(theme)), "no measured curve has the colour of the model or an alarm"
        assert len(set(curve_colours(theme))) == 7


@pytest.mark.parametrize("width", [80.0, 170.0])
@pytest.mark.parametrize("name", PANELS)
def test_everything_is_inside_the_figure_and_the_legend_beside_the_axes(name: str, width: float) -> None:
    style = PlotStyle(width=width)
    with plot_settings(style):
        figure = draw(PANELS[name], style)
        figure.draw_without_rendering()
        for axes in figure.axes:
            legend = axes.get_legend()
            if legend is not None:
                assert legend.get_window_extent().x0 >= axes.get_window_extent().x1
                assert legend.get_window_extent().x1 <= figure.bbox.x1 + 1.0
            for text in (axes.xaxis.label, axes.yaxis.label, axes.title):
                extent = text.get_window_extent()
                assert extent.x0 >= -1.0
                assert extent.y0 >= -1.0
                assert extent.y1 <= figure.bbox.y1 + 1.0


def test_lag_axis_points_down_and_gaps_stay_open() -> None:
    with plot_settings(PlotStyle()):
        (axes,) = draw([LAG], PlotStyle()).axes
        assert axes.get_ylim() == (630.0, 270.0)
        ticks = zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
        assert [label.get_text() for lag, label in ticks if 270.0 <= lag <= 630.0] == ["270", "0", "90", "180", "270"]
        assert np.isnan(axes.lines[0].get_ydata()[1])  # type: ignore[index]


def test_square_panel_has_one_scale() -> None:
    with plot_settings(PlotStyle()):
        for name in ("orbit", "polar"):
            assert all(axes.get_aspect() == 1.0 for axes in draw(PANELS[name], PlotStyle()).axes)
