"""Plots of model studies: legend, labels, distinguishable curves."""

import numpy as np

from daq.reports.plots.layouts import study_panels
from daq.reports.plots.panel import PlotStyle
from daq.reports.plots.render import draw, render
from model.studies.study import Plot, Series, Style

X = np.linspace(0.0, 1.0, 50)


def test_legend_is_beside_lines() -> None:
    figure = draw(study_panels([Plot("title", "x", "y", (Series("one", X, X), Series("two", X, 1 - X)))]), PlotStyle())
    figure.draw_without_rendering()
    (axes,) = figure.axes
    legend = axes.get_legend()
    assert legend is not None
    assert legend.get_window_extent().x0 >= axes.get_window_extent().x1
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_axis_labels_are_complete() -> None:
    figure = draw(study_panels([Plot("title", "x", "y", (Series("", 8000 * X, 89.99 + 1e-3 * X),))]), PlotStyle())
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert axes.yaxis.get_offset_text().get_text() == ""
    assert all(label.get_text().startswith(("89.98", "89.99")) for label in axes.get_yticklabels())
    assert "8,000" in {label.get_text() for label in axes.get_xticklabels()}


def test_plot_without_lines_says_why() -> None:
    nothing = np.array([])
    plot = Plot("rupture", "x", "y", (Series("10 N", nothing, nothing),), empty_text="no cavity")
    (axes,) = draw(study_panels([plot]), PlotStyle()).axes
    assert [text.get_text() for text in axes.texts] == ["no cavity"]
    assert axes.get_xticks().size == 0


def test_equal_curves_are_distinguishable() -> None:
    styles = (Style.LINE, Style.DASHED, Style.DOTTED)
    plot = Plot("equal", "x", "y", tuple(Series(style.value, X, X, style) for style in styles))
    (axes,) = draw(study_panels([plot]), PlotStyle()).axes
    assert len({str(line.get_linestyle()) + str(line.get_linewidth()) for line in axes.lines}) == 3


def test_trajectory_has_one_scale_in_both_directions() -> None:
    (axes,) = draw(study_panels([Plot("title", "x", "y", (Series("", X, 3 * X),), is_square=True)]), PlotStyle()).axes
    assert axes.get_aspect() == 1.0


def test_ticks_of_logarithmic_axes_are_plain_text() -> None:
    plot = Plot("$title", "x", "y", (Series("one", X + 0.01, 10.0 ** (6 * X)),), x_log=True, y_log=True)
    svg = render(study_panels([plot]), "svg").decode()
    assert "$title" in svg
    assert "mathdefault" not in svg
    assert ">1,000<" in svg
    assert ">10⁵<" in svg
