"""A whole run written at once from samples that are there already, with the results of their analysis."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from analysis.live.analyser import Analyser
from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.mcap.markers import Mark, encode_mark
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter


def write_analysed(
    path: Path,
    header: RunHeader,
    items: Iterable[SourceItem],
    remarks: Mapping[str, Mapping[str, Any]],
    marks: Iterable[Mark] = (),
) -> None:
    """Write a run; nothing is left of it where that fails.

    Parameters
    ----------
    path : Path
        File to be created; it must not exist, its folder must.
    header : RunHeader
        Of the run.
    items : iterable of SampleBlock and SegmentEnd
        Its samples, in order; every segment has its end.
    remarks : mapping of str to mapping
        Further records by name, written when all samples have been taken.

    marks : iterable of Mark
        Named moments, taken when all samples have been.

    Raises
    ------
    StorageError
        Where it cannot be written.
    RecordingError
        Where the items cannot be read on.
    """
    writer = RunWriter(path, header)
    try:
        analyser = Analyser(header.acquisition, header.settings)
        for item in items:
            if isinstance(item, SampleBlock):
                writer.block(item)
                _keep(writer, header, analyser.block(item))
            else:
                _keep(writer, header, analyser.segment_end(item))
                writer.segment_end(item)
        for mark in marks:
            writer.result(encode_mark(mark, header))
        for name, document in remarks.items():
            writer.record(name, document)
        writer.close()
    except BaseException:
        writer.abandon()
        raise


def _keep(writer: RunWriter, header: RunHeader, snapshots: list[Snapshot]) -> None:
    for snapshot in snapshots:
        for result in encode_snapshot(snapshot, header):
            writer.result(result)
