"""Time to list, search and index ten thousand runs, with SQLite and PostgreSQL."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import TimeInRun
from analysis.signals.units import RPM
from analysis.whirl.findings import WhirlFinding
from recordings.catalogue.catalogue import Catalogue
from recordings.catalogue.run_store import Search
from recordings.mcap.container import Container
from recordings.mcap.reader import RunReader
from tests.benchmarks.recorded_samples import bench_blocks, write_run
from tests.recordings.postgresql import new_schema, server

N_RUNS = 10_000

pytestmark = pytest.mark.benchmark


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with ten thousand hard links to a run of 1 s whose samples and results are zeroed."""
    folder = tmp_path_factory.mktemp("data")
    first = folder / "run-00000.mcap"
    write_run(first, bench_blocks(1))
    data = bytearray(first.read_bytes())
    with closing(Container(first)) as container:
        places = list(container.chunks)
    for place in places:
        data[place.offset : place.offset + place.length] = bytes(place.length)
    assert sum(place.length for place in places) > 0.8 * len(data)
    first.write_bytes(data)
    for number in range(1, N_RUNS):
        (folder / f"run-{number:05}.mcap").hardlink_to(first)
    return folder


def summarise(reader: RunReader) -> RunSummary:
    """Return a summary whose onset speed is the run's number in r/min."""
    speed = float(reader.path.stem.removeprefix("run-")) * RPM
    begin = TimeInRun(0, 1.0, speed)
    whirl = WhirlFinding(0.48, 0.49, begin, begin, 14e-6, begin, is_forward=True, frames=5)
    summary = SummaryBuilder(reader.header).summary()
    return replace(summary, lowest_speed=speed, highest_speed=2 * speed, whirls=(whirl,))


@contextmanager
def address_of(kind: str, folder: Path) -> Iterator[str]:
    """Provide the URL of an empty database."""
    if kind == "sqlite":
        yield f"sqlite:///{folder.parent / 'catalogue.sqlite'}"
    else:
        with server() as running:
            yield new_schema(running, "benchmark")


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_ten_thousand_runs_are_listed_and_searched_within_a_second(folder: Path, kind: str) -> None:
    def timed(what: str, do: Callable[[], object]) -> float:
        started, cpu_started = time.perf_counter(), time.process_time()
        do()
        elapsed, cpu = time.perf_counter() - started, time.process_time() - cpu_started
        print(f"  {what:36} {1e3 * elapsed:9.1f} ms, {1e3 * cpu:9.1f} ms of CPU time")
        return cpu

    with address_of(kind, folder) as url:
        print(f"{N_RUNS} runs on {kind}:")
        catalogue = Catalogue(folder, url)
        timed("first listing, every file opened", catalogue.runs)
        timed("first index, every run summarised", lambda: catalogue.index(summarise))
        listing = timed("listing again", catalogue.runs)
        fresh = timed("listing by a new process", Catalogue(folder, url).runs)
        one = timed("one run by a new process", lambda: Catalogue(folder, url).run("run-04711"))
        search = Search(onset_below=101 * RPM, speed_low=50 * RPM)
        searching = timed("search for an onset and a speed", lambda: catalogue.search(search))
        words = timed("search for a word", lambda: catalogue.search(Search(text="00042")))
        unchanged = timed("index of unchanged files", lambda: catalogue.index(summarise))
        assert [entry.id for entry in catalogue.search(search)] == [f"run-{k:05}" for k in range(100, 24, -1)]
        entries = catalogue.runs()
        assert len(entries) == N_RUNS
        assert all(entry.is_complete and entry.duration == 1.0 for entry in entries)
    assert max(listing, searching, words) < 1.0
    assert fresh < 2.0
    assert one < 0.2
    assert unchanged < 3.0
