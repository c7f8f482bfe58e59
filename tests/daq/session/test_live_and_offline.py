"""Live results in the file equal those of an offline analysis of the recording, bit for bit."""

from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path

import pytest

from analysis.live.analyser import Analyser
from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.drivers.replay import open_replay
from recordings.mcap.reader import RunReader
from recordings.mcap.results import encode_snapshot
from tests.daq.support.recorded_bench import record_run

RUN_UP = {"profile": [{"time_s": 0.0, "speed_rpm": 4000.0}, {"time_s": 2.0, "speed_rpm": 9000.0}]}


def analysed(header: RunHeader, items: Iterable[SourceItem]) -> list[Snapshot]:
    analyser = Analyser(header.acquisition, header.settings)
    return [
        snapshot
        for item in items
        for snapshot in (analyser.add_block(item) if isinstance(item, SampleBlock) else analyser.end_segment(item))
    ]


def messages(header: RunHeader, snapshots: Iterable[Snapshot]) -> list[bytes]:
    """Return the snapshots as encoded in a file."""
    return [part.data for snapshot in snapshots for part in encode_snapshot(snapshot, header)]


@pytest.mark.parametrize("block", [None, 97, 4_096, 100_000])
def test_offline_results_equal_live_results_for_any_block_size(
    rig: Callable[..., Rig], tmp_path: Path, block: int | None
) -> None:
    path = record_run(rig(simulation=RUN_UP), tmp_path)  # with the results of a live analysis
    with RunReader(path) as reader, closing(open_replay(path, None, block=block)) as source:
        live = list(reader.snapshots())
        offline = analysed(reader.header, source.blocks())
        assert sum(snapshot.frame is not None for snapshot in live) >= 10
        assert messages(reader.header, offline) == messages(reader.header, live)
