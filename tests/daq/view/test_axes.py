"""Axes have round ticks and right places, scales follow what is drawn, and letters are legible."""

import math

import numpy as np
import pytest

from analysis.signals.units import RPM
from daq.view.drawing import AutoScale, Axis, Plot, round_up, text_strokes, text_width
from daq.view.status import clock, disk_time, micrometres, replace_unprintable, rpm, vector
from daq.view.waveforms import min_max_decimated


@pytest.mark.parametrize(
    ("span", "count", "step"), [(100.0, 5, 20.0), (3.0, 6, 0.5), (20_000.0, 8, 5_000.0), (7.0, 5, 2.0)]
)
def test_tick_step_is_round_and_limits_number_of_ticks(span: float, count: int, step: float) -> None:
    assert math.isclose(round_up(span / count), step)


def test_tick_labels_have_required_digits() -> None:
    axis = Axis(0.0, 1.0, "amplitude, µm", ticks=5)
    assert [axis.label(value) for value in axis.values()] == ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
    assert [Axis(-50.0, 50.0, "", ticks=4).label(v) for v in Axis(-50.0, 50.0, "", ticks=4).values()] == [
        "-50",
        "0",
        "50",
    ]
    assert Axis(0.0, 20_000.0, "").label(5_000.0) == "5,000"


def test_values_are_placed_with_y_up_and_clipped_to_axis() -> None:
    plot = Plot(0.0, 0.0, 100.0, 50.0, Axis(0.0, 10.0, "x"), Axis(0.0, 5.0, "y"), font_size=5.0)
    assert np.allclose(plot.place([0.0, 10.0, 5.0], [0.0, 5.0, 99.0]), [(0.0, 50.0), (100.0, 0.0), (50.0, 0.0)])


def test_scale_grows_at_once_and_shrinks_with_delay() -> None:
    reach = AutoScale(minimum=2.0, patience=3)
    assert reach.follow(30.0) >= 30.0
    high = reach.end
    assert [reach.follow(3.0) for _ in range(2)] == [high, high]
    assert 3.0 <= reach.follow(3.0) < high
    assert reach.follow(math.nan) == reach.end


def test_changing_digits_do_not_change_the_width() -> None:
    assert math.isclose(text_width("11,111"), text_width("20,888"))


def test_glyphs_stand_on_baseline_with_capitals_of_height_one() -> None:
    points = np.concatenate(text_strokes("H8"))
    assert math.isclose(points[:, 1].min(), 0.0)
    assert math.isclose(points[:, 1].max(), 1.0)
    assert math.isclose(points[:, 0].max(), text_width("H8"))


def test_unknown_character_is_drawn_as_box() -> None:
    assert len(text_strokes("油")) == 1


def test_min_max_decimation_retains_extremes_in_order() -> None:
    values = np.zeros(10_000)
    values[4_321], values[4_322] = 7.0, -7.0
    index, extremes = min_max_decimated(values, 600)
    assert extremes.size <= 600
    assert extremes.max() == 7.0
    assert extremes.min() == -7.0
    assert np.all(np.diff(index) >= 0)


def test_vector_is_printed_with_its_phase_lag() -> None:
    assert vector(12e-6 * complex(np.exp(0.5j * math.pi))) == "12 µm, 270°"


def test_quantities_are_formatted_for_operator() -> None:
    assert rpm(11_042 * RPM) == "11,042"
    assert (clock(161.9), clock(3_761.0)) == ("02:41", "1:02:41")
    assert (disk_time(41 * 3_600.0), disk_time(1_500.0), disk_time(math.inf)) == ("41 h", "25 min", "not written")
    assert (micrometres(41.4e-6), micrometres(0.32e-6)) == ("41 µm", "0.3 µm")
    assert replace_unprintable("Öl ∠ 20 µm") == "Öl ? 20 µm"
