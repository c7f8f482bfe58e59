"""State and messages of a recording: backlog, loss, clipping, missing samples."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from daq.cli.run_text import status_line
from daq.config.schema import TimingSection
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.simulation.wiring import IntermittentContact
from daq.session.live_update import RunState
from daq.session.offline import summarise
from daq.session.recording.statistics import RecorderStatistics, loss_message, recording_health
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory
from tests.daq.support.device_server import serving
from tests.daq.support.ni_driver import NiDriver
from tests.daq.support.recording import recorded_codes, start_recording, wait_for_state

RATE = 1000.0
TIMING = TimingSection(rate_hz=RATE, block_s=0.1, buffer_s=4)
LONG = [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 60.0, "speed_rpm": 6000.0}]


def statistics_after(backlog: int) -> RecorderStatistics:
    statistics = RecorderStatistics.allocate()
    statistics.start()
    statistics.add_block(SampleBlock(np.zeros((1, 100), np.int16), 0, 0, 0, backlog))
    return statistics


def test_backlog_above_half_the_buffer_gives_a_warning() -> None:
    assert recording_health(statistics_after(2000), RATE, TIMING) == (RunState.RECORDING, "")
    state, message = recording_health(statistics_after(2001), RATE, TIMING)
    assert state is RunState.DEGRADED
    assert message.startswith("the card's buffer of 4 s holds 2.0 s: samples are about to be lost")


def test_loss_message_names_the_segment_and_is_empty_for_a_normal_end() -> None:
    assert loss_message(SegmentEnd(0, 1000, EndReason.STOPPED)) == ""
    assert loss_message(SegmentEnd(0, 1000, EndReason.FINISHED, detail="stopped by speed < 2000 r/min")) == ""
    message = loss_message(SegmentEnd(2, 12_000, EndReason.OVERRUN, 345, lost_is_exact=False, detail="too late"))
    assert message == "segment 2 ended after 12,000 samples: overrun, at least 345 samples lost; too late"
    assert "unplugged, 0 samples lost" in loss_message(SegmentEnd(0, 5, EndReason.UNPLUGGED))


def test_clipping_is_counted_by_channel_and_block() -> None:
    statistics = RecorderStatistics.allocate()
    quiet = np.zeros((3, 100), np.int16)
    clipped = quiet.copy()
    clipped[0, 5:8], clipped[2, 9] = 32767, -32768
    for k, codes in enumerate((quiet, clipped, clipped, quiet)):
        statistics.add_block(SampleBlock(codes, 0, 100 * k, 0))
    assert [statistics.clipped(row) for row in range(3)] == [(6, 2, 300), (0, 0, 0), (2, 2, 300)]


def test_status_names_the_clipped_channel_and_its_samples(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation={"miswiring": "probe y out of reach"}), tmp_path)
    assert run.wait(60)
    run.close()
    (clipped,) = run.latest().status.clipped
    with RunReader(run.path) as reader:
        blocks = [item.codes[1] for item in reader.items() if isinstance(item, SampleBlock)]
    rails = [int(np.count_nonzero((codes == 32767) | (codes == -32768))) for codes in blocks]
    assert (clipped.channel, clipped.samples, clipped.blocks) == ("y", sum(rails), int(np.count_nonzero(rails)))
    assert clipped.last == pytest.approx(2000 * (1 + max(np.flatnonzero(rails))) / 20_000)
    assert f"y CLIPPED {sum(rails):,} in {np.count_nonzero(rails):,} blocks" in status_line(run.latest())


def test_recorded_run_shows_the_lost_contact_of_its_probe(rig: RigFactory, tmp_path: Path) -> None:
    simulated = rig(simulation={"miswiring": "probe x intermittent"}, limits={"hold_s": 0.0})
    run = start_recording(simulated, tmp_path)
    assert run.wait(60)
    run.close()
    codes = recorded_codes(run.path)
    lost = np.abs(codes[0].astype(np.int64)) < 400  # 0.13 V
    fault = IntermittentContact(0, simulated.config.simulation.seed)
    np.testing.assert_array_equal(lost, fault.is_lost(np.arange(codes.shape[1]) / 20_000))
    with RunReader(run.path) as reader:
        summary = summarise(reader)
    assert [probe.outside_calibration for probe in summary.probes] == [np.count_nonzero(lost), 0]
    assert {alarm.probe for alarm in summary.alarms} == {"x"}


def test_there_is_no_warning_before_blocks_are_expected() -> None:
    assert recording_health(RecorderStatistics.allocate(), RATE, TIMING) == (RunState.RECORDING, "")


def test_status_shows_full_buffer_missing_samples_and_reconnection(rig: RigFactory, tmp_path: Path) -> None:
    simulated = rig(simulation={"profile": LONG})
    with serving(NiDriver(lambda: SimulatedCard(simulated), real_time=True)) as server:
        device = {"backend": "nidaqmx", "target": server.target, "deadline_s": 0.4}
        run = start_recording(rig(device=device, simulation={"profile": LONG}, session={"retry_s": 0.2}), tmp_path)
        wait_for_state(run, 60, RunState.RECORDING)
        filling = run.latest().status
        stalled = time.monotonic()
        while filling.state is not RunState.DEGRADED:  # the reader catches up immediately, unseen on a busy machine
            if time.monotonic() > stalled:
                stalled = time.monotonic() + 1.0
                server.driver.stall(30_000)  # of the 40,000 that the card holds
            filling = run.latest().status
        assert 1.0 < filling.backlog <= 2.0
        assert "samples are about to be lost" in filling.detail
        assert "samples are about to be lost" in status_line(replace(run.latest(), status=filling))
        assert filling.lost == 0
        wait_for_state(run, 60, RunState.RECORDING)  # the reader has caught up
        server.freeze()
        silent = wait_for_state(run, 60, RunState.INTERRUPTED)
        assert silent.detail.startswith("no samples for ")
        while "did not respond within its deadline" not in run.latest().status.detail:
            assert not run.wait(0.01)
        assert "reconnecting for 60 s at most" in run.latest().status.detail
        server.thaw()
        wait_for_state(run, 60, RunState.RECORDING)
        while not (lost := run.latest().status.last_loss):
            assert not run.wait(0.01)
        assert lost.startswith("segment 0 ended after ")
        run.stop()
        assert run.wait(60)
        outcome = run.close()
        assert server.tasks == []
    assert [end.segment for end in outcome.ends] == [0, 1]
    assert outcome.exit_code == 5
    with RunReader(run.path) as reader:
        assert reader.is_complete
        assert not reader.is_gap_free


def test_related_counts_are_read_consistently_while_they_change() -> None:
    writer = RecorderStatistics.allocate()
    reader = RecorderStatistics.from_buffer(writer)
    codes = np.zeros((1, 100), np.int16)
    ends = threading.Event()

    def count() -> None:
        for segment in range(300):
            for k in range(3):
                writer.add_block(SampleBlock(codes, segment, 100 * k, 0))
            writer.add_end(SegmentEnd(segment, 300, EndReason.OVERRUN))
        ends.set()

    thread = threading.Thread(target=count)
    thread.start()
    seen = []
    while not ends.is_set():
        seen.append(reader.position)
    thread.join(60)
    assert seen == sorted(seen)
    assert reader.position == (300, 0)


def test_reader_is_not_blocked_by_a_writer_killed_during_a_change() -> None:
    statistics = statistics_after(7)
    statistics.changes += 1  # as at the start of a change
    assert statistics.position == (0, 100)
