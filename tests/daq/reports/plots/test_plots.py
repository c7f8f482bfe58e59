"""Plots: lag axes, keyphasor mark, run-up and run-down, compensation."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from analysis.signals.blocks import RampDirection
from analysis.signals.snapshot import OVERALL
from analysis.signals.units import RPM
from analysis.spectra.order_map import order_spectrum
from analysis.vectors.speed_curve import SpeedRow
from daq.reports.kinds.recorded import ramp_curves
from daq.reports.kinds.vectors import PEAK_UNIT
from daq.reports.plots.layouts import RampCurve, bode, orbit, polar, spectrum
from daq.reports.plots.panel import Panel

PROBES = (0.0, math.pi / 2)
UNKNOWN = np.full((2, 2), complex(math.nan))


def row(direction: RampDirection, speed_rpm: float, compensated: complex | None) -> SpeedRow:
    vectors = np.full((2, 2), 10e-6 + 0j)
    less = UNKNOWN if compensated is None else np.full((2, 2), compensated)
    two = np.array([[30e-6, 31e-6]] * len(OVERALL.rows))
    return SpeedRow(
        direction, speed_rpm * RPM, 3, vectors, np.zeros((2, 2)), two, two, 5e-8, 0.0, math.nan, compensated=less
    )


def bode_panels(*rows: SpeedRow) -> list[Panel]:
    return bode("there-and-back", *bode_arguments(rows))


def bode_arguments(rows: Sequence[SpeedRow]) -> tuple[str, str, list[RampCurve]]:
    what, ramps = ramp_curves(rows, 1)
    return what, PEAK_UNIT, ramps


def polar_panels(*rows: SpeedRow) -> list[Panel]:
    return polar("there-and-back", *bode_arguments(rows), PROBES)


def test_run_up_and_run_down_are_separate_curves() -> None:
    both = [(way, speed) for way in RampDirection for speed in (1000.0, 2000.0)]
    lag, size = bode_panels(*(row(way, speed, None) for way, speed in both))
    assert [curve.name for curve in size.curves] == ["x ▲", "y ▲", "x ▼", "y ▼"]
    assert [curve.name for curve in lag.curves] == ["x ▲", "y ▲", "x ▼", "y ▼"]
    assert all(len(curve.x) == 2 for curve in size.curves)
    alone = bode_panels(row(RampDirection.RUN_UP, 1000.0, None))[0]
    assert [curve.name for curve in alone.curves] == ["x", "y"]
    drawn = polar_panels(*(row(way, speed, None) for way, speed in both))
    assert [[curve.name for curve in panel.curves] for panel in drawn] == [["▲", "▼"]] * 2


def test_lag_axis_points_down_and_curve_breaks_at_wrap() -> None:
    def drawn(*lags: float) -> Panel:
        vectors = [2e-6 * np.exp(-1j * np.radians(lag)) for lag in lags]
        rows = [row(RampDirection.RUN_UP, 1000.0 * k, vector) for k, vector in enumerate(vectors, 1)]
        return bode_panels(*rows)[0]

    across = drawn(350.0, 10.0)
    assert across.y_is_lag
    assert across.ranges()[1] == (270.0, 630.0), "an axis that leaves the curve whole"
    assert list(across.curves[0].y) == pytest.approx([350.0, 370.0])
    all_round = drawn(10.0, 130.0, 250.0, 370.0, 490.0)
    assert [len(stretch) for stretch in all_round.curves[0].segments()] == [3, 2]


def test_known_run_out_plots_compensated_vectors_only() -> None:
    rows = [row(RampDirection.RUN_UP, 500.0, None), row(RampDirection.RUN_UP, 2000.0, 4e-6j)]
    lag, size = bode_panels(*rows)
    assert lag.title == "there-and-back"
    assert size.title == "amplitude of 1X compensated"
    at_x, _ = size.curves
    assert list(at_x.x) == [pytest.approx(2000.0)]
    assert list(at_x.y) == [pytest.approx(4.0)]
    assert list(lag.curves[0].y) == [pytest.approx(270.0)]


def test_polar_plot_zero_lag_points_to_probe_and_lags_are_clockwise() -> None:
    rows = [
        row(RampDirection.RUN_UP, 1000.0 * k, 2e-6 * np.exp(-1j * np.radians(lag)))
        for k, lag in enumerate((0.0, 90.0), 1)
    ]
    at_x, at_y = polar_panels(*rows)
    assert (at_x.polar_zero, at_y.polar_zero) == PROBES
    assert list(at_x.curves[0].x) == pytest.approx([2.0, 0.0], abs=1e-6)
    assert list(at_x.curves[0].y) == pytest.approx([0.0, -2.0], abs=1e-6), "90 degrees later is clockwise"
    assert list(at_y.curves[0].x) == pytest.approx([0.0, 2.0], abs=1e-6)
    assert list(at_y.curves[0].y) == pytest.approx([2.0, 0.0], abs=1e-6)


def test_orbit_is_blank_before_keyphasor_mark_with_dot_at_it() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
    turn = (3.0 * np.cos(angle)).tolist(), (3.0 * np.sin(angle)).tolist()
    panel = orbit("two turns", [turn, turn], PROBES)
    path, marks = panel.curves
    assert [len(stretch) for stretch in path.segments()] == [61, 61], "blank just before the mark"
    assert path.segments()[1][0] == marks.segments()[0][1] == (3.0, 0.0)
    (x_low, x_high), (y_low, y_high) = panel.ranges()
    assert x_high == y_high == -x_low == -y_low > 3.0, "one scale, zero in the middle"
    assert [words for words, _, _ in panel.notes] == ["probe x", "probe y"]
    assert panel.notes[1][2] > 3.0, "above"


def test_spectrum_labels_largest_lines() -> None:
    orders = [k / 16 for k in range(65)]
    sizes = [0.001] * 65
    for order, size in ((0.5, 12.0), (1.0, 20.0), (2.0, 0.1)):
        sizes[int(16 * order)] = size
    (panel,) = spectrum("title", "order", "µm", orders, [("", sizes)])
    assert [words for words, _, _ in panel.notes] == ["1X 20", "0.5X 12"], "what is below a hundredth is not"


def test_labels_of_a_spectrum_are_interpolated_between_its_lines() -> None:
    turns = np.arange(16 * 64) / 64
    waveform = 41.6 * np.cos(2 * np.pi * 0.17 * turns) + 20.0 * np.cos(2 * np.pi * turns)
    orders, lines = order_spectrum(waveform, 16)
    (panel,) = spectrum("", "order", "µm", orders.tolist(), [("x", np.abs(lines).tolist())])
    label, place, size = panel.notes[0]
    assert orders[int(np.argmax(np.abs(lines)))] == 0.1875
    assert place == pytest.approx(0.17, abs=0.001)
    assert size == pytest.approx(41.6, rel=0.01)
    assert label.startswith("0.17X 41")
