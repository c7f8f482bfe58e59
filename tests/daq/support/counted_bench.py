"""A rig with a tacho counter, and its runs as items, as a file and as results."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.live.analyser import Analyser
from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.session.recording.recorder import run_header
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import write_run
from tests.daq.support.recording import recording_request

RigFactory = Callable[..., Rig]
RISING = {"profile": [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 4.0, "speed_rpm": 9000.0}]}


def counted(rig: RigFactory, reference: str = "counter", **sections: object) -> Rig:
    """Return a rig with a tacho counter, by default as the reference."""
    tacho = {"delay_s": 4e-4, "counter": {"reference": reference}}
    return rig(**({"simulation": RISING} | sections | {"tacho": tacho}))


def items_of(rig: Rig) -> list[SourceItem]:
    source = open_source(rig)
    items = list(source.blocks())
    source.close()
    return items


def header_of(rig: Rig, folder: Path) -> RunHeader:
    source = open_source(rig)
    source.close()
    return run_header(recording_request(rig, folder), source)


def recorded(rig: Rig, folder: Path, items: Iterable[SourceItem] | None = None) -> Path:
    header = header_of(rig, folder)
    path = folder / f"{header.run}.mcap"
    write_run(path, header, items_of(rig) if items is None else items, {})
    return path


def analysed(header: RunHeader, items: Iterable[SourceItem]) -> list[Snapshot]:
    analyser = Analyser(header.acquisition, header.settings)
    snapshots: list[Snapshot] = []
    for item in items:
        snapshots += analyser.end_segment(item) if isinstance(item, SegmentEnd) else analyser.add_block(item)
    return snapshots


def encoded_snapshots(header: RunHeader, snapshots: Iterable[Snapshot]) -> list[bytes]:
    """Return snapshots as encoded in a file, for comparison bit for bit."""
    return [message.data for snapshot in snapshots for message in encode_snapshot(snapshot, header)]


def ticks_of(items: Iterable[SourceItem]) -> NDArray[np.int64]:
    parts = [item.ticks for item in items if isinstance(item, SampleBlock) and item.ticks is not None]
    return np.concatenate([np.empty(0, np.int64), *parts])
