"""The live Bode plot of a run there and back: run-up and run-down stand apart."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.units import MICROMETRE, RPM
from daq.colours import MEASURED_X
from daq.view.bode import BodePlot
from daq.view.drawing import Drawing
from tests.daq.support.live_updates import make_header, make_live_updates

UPDATE = make_live_updates(1)[0]
UP, DOWN = 20e-6, 10e-6  # m peak, of 1X on the way up and down


def plot_of(course: Iterable[tuple[float, float]]) -> BodePlot:
    """The plot after frames of so many r/min and m peak at 1X of x; nothing else moves."""
    plot, update = BodePlot(make_header()), make_live_updates(1)[0]
    assert update.snapshot is not None
    assert update.order_frame is not None
    for speed, amplitude in course:
        vectors = np.zeros((2, 2), dtype=np.complex128)
        vectors[0, 0] = amplitude
        frame = replace(update.order_frame, speed=speed * RPM, vectors=vectors)
        plot.add(replace(update, snapshot=replace(update.snapshot, frame=frame), prediction=None))
    return plot


def strips(drawing: Drawing) -> list[tuple[NDArray[np.float64], tuple[int, ...]]]:
    """The lines that are drawn, each with its colour."""
    archetype = drawing.archetype()
    assert archetype.strips is not None
    assert archetype.colors is not None
    codes = archetype.colors.as_arrow_array().to_pylist()
    colors = [tuple(int(code).to_bytes(4, "big")) for code in codes]
    lines = [np.array(strip) for strip in archetype.strips.as_arrow_array().to_pylist()]
    return list(zip(lines, colors, strict=True))


def levels(plot: BodePlot) -> tuple[list[float], int]:
    """The amplitudes, µm, at which 1X of x is drawn whole, and how many of its dashes lie at 10 µm."""
    end = plot.follow(UPDATE)[0]
    measured = plot.layers(UPDATE)["measured"]
    assert isinstance(measured, Drawing)
    mine = [line for line, color in strips(measured) if color == MEASURED_X and line[:, 1].max() <= 76.0]
    whole = [float(np.median((1.0 - line[:, 1] / 76.0) * end)) for line in mine if np.ptp(line[:, 0]) > 20.0]
    dashes = [line for line in mine if np.ptp(line[:, 0]) < 20.0]
    at_down = [line for line in dashes if np.allclose((1.0 - line[:, 1] / 76.0) * end, DOWN / MICROMETRE, atol=0.01)]
    return whole, len(at_down)


WAY_UP = [(speed, UP) for speed in range(1_000, 15_000, 50)]
WAY_DOWN = [(speed, DOWN) for speed in range(15_000, 1_000, -50)]


def test_run_up_stays_solid_while_run_down_is_dashed() -> None:
    whole, dashes = levels(plot_of(WAY_UP + WAY_DOWN))
    assert whole == pytest.approx([UP / MICROMETRE], abs=0.01)
    assert dashes > 20


def test_run_up_only_has_no_dashes_and_no_run_down_legend() -> None:
    plot = plot_of(WAY_UP)
    whole, dashes = levels(plot)
    assert whole == pytest.approx([UP / MICROMETRE], abs=0.01)
    assert dashes == 0
    assert not plot.follow(UPDATE)[2]


def test_legend_explains_dashes_after_reversal() -> None:
    up, both = plot_of(WAY_UP), plot_of(WAY_UP + WAY_DOWN)
    assert both.follow(UPDATE)[2]
    assert len(strips(both.axes())) > len(strips(up.axes())) + 20  # the strokes of its words


def test_second_run_up_replaces_only_first_run_up() -> None:
    again = [(speed, 5e-6) for speed in range(1_000, 15_000, 50)]
    whole, dashes = levels(plot_of(WAY_UP + WAY_DOWN + again))
    assert whole == pytest.approx([5.0], abs=0.01)
    assert dashes > 20


def test_fluctuation_about_steady_speed_is_no_run_down() -> None:
    held = [(14_950.0 + 60.0 * math.sin(0.3 * k), UP) for k in range(200)]
    assert not plot_of(WAY_UP + held).follow(UPDATE)[2]


def test_scale_includes_all_plotted_vectors() -> None:
    plot = plot_of(WAY_UP + [(speed, 1e-6) for speed in range(14_000, 1_000, -50)])
    assert [plot.follow(UPDATE)[0] for _ in range(10)] == [30.0] * 10


def test_unknown_speed_or_vectors_are_not_drawn() -> None:
    plot = plot_of([(math.nan, UP), *WAY_UP, (14_990.0, math.nan)])
    assert levels(plot)[0]
    assert not plot.follow(UPDATE)[2]
