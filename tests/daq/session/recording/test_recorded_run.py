import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.replay import open_replay
from daq.drivers.simulation.card import SimulatedCard
from daq.errors import RigError
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.offline import summarise
from daq.session.recording.messages import ResultsEnded
from daq.session.recording.recorder import _Recorder, run_header
from daq.session.recording.ring import BlockRing
from daq.session.recording.statistics import RecorderStatistics
from recordings.mcap.parts import PartLimits, PartWriter, file_ids
from recordings.mcap.reader import RunReader
from tests.daq.support.recording import (
    REAL_TIME,
    RUN,
    NoModel,
    UpdateList,
    recorded_codes,
    recording_request,
    start_recording,
)

RigFactory = Callable[..., Rig]


def codes_of_card(rig: Rig) -> NDArray[np.int16]:
    card = SimulatedCard(rig)
    return card.next_codes(card.n_samples)


def identical(a: object, b: object) -> bool:
    """Whether two results hold the same bits, whatever they are made of."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(identical, a, b))
    if isinstance(a, float):
        return isinstance(b, float) and np.float64(a).tobytes() == np.float64(b).tobytes()
    if hasattr(a, "__slots__") and type(a).__module__.startswith("analysis."):
        return type(a) is type(b) and all(identical(getattr(a, n), getattr(b, n)) for n in a.__slots__)
    return a == b


def snapshots_of(path: Path, block: int | None) -> list[Snapshot]:
    kept: list[Snapshot] = []
    with RunReader(path) as reader:
        analysis = LiveAnalysis(reader.header, NoModel().at, [], kept.append)
    with closing(open_replay(path, None, block=block)) as source:
        for item in source.blocks():
            analysis.process(item, Status(RunState.REPLAYING))
    return kept


def test_run_is_recorded_whole_with_the_codes_that_the_card_gave(rig: RigFactory, tmp_path: Path) -> None:
    small = rig()
    run = start_recording(small, tmp_path)
    assert run.wait(60)
    outcome = run.close()
    assert (outcome.exit_code, outcome.message) == (0, "")
    assert [end.reason for end in outcome.ends] == [EndReason.FINISHED]
    np.testing.assert_array_equal(recorded_codes(run.path), codes_of_card(small))
    with RunReader(run.path) as reader:
        assert reader.is_complete
        assert reader.header == run.header


def test_live_results_are_kept_beside_the_samples_and_replay_bit_for_bit(rig: RigFactory, tmp_path: Path) -> None:
    live: list[Snapshot] = []
    screen = UpdateList()
    run = start_recording(rig(simulation=REAL_TIME), tmp_path, screen)
    assert run.wait(60)
    assert run.close().skipped == 0
    live = [frame.snapshot for frame in screen.updates if frame.snapshot is not None]
    numbers = {snapshot.sample: snapshot for snapshot in live}
    assert len(numbers) == 20
    for block in (None, 400, 2000, 1777):
        again = snapshots_of(run.path, block)
        assert [s.sample for s in again] == sorted(numbers)
        assert all(identical(numbers[s.sample], s) for s in again)


def test_summary_from_the_kept_results_equals_the_one_from_the_samples(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path)
    assert run.wait(60)
    live = run.summary()
    run.close()
    with RunReader(run.path) as reader:
        kept = summarise(reader)
        assert identical(live, kept)
        reader_of_samples = _Unkept(reader)
        assert identical(summarise(reader_of_samples), kept)  # type: ignore[arg-type] # a reader in all but its results


class _Unkept:
    """A reader whose live results were not complete."""

    def __init__(self, reader: RunReader) -> None:
        self._reader = reader
        self.skipped_samples = 1

    def __getattr__(self, name: str) -> object:
        return getattr(self._reader, name)


def test_run_of_given_length_stops_by_itself(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(simulation=REAL_TIME), tmp_path, duration=0.5)
    assert run.wait(60)
    outcome = run.close()
    assert outcome.exit_code == 0
    assert outcome.ends[0].reason is EndReason.FINISHED
    assert 10_000 <= outcome.ends[0].samples <= 12_000


def test_run_stopped_by_hand_is_complete(rig: RigFactory, tmp_path: Path) -> None:
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


def test_stalled_analysis_loses_no_sample_and_says_what_it_skipped(rig: RigFactory, tmp_path: Path) -> None:
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


def test_analysis_that_fails_is_told_and_the_recording_goes_on(rig: RigFactory, tmp_path: Path) -> None:
    class Broken(UpdateList):
        def offer(self, frame: LiveUpdate) -> None:
            if frame.status.state is RunState.RECORDING and not frame.status.detail:
                raise ZeroDivisionError("a screen that fails")

    run = start_recording(rig(simulation=REAL_TIME), tmp_path, Broken())
    assert run.wait(60)
    status = run.latest().status
    outcome = run.close()
    assert "live analysis stopped: ZeroDivisionError: a screen that fails" in status.detail
    assert outcome.exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.n_samples == 40_000


def test_missing_device_is_told_and_leaves_nothing_behind(rig: RigFactory, tmp_path: Path) -> None:
    before = threading.active_count()
    with pytest.raises(RigError) as caught:
        start_recording(rig(device={"backend": "nidaqmx"}), tmp_path)
    assert caught.value.exit_code == 3
    assert not list(tmp_path.glob("*.mcap"))
    assert threading.active_count() == before


def test_run_that_exists_is_never_overwritten(rig: RigFactory, tmp_path: Path) -> None:
    (tmp_path / f"{RUN}.mcap").write_bytes(b"the only evidence")
    with pytest.raises(RigError, match=RUN) as caught:
        start_recording(rig(), tmp_path)
    assert caught.value.exit_code == 2
    assert (tmp_path / f"{RUN}.mcap").read_bytes() == b"the only evidence"


def test_disk_that_is_full_already_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"storage\.reserve_gb"):
        start_recording(rig(storage={"reserve_gb": 1e9}), tmp_path)


def test_run_that_is_split_loses_no_sample_between_its_files(rig: RigFactory, tmp_path: Path) -> None:
    small = rig(storage={"split_minutes": 0.01})
    run = start_recording(small, tmp_path)
    assert run.wait(60)
    assert run.close().exit_code == 0
    files = [tmp_path / f"{name}.mcap" for name in file_ids(run.path)]
    assert len(files) == 4  # of 0.6 s at least, in blocks of 0.1 s
    np.testing.assert_array_equal(np.hstack([recorded_codes(file) for file in files]), codes_of_card(small))
    with RunReader(files[1]) as reader:
        assert reader.is_gap_free
        assert summarise(reader).snapshots == 6


def test_disk_that_fills_up_ends_the_recording_cleanly(rig: RigFactory, tmp_path: Path) -> None:
    full = recording_request(rig(storage={"reserve_gb": 1e9}, simulation=REAL_TIME), tmp_path)
    source = open_source(full.rig)
    here, there = multiprocessing.Pipe()
    ring = BlockRing.create(3, 2001, 16)
    before = signal.getsignal(signal.SIGTERM)
    with closing(source):
        header = run_header(full, source)
        threading.Timer(1.0, here.send, [ResultsEnded(0)]).start()
        writer = PartWriter(full.path, header, PartLimits())
        _Recorder(full, source, writer, ring, RecorderStatistics(RecorderStatistics.allocate()), there).run()
    signal.signal(signal.SIGTERM, before)
    with RunReader(full.path) as reader:
        assert reader.is_complete
        (end,) = reader.segment_ends
    assert end.is_gap_free
    assert "recording stopped: " in end.detail
    assert "storage.reserve_gb = 1e+09" in end.detail


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX only")
def test_recorder_finishes_the_file_when_the_watching_process_is_killed(rig: RigFactory, tmp_path: Path) -> None:
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
    main = tmp_path / "watching.py"
    main.write_text(script)
    watching = subprocess.Popen([sys.executable, main], stdout=subprocess.PIPE, text=True)
    assert watching.stdout is not None
    recorder = int(watching.stdout.readline())
    watching.kill()
    watching.wait(60)
    watching.stdout.close()
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and _is_running(recorder):
        time.sleep(0.05)
    assert not _is_running(recorder)
    with RunReader(tmp_path / f"{RUN}.mcap") as reader:
        assert reader.is_complete
        assert reader.n_samples > 10_000
        assert reader.skipped_samples == reader.n_samples  # its results are not to be trusted as the whole story


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"
