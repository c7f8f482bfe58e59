"""However a recording ends, its file is complete and the device is released."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing import Pipe
from pathlib import Path

import pytest

from analysis.signals.blocks import EndReason, SourceItem
from analysis.signals.header import Acquisition
from daq.cli.recording import follow
from daq.cli.terminal import TerminalOutput
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.source import Source
from daq.session.live_update import LiveUpdate
from daq.session.recording.recorder import AcquisitionEnded, DeviceOpened, FileClosed, _Recorder, run_header
from daq.session.recording.ring import BlockRing
from daq.session.recording.statistics import RecorderStatistics
from daq.session.run import RunOutcome
from daq.stop_flag import StopFlag
from recordings.mcap.parts import PartLimits, PartWriter
from recordings.mcap.reader import RunReader
from recordings.mcap.results import EncodedResult
from tests.daq.support.commands import POSIX, REAL_TIME_MINUTE, record_command, recorded_samples
from tests.daq.support.recording import UpdateList, recording_request, start_recording

RigFiles = Callable[..., Path]
RigFactory = Callable[..., Rig]

PAGE = re.compile(r"page (http://[\d.:]+)/")
MIN_SAMPLES = 6_000  # per channel, recorded before the run is stopped


@pytest.fixture
def environment(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    cache = str(tmp_path_factory.getbasetemp() / "cache")
    return os.environ | {"RIG_DATA": str(tmp_path / "data"), "RIG_CACHE": cache}


def wait_for_samples(address: str) -> None:
    deadline = time.monotonic() + 60
    while recorded_samples(address) < MIN_SAMPLES:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def only_run(folder: Path) -> RunReader:
    (path,) = folder.glob("*.mcap")
    return RunReader(path)


@POSIX
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_to_all_processes_ends_the_recording_with_a_complete_file(
    number: signal.Signals, rig_file: RigFiles, tmp_path: Path, environment: dict[str, str]
) -> None:
    rig = rig_file(simulation=REAL_TIME_MINUTE, limits={"speed_rpm": 4000.0})
    process = subprocess.Popen(
        record_command(rig),
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    err = ""
    for line in process.stderr:
        err += line
        if found := PAGE.search(line):
            wait_for_samples(found[1])
            break
    os.killpg(process.pid, number)
    out, more = process.communicate(timeout=120)
    assert process.returncode == 130, err + more
    assert "complete, no samples lost" in out
    with only_run(tmp_path / "data") as reader:
        assert reader.is_gap_free
        assert reader.n_samples >= MIN_SAMPLES


@POSIX
def test_closed_terminal_ends_the_recording_with_a_complete_file(
    rig_file: RigFiles, tmp_path: Path, environment: dict[str, str]
) -> None:
    import pty  # noqa: PLC0415 - POSIX only

    rig = rig_file(simulation=REAL_TIME_MINUTE, limits={"speed_rpm": 4000.0})
    process, terminal = pty.fork()
    if process == 0:
        os.execve(sys.executable, record_command(rig), environment)  # noqa: S606 - the terminal is this process's own
    output = b""
    while (found := PAGE.search(output.decode(errors="replace"))) is None:
        output += os.read(terminal, 4096)
    wait_for_samples(found[1])
    os.close(terminal)
    deadline = time.monotonic() + 120
    while os.waitpid(process, os.WNOHANG)[0] == 0:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    with only_run(tmp_path / "data") as reader:
        assert reader.is_gap_free
        assert reader.n_samples >= MIN_SAMPLES


class FailingSource:
    """A source that raises an unexpected error after three blocks."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self.closed = False

    @property
    def acquisition(self) -> Acquisition:
        return self._source.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        for count, item in enumerate(self._source.blocks()):
            if count == 3:
                raise ZeroDivisionError("in the middle of a run")
            yield item

    def stop(self) -> None:
        self._source.stop()

    def close(self) -> None:
        self.closed = True
        self._source.close()


@pytest.fixture
def own_handlers() -> Iterator[None]:
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.usefixtures("own_handlers")
def test_error_in_the_recorder_completes_the_file_and_releases_the_device(rig: RigFactory, tmp_path: Path) -> None:
    made = recording_request(rig(), tmp_path)
    source = FailingSource(open_source(made.rig))
    header = run_header(made, source)
    here, there = Pipe()
    ring = BlockRing.create(3, 2001, 16)
    with closing(here):
        recorder = _Recorder(
            made,
            source,
            PartWriter(made.path, header, PartLimits()),
            ring,
            RecorderStatistics.allocate(),
            there,
        )
        threading.Timer(0.5, here.send, ["not a command"]).start()
        threading.Timer(1.0, here.close).start()
        recorder.run()
    assert source.closed
    with RunReader(made.path) as reader:
        assert reader.n_samples == 3 * 2000
        assert [end.reason for end in reader.segment_ends] == [EndReason.CUT]


@pytest.mark.usefixtures("own_handlers")
def test_error_in_the_recorder_is_reported(rig: RigFactory, tmp_path: Path) -> None:
    made = recording_request(rig(), tmp_path)
    source = FailingSource(open_source(made.rig))
    header = run_header(made, source)
    here, there = Pipe()
    ring = BlockRing.create(3, 2001, 16)
    messages: list[object] = []

    def watch() -> None:
        while not any(isinstance(message, AcquisitionEnded) for message in messages):
            messages.append(here.recv())
        here.send("not a command, which is ignored")
        here.close()

    watching = threading.Thread(target=watch)
    watching.start()
    recorder = _Recorder(
        made,
        source,
        PartWriter(made.path, header, PartLimits()),
        ring,
        RecorderStatistics.allocate(),
        there,
    )
    recorder.run()
    watching.join(5)
    assert [type(message) for message in messages] == [DeviceOpened, AcquisitionEnded]
    assert "stopped by a program error: ZeroDivisionError: in the middle of a run" in recorder._message


@pytest.mark.usefixtures("own_handlers")
def test_error_in_the_recorders_listener_completes_the_file_and_is_reported(rig: RigFactory, tmp_path: Path) -> None:
    made = recording_request(rig(simulation=REAL_TIME_MINUTE, limits={"speed_rpm": 4000.0}), tmp_path)
    source = open_source(made.rig)
    here, there = Pipe()
    ring = BlockRing.create(3, 2001, 16)
    messages: list[object] = []

    def watch() -> None:
        messages.append(here.recv())
        here.send(EncodedResult("/nonsense", 0, b"", 0))
        while not isinstance(messages[-1], FileClosed):
            messages.append(here.recv())

    watching = threading.Thread(target=watch)
    watching.start()
    with closing(here):
        header = run_header(made, source)
        writer = PartWriter(made.path, header, PartLimits())
        _Recorder(made, source, writer, ring, RecorderStatistics.allocate(), there).run()
        watching.join(10)
    closed = messages[-1]
    assert isinstance(closed, FileClosed)
    assert closed.message.startswith("recording stopped by a program error: ValueError: topic: '/nonsense'")
    with RunReader(made.path) as reader:
        assert reader.is_complete
        assert [end.reason for end in reader.segment_ends] == [EndReason.STOPPED]


def test_view_that_fails_at_every_update_does_not_stop_the_recording(rig: RigFactory, tmp_path: Path) -> None:
    class FailingView(UpdateList):
        def offer(self, update: LiveUpdate) -> None:
            raise ZeroDivisionError("a view that fails")

    run = start_recording(rig(simulation={"pace": "real time"}), tmp_path, FailingView())
    assert run.wait(60)
    assert run.close().exit_code == 0
    with RunReader(run.path) as reader:
        assert reader.n_samples == 40_000


def test_error_in_the_terminal_output_closes_the_run() -> None:
    class FailingRun:
        closed = False

        def wait(self, timeout: float) -> bool:
            return False

        def latest(self) -> LiveUpdate:
            raise ZeroDivisionError("while the line is made")

        def close(self) -> RunOutcome:
            self.closed = True
            return RunOutcome(())

    run = FailingRun()
    with pytest.raises(ZeroDivisionError):
        follow(run, StopFlag(), TerminalOutput())  # type: ignore[arg-type] # has the methods of a run that are used
    assert run.closed
