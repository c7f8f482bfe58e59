"""Summaries as text: run-up and run-down, run-out, alarms, whirl, segments and backlog."""

import contextlib
import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from daq.cli.run_text import summary_parts
from daq.cli.terminal import print_output
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.schemas.summary import SummarySchema, summary_schema
from daq.session.offline import summarise
from daq.session.recording.recorder import run_header
from recordings.mcap.reader import RunReader
from recordings.mcap.writer import RunWriter
from tests.daq.support.recorded_bench import record_run
from tests.daq.support.recording import recording_request

RigFactory = Callable[..., Rig]

PROFILE = [(0.0, 600.0), (3.0, 600.0), (7.0, 9000.0), (8.0, 9000.0), (12.0, 1500.0)]
BENCH = {
    "profile": [{"time_s": time_s, "speed_rpm": speed_rpm} for time_s, speed_rpm in PROFILE],
    "whirl": [{"order": 0.48, "onset_rpm": 5000.0, "end_rpm": 19_000.0, "amplitude_um": 14.0}],
    "run_out_um": 2.0,
    "glitches_per_s": 0.0,
}


def summary_lines(summary: SummarySchema) -> list[str]:
    """Return a summary as printed to a file."""
    with contextlib.redirect_stdout(io.StringIO()) as output:
        print_output(*summary_parts(summary))
    return output.getvalue().splitlines()


def summarised(rig: Rig, folder: Path) -> tuple[SummarySchema, list[str]]:
    with RunReader(record_run(rig, folder)) as reader:
        summary = summary_schema(summarise(reader))
    return summary, summary_lines(summary)


def test_summary_separates_run_up_and_run_down_with_run_out_and_whirl(rig: RigFactory, tmp_path: Path) -> None:
    limits = {"peak_to_peak_alarm_um": 20.0, "hold_s": 0.2}
    summary, lines = summarised(rig(simulation=BENCH, runout={"slow_roll_rpm": 700.0}, limits=limits), tmp_path)
    assert any(
        re.match(r"run-out +at 1X x 1\.\d µm .* from slow roll of this run up to 700 r/min", line) for line in lines
    )
    rows = [line for line in lines if re.search(r"\d [▲▼] ", line) and "∠" in line]
    assert sum("▲" in line for line in rows) == 5
    assert sum("▼" in line for line in rows) == 5
    assert rows[0].endswith("as measured")  # the slow roll itself
    assert all(line.endswith("compensated") for line in rows[1:])
    assert any(
        re.match(r"sub-synchronous  0\.48X from [45],\d+ ▲ to [45],\d+ ▼ r/min, forward", line) for line in lines
    )
    assert any(
        re.match(r"hysteresis +0\.48X starts at [45],\d+ on the run-up, ends at [45],\d+ on the run-down", line)
        for line in lines
    )
    assert any(
        re.match(r"alarm +ALARM at x from \d\.\d s, \d,\d+ r/min until \d+\.\d s, up to [\d.]+ µm peak-to-peak", line)
        for line in lines
    )
    vibration = summary.largest_peak_to_peak_um
    assert vibration is not None
    at = max((probe for probe in summary.probes), key=lambda probe: probe.largest_peak_to_peak_um or 0.0).largest_at
    assert at is not None
    assert at.speed_rpm is not None
    fraction = max(probe.largest_clearance_fraction or 0.0 for probe in summary.probes)
    assert fraction == pytest.approx(vibration / 200.0, rel=1e-3)  # of twice the 100 µm of the clearance's radius
    assert any(f", {100 * fraction:.0f} % of the clearance" in line for line in lines)
    zone = summary.standards[0]
    assert zone.limit_peak_to_peak_um is not None
    assert zone.limit_peak_to_peak_um == pytest.approx(4800.0 / at.speed_rpm**0.5, rel=1e-4)
    assert zone.limit_ratio == pytest.approx(vibration / zone.limit_peak_to_peak_um, rel=1e-3)
    assert any(
        re.match(r"for information  ISO 20816-3 A/B \d+, B/C \d+, C/D \d+; API 617 .* floating-ring bearings", each)
        for each in lines
    )
    (hysteresis,) = summary.hysteresis
    assert hysteresis.width_rpm == pytest.approx(0.0, abs=300.0)  # the simulated film has none
    assert {row.ramp_direction for row in summary.by_speed} == {"run-up", "run-down"}


def test_summary_reports_a_missing_slow_roll(rig: RigFactory, tmp_path: Path) -> None:
    steady = {"profile": [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 2.0, "speed_rpm": 3000.0}]}
    summary, lines = summarised(rig(simulation=steady, runout={"slow_roll_rpm": 700.0}), tmp_path)
    assert summary.runout is not None
    assert not summary.runout.is_known
    wanted = "run-out          unknown: no slow roll of this run up to 700 r/min; 1X and 2X are as measured"
    assert wanted in lines


def lines_after(rig: Rig, path: Path, *ends: SegmentEnd, backlog: int = 0) -> list[str]:
    """Return the summary of a run with these segments, each of one block that was read with a backlog."""
    source = open_source(rig)
    writer = RunWriter(path, run_header(recording_request(rig, path.parent), source))
    for end in ends:
        if end.samples:
            writer.write_block(SampleBlock(np.zeros((3, end.samples), np.int16), end.segment, 0, 0, backlog))
        writer.write_segment_end(end)
    writer.close()
    source.close()
    with RunReader(path) as reader:
        return summary_lines(summary_schema(summarise(reader), delivery=reader.delivery))


def test_summary_reports_how_each_segment_ended(rig: RigFactory, tmp_path: Path) -> None:
    overrun = SegmentEnd(0, 1000, EndReason.OVERRUN, 500, lost_is_exact=False, detail="too late")
    gone = SegmentEnd(1, 2000, EndReason.UNPLUGGED, detail="the card is gone")
    lines = lines_after(rig(), tmp_path / "gaps.mcap", overrun, gone)
    assert lines[1].startswith("INCOMPLETE: at least 500 samples lost")
    assert lines[2:4] == [
        "segment 0        1,000 samples, then overrun, at least 500 lost: too late",
        "segment 1        2,000 samples, then unplugged: the card is gone",
    ]
    stopped = SegmentEnd(0, 1000, EndReason.FINISHED, detail="stopped by speed < 1500 r/min")
    assert "end              stopped by speed < 1500 r/min" in lines_after(rig(), tmp_path / "stopped.mcap", stopped)


@pytest.mark.parametrize(
    ("part", "expected"),
    [(0.25, "25 %"), (0.75, "75 %; close other programs or lower timing.rate_hz")],
)
def test_summary_reports_the_largest_backlog_as_a_fraction_of_the_buffer(
    rig: RigFactory, tmp_path: Path, part: float, expected: str
) -> None:
    chosen = rig(timing={"buffer_s": 4.0})
    rate = run_header(recording_request(chosen, tmp_path), open_source(chosen)).acquisition.rate
    end = SegmentEnd(0, 1000, EndReason.STOPPED)
    lines = lines_after(chosen, tmp_path / "late.mcap", end, backlog=round(4.0 * part * rate))
    assert f"backlog          at most {4.0 * part:.2f} s in the card's buffer of 4 s, {expected}" in lines


def test_summary_of_a_run_that_never_triggered_reports_only_that(rig: RigFactory, tmp_path: Path) -> None:
    end = SegmentEnd(0, 0, EndReason.STOPPED, detail="speed > 9000 r/min was not reached")
    lines = lines_after(rig(), tmp_path / "never.mcap", end)
    assert lines[1:] == [
        "complete, no samples lost  nothing was recorded",
        "end              speed > 9000 r/min was not reached",
    ]


@pytest.mark.parametrize("marks", [1, 2])
def test_summary_reports_indistinguishable_keyphasor_marks(rig: RigFactory, tmp_path: Path, marks: int) -> None:
    steady = {"profile": [{"time_s": time_s, "speed_rpm": 6000.0} for time_s in (0.0, 2.0)], "glitches_per_s": 0.0}
    tacho = {"pulses_per_revolution": marks, "response_time_s": 1e-4}
    summary, lines = summarised(rig(simulation=steady, tacho=tacho), tmp_path)
    assert summary.tacho is not None
    assert summary.tacho.phase_reference_is_arbitrary is (marks > 1)
    assert any("marks are indistinguishable" in line for line in lines) is (marks > 1)
    assert summary.highest_speed_rpm == pytest.approx(6000.0, rel=0.02)
