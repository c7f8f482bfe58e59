"""Recording a simulated rig: file contents, live results, stop conditions and errors."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.replay import ReplaySource
from daq.drivers.simulation.card import SimulatedCard
from daq.errors import RigError
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.offline import summarise
from daq.session.recording.recorded_run import RecordedRun
from daq.session.recording.recorder import ResultsEnded, _Recorder, run_header
from daq.session.recording.ring import BlockRing
from daq.session.recording.statistics import RecorderStatistics
from recordings.mcap.parts import PartLimits, PartWriter, file_ids
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory
from tests.daq.support.reblocking import reblocked
from tests.daq.support.recording import (
    REAL_TIME,
    RUN,
    NoModel,
    UpdateList,
    recorded_codes,
    recording_request,
    start_recording,
)

LONG_RUN = {"profile": [{"time_s": 0, "speed_rpm": 6000}, {"time_s": 60, "speed_rpm": 6000}], "pace": "real time"}


def card_codes(rig: Rig) -> NDArray[np.int16]:
    card = SimulatedCard(rig)
    return card.next_codes(card.n_samples)


def is_identical(a: object, b: object) -> bool:
    """Return whether two results are equal bit for bit, nested dataclasses included."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(is_identical, a, b))
    if isinstance(a, float):
        return isinstance(b, float) and np.float64(a).tobytes() == np.float64(b).tobytes()
    if hasattr(a, "__slots__") and type(a).__module__.startswith("analysis."):
        return type(a) is type(b) and all(is_identical(getattr(a, n), getattr(b, n)) for n in a.__slots__)
    return a == b


def replayed_snapshots(path: Path, block: int | None) -> list[Snapshot]:
    snapshots: list[Snapshot] = []
    with RunReader(path) as reader:
        analysis = LiveAnalysis(reader.header, NoModel(), [], snapshots.append)
    with closing(ReplaySource(path, None)) as source:
        for item in reblocked(source, block):
            analysis.process(item, Status(RunState.REPLAYING))
    return snapshots


def test_file_holds_all_codes_of_the_card(rig: RigFactory, tmp_path: Path) -> None:
    small = rig()
    run = start_recording(small, tmp_path)
    assert run.wait(60)
    outcome = run.close()
    assert (outcome.exit_code, outcome.message) == (0, "")
    assert [end.reason for end in outcome.ends] == [EndReason.FINISHED]
    np.testing.assert_array_equal(recorded_codes(run.path), card_codes(small))
    with RunReader(run.path) as reader:
        assert reader.is_complete
        assert reader.header == run.header


def test_replay_gives_the_live_results_bit_for_bit(rig: RigFactory, tmp_path: Path) -> None:
    updates = UpdateList()
    run = start_recording(rig(simulation=REAL_TIME), tmp_path, updates)
    assert run.wait(60)
    assert run.close().skipped == 0
    live = [update.snapshot for update in updates.updates if update.snapshot is not None]
    by_sample = {snapshot.sample: snapshot for snapshot in live}
    assert len(by_sample) == 20
    for block in (None, 400, 2000, 1777):
        replayed = replayed_snapshots(run.path, block)
        assert [s.sample for s in replayed] == sorted(by_sample)
        assert all(is_identical(by_sample[s.sample], s) for s in replayed)


def test_summary_from_stored_results_equals_that_from_the_samples(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path)
    assert run.wait(60)
    live = run.summary()
    run.close()
    with RunReader(run.path) as reader:
        stored = summarise(reader)
        assert is_identical(live, stored)
        reader_of_samples = _ReaderWithSkippedSamples(reader)
        assert is_identical(summarise(reader_of_samples), stored)  # type: ignore[arg-type] # a reader in all but its results


class _ReaderWithSkippedSamples:
    """A reader of a run whose live results are incomplete."""

    def __init__(self, reader: RunReader) -> None:
        self._reader = reader
        self.skipped_samples = 1

    def __getattr__(self, name: str) -> object:
        return getattr(self._reader, name)


def test_run_of_given_duration_stops_by_itself(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path, duration=0.5)
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 0
    assert outcome.ends[0].reason is EndReason.FINISHED
    assert 10_000 <= outcome.ends[0].samples <= 12_000


def test_run_stopped_by_the_user_is_complete(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path)
    while not run.status().samples:
        assert not run.wait(0.01)
    run.stop()
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 130
    with RunReader(run.path) as reader:
        assert reader.is_complete
        assert reader.n_samples == outcome.ends[0].samples > 0


def test_stalled_analysis_loses_no_sample_and_counts_skipped_ones(rig: RigFactory, tmp_path: Path) -> None:
    long = rig(
        timing={"rate_hz": 20_000.0, "block_s": 0.01, "buffer_s": 2.0},
        simulation={"profile": [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 40.0, "speed_rpm": 6000.0}]},
    )
    run = start_recording(long, tmp_path, UpdateList(stall=0.05))  # flat out: the analysis cannot keep up
    assert run.wait(120)
    outcome = run.close()
    assert outcome.skipped > 0
    assert outcome.exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.n_samples == 800_000
        assert reader.skipped_samples == outcome.skipped
        assert summarise(reader).snapshots == 400


def test_recording_continues_after_an_error_of_the_analysis(rig: RigFactory, tmp_path: Path) -> None:
    class FailingList(UpdateList):
        def offer(self, update: LiveUpdate) -> None:
            if update.status.state is RunState.RECORDING and not update.status.detail:
                raise ZeroDivisionError("a view that fails")

    run = start_recording(rig(simulation=REAL_TIME), tmp_path, FailingList())
    assert run.wait(60)
    status = run.latest().status
    outcome = run.close()
    assert "live analysis stopped: ZeroDivisionError: a view that fails" in status.detail
    assert outcome.exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.n_samples == 40_000


def test_missing_device_is_reported_and_leaves_nothing_behind(rig: RigFactory, tmp_path: Path) -> None:
    before = threading.active_count()
    with pytest.raises(RigError) as caught:
        start_recording(rig(device={"backend": "nidaqmx"}), tmp_path)
    assert caught.value.exit_code == 3
    assert not list(tmp_path.glob("*.mcap"))
    assert threading.active_count() == before


def test_existing_run_is_never_overwritten(rig: RigFactory, tmp_path: Path) -> None:
    (tmp_path / f"{RUN}.mcap").write_bytes(b"the only evidence")
    with pytest.raises(RigError, match=RUN) as caught:
        start_recording(rig(), tmp_path)
    assert caught.value.exit_code == 2
    assert (tmp_path / f"{RUN}.mcap").read_bytes() == b"the only evidence"


def test_full_disk_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"storage\.reserve_gb"):
        start_recording(rig(storage={"reserve_gb": 1e9}), tmp_path)


def test_split_run_loses_no_sample_between_its_files(rig: RigFactory, tmp_path: Path) -> None:
    small = rig(storage={"split_minutes": 0.01})
    run = start_recording(small, tmp_path)
    assert run.wait(60)
    assert run.close().exit_code == 0
    files = [tmp_path / f"{name}.mcap" for name in file_ids(run.path)]
    assert len(files) == 4  # of 0.6 s at least, in blocks of 0.1 s
    np.testing.assert_array_equal(np.hstack([recorded_codes(file) for file in files]), card_codes(small))
    with RunReader(files[1]) as reader:
        assert reader.is_gap_free
        assert summarise(reader).snapshots == 6


def test_disk_that_fills_up_ends_the_recording_with_a_complete_file(rig: RigFactory, tmp_path: Path) -> None:
    full = recording_request(rig(storage={"reserve_gb": 1e9}, simulation=REAL_TIME), tmp_path)
    source = open_source(full.rig)
    here, there = multiprocessing.Pipe()
    ring = BlockRing.create(3, 2001, 16)
    before = signal.getsignal(signal.SIGTERM)
    with closing(source):
        header = run_header(full, source)
        threading.Timer(1.0, here.send, [ResultsEnded(0)]).start()
        writer = PartWriter(full.path, header, PartLimits())
        _Recorder(full, source, writer, ring, RecorderStatistics.allocate(), there).run()
    signal.signal(signal.SIGTERM, before)
    with RunReader(full.path) as reader:
        assert reader.is_complete
        (end,) = reader.segment_ends
    assert end.is_gap_free
    assert "recording stopped: " in end.detail
    assert "storage.reserve_gb = 1e+09" in end.detail


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX only")
def test_recorder_completes_the_file_after_the_controlling_process_is_killed(rig: RigFactory, tmp_path: Path) -> None:
    small = rig(
        simulation={**REAL_TIME, "profile": [{"time_s": 0, "speed_rpm": 6000}, {"time_s": 60, "speed_rpm": 6000}]}
    )
    script = textwrap.dedent(f"""
        import sys
        import time
        sys.path.insert(0, {str(Path(__file__).parents[4])!r})
        from pathlib import Path
        from tests.daq.support.recording import NoModel, recording_request
        from daq.config.loader import load_rig
        from daq.session.recording.recorded_run import RecordedRun
        if __name__ == "__main__":
            rig = load_rig(Path({str(small.path)!r}))
            run = RecordedRun(recording_request(rig, Path({str(tmp_path)!r})), NoModel())
            while run.status().samples < 12_000:
                time.sleep(0.01)
            print(run._process.pid, flush=True)
            run.wait(60)
    """)
    main = tmp_path / "controlling.py"
    main.write_text(script)
    controlling = subprocess.Popen([sys.executable, main], stdout=subprocess.PIPE, text=True)
    assert controlling.stdout is not None
    recorder = int(controlling.stdout.readline())
    controlling.kill()
    controlling.wait(60)
    controlling.stdout.close()
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and _is_running(recorder):
        time.sleep(0.05)
    assert not _is_running(recorder)
    with RunReader(tmp_path / f"{RUN}.mcap") as reader:
        assert reader.is_complete
        assert reader.n_samples > 10_000
        assert reader.skipped_samples == reader.n_samples  # all, since the results may be incomplete


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(sys.platform == "win32", reason="SIGSTOP exists on POSIX only")
def test_recorder_that_ignores_the_stop_is_killed_and_its_file_is_readable(rig: RigFactory, tmp_path: Path) -> None:
    run = RecordedRun(recording_request(rig(simulation=LONG_RUN), tmp_path), NoModel(), stop_deadline=0.5)
    while run.latest().status.samples < 30_000:
        assert not run.wait(0.05)
    os.kill(run._process.pid or 0, signal.SIGSTOP)
    run.stop()
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 5
    assert (
        outcome.message == "the recorder did not stop within 0.5 s and was killed; its file holds all flushed samples"
    )
    with RunReader(run.path) as reader:
        assert not reader.is_complete
        assert reader.n_samples >= 20_000
