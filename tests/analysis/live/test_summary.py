"""Run summaries of known motion."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import EndReason, SegmentEnd
from analysis.signals.header import Limits, RunHeader, Severity
from analysis.signals.units import MICROMETRE, RPM

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

Maker = Callable[..., "Bench"]
FloatArray = NDArray[np.float64]


def summary_of(bench: "Bench", header: RunHeader, codes: NDArray[np.int16], end: SegmentEnd) -> RunSummary:
    header = replace(header, acquisition=bench.acquisition, settings=bench.settings)
    builder = SummaryBuilder(header)
    for snapshot in bench.snapshots(codes):
        builder.add_snapshot(snapshot)
    builder.end_segment(end)
    return builder.summary()


def run_up_of_the_thesis(bench: "Bench") -> NDArray[np.int16]:
    """Return a run-up from 1,000 to 15,600 r/min in 20 s; 0.49X from 11,000 to 14,600, 0.17X from 14,700 r/min."""
    start, rise = 1000 / 60, 14_600 / 60 / 20
    angle = bench.ramp(start, 15_600 / 60, 20.0)

    def motion(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        speed = np.sqrt(start**2 + 2 * rise * theta / (2 * np.pi)) * 60  # r/min
        inner = 14 * MICROMETRE * np.sqrt(np.clip((speed - 11_000) / 1100, 0, 1)) * (speed < 14_600)
        outer = 52 * MICROMETRE * np.sqrt(np.clip((speed - 14_700) / 1470, 0, 1))
        z = 2.5 * MICROMETRE * np.exp(1j * theta) + 1.5 * MICROMETRE * np.exp(2j * theta)
        z += inner * np.exp(0.49j * theta) + outer * np.exp(0.17j * theta)
        return z.real, z.imag

    return bench.codes(angle, motion, 20.0)


def test_run_up_summary_contains_the_whirl_onset(make_bench: Maker, header: RunHeader) -> None:
    bench = make_bench(rate=50_000.0)
    codes = run_up_of_the_thesis(bench)
    summary = summary_of(bench, header, codes, SegmentEnd(0, codes.shape[1], EndReason.FINISHED))
    inner, outer = summary.whirls
    assert inner.order == pytest.approx(0.49, abs=0.002)
    assert inner.onset.speed == pytest.approx(11_000 * RPM, rel=0.01)
    assert inner.onset.time == pytest.approx(13.7, abs=0.2)
    assert inner.end.speed == pytest.approx(14_600 * RPM, rel=0.01)
    assert inner.amplitude == pytest.approx(14 * MICROMETRE, rel=0.02)
    assert inner.is_forward
    assert outer.order == pytest.approx(0.17, abs=0.003)
    assert outer.onset.speed == pytest.approx(14_700 * RPM, rel=0.01)
    assert outer.amplitude == pytest.approx(41 * MICROMETRE, rel=0.05)
    assert outer.is_forward
    assert summary.highest_speed == pytest.approx(15_600 * RPM, rel=0.005)
    assert summary.lowest_speed < 1400 * RPM
    assert summary.is_gap_free
    assert summary.severity is Severity.ALARM
    assert summary.probes[0].largest_at is not None
    assert summary.probes[0].largest_at.speed == pytest.approx(15_600 * RPM, rel=0.01)
    assert len(summary.rows) > 65
    for row in summary.rows:
        assert abs(abs(row.vectors[0, 0]) - 2.5 * MICROMETRE) < 0.1 * MICROMETRE


def test_quiet_run_has_no_findings(make_bench: Maker, header: RunHeader) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((10 * MICROMETRE, 1.0, 0.4)), 1.25)
    summary = summary_of(bench, header, codes, SegmentEnd(0, 125_000, EndReason.STOPPED))
    assert summary.whirls == ()
    assert summary.severity is Severity.NORMAL
    assert (summary.samples, summary.duration) == (125_000, 1.25)
    assert (summary.snapshots, summary.frames) == (13, 12)
    assert summary.tacho_states == {"good": 13}
    assert summary.tacho is not None
    assert summary.tacho.pulses == 125
    assert summary.clipped == (0, 0, 0)
    assert [probe.name for probe in summary.probes] == ["x", "y"]
    for probe in summary.probes:
        assert probe.gap_mean == pytest.approx(4.5, abs=0.01)
        assert probe.gap_min <= probe.gap_mean <= probe.gap_max
        assert probe.gap_in_window
        assert probe.largest_peak_to_peak == pytest.approx(20 * MICROMETRE, rel=0.05)
    assert summary.largest_peak_to_peak == max(probe.largest_peak_to_peak for probe in summary.probes)
    assert (summary.run, summary.rig, summary.started_ns) == (header.run, header.rig, header.started_ns)


@pytest.mark.parametrize(("radius", "severity"), [(35, Severity.NORMAL), (42, Severity.ALARM), (49, Severity.DANGER)])
def test_severity_follows_from_the_largest_vibration(
    make_bench: Maker, header: RunHeader, radius: float, severity: Severity
) -> None:
    bench = make_bench()
    header = replace(header, limits=Limits(80 * MICROMETRE, 95 * MICROMETRE, 100 * MICROMETRE, 2000.0))
    codes = bench.codes(bench.steady(100.0), bench.circles((radius * MICROMETRE, 1.0, 0.4)), 0.3)
    assert summary_of(bench, header, codes, SegmentEnd(0, 30_000, EndReason.STOPPED)).severity is severity


def test_losses_are_exact_or_a_lower_bound(header: RunHeader) -> None:
    builder = SummaryBuilder(header)
    builder.end_segment(SegmentEnd(0, 1000, EndReason.OVERRUN, lost=70))
    assert (builder.summary().lost, builder.summary().lost_is_exact) == (70, True)
    builder.end_segment(SegmentEnd(1, 500, EndReason.UNPLUGGED, lost=30, lost_is_exact=False))
    summary = builder.summary()
    assert (summary.samples, summary.lost, summary.lost_is_exact) == (1500, 100, False)
    assert not summary.is_gap_free
    assert [end.segment for end in summary.segments] == [0, 1]


def test_summary_before_the_end_counts_the_samples_so_far(make_bench: Maker, header: RunHeader) -> None:
    bench = make_bench()
    builder = SummaryBuilder(header)
    empty = builder.summary()
    assert np.isnan([empty.lowest_speed, empty.highest_speed, empty.probes[0].gap_mean]).all()
    assert (empty.samples, empty.snapshots, empty.tacho, empty.rows) == (0, 0, None, ())
    assert not empty.is_gap_free
    codes = bench.codes(bench.steady(100.0), bench.circles((10 * MICROMETRE, 1.0, 0.4)), 0.5)
    for snapshot in bench.snapshots(codes):
        builder.add_snapshot(snapshot)
    assert builder.summary().samples == 50_000
    builder.end_segment(SegmentEnd(0, 50_000, EndReason.STOPPED))
    assert builder.summary().samples == 50_000


def test_loose_probe_shows_in_gap_and_clipping(make_bench: Maker, header: RunHeader) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(100.0), bench.circles((10 * MICROMETRE, 1.0, 0.4)), 0.6)
    codes[1, 30_000:] = 32767
    summary = summary_of(bench, header, codes, SegmentEnd(0, 60_000, EndReason.STOPPED))
    assert summary.clipped == (0, 30_000, 0)
    assert [probe.gap_in_window for probe in summary.probes] == [True, False]
    assert [probe.outside_calibration for probe in summary.probes] == [0, 30_000]
    assert summary.probes[1].gap_max == pytest.approx(10.0, abs=0.001)


def test_glitches_are_no_findings(make_bench: Maker, header: RunHeader) -> None:
    bench = make_bench()
    codes = bench.codes(bench.steady(30.0), bench.circles((10 * MICROMETRE, 1.0, 0.4)), 6.0)
    for begin in (151_111, 322_222, 455_555):
        codes[0, begin : begin + 2000] -= np.round(3000 * np.hanning(2000)).astype(np.int16)
    assert summary_of(bench, header, codes, SegmentEnd(0, 600_000, EndReason.STOPPED)).whirls == ()
