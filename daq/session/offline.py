"""What a recorded run was, from its file: the results that lie beside the samples, or the samples analysed again.

A recorded run's header with calibrations that were corrected since; `summarise` takes it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from analysis.live.analyser import Analyser
from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Calibration, Role, RunHeader
from analysis.signals.snapshot import Snapshot
from daq.errors import UsageError
from recordings.mcap.reader import RunReader

Progress = Callable[[float], None]


def summarise(reader: RunReader, on_progress: Progress | None = None, header: RunHeader | None = None) -> RunSummary:
    """Return the summary of a recording.

    The live analysis wrote its results beside the samples. Where it kept up they are the whole story; where it had to
    skip, or the file breaks off, the samples are analysed again, with the same outcome as a live analysis that kept up.

    Parameters
    ----------
    reader : RunReader
        The recording; it stays as it is.
    on_progress : callable or None
        Told the part that is done, 0 to 1.
    header : RunHeader or None
        What its samples are taken to mean, of `corrected_header`; they are analysed again then. None for its own.
    """
    builder = SummaryBuilder(header or reader.header)
    for item in results(reader, on_progress, header):
        if isinstance(item, SegmentEnd):
            builder.end_segment(item)
        else:
            builder.add_snapshot(item)
    return builder.summary()


def results(
    reader: RunReader, on_progress: Progress | None = None, header: RunHeader | None = None
) -> Iterator[Snapshot | SegmentEnd]:
    """Yield the results of a recording and the ends of its segments, as recorded or analysed again as `summarise` does.

    Parameters
    ----------
    reader : RunReader
        The recording.
    on_progress : callable or None
        Told the part that is done, 0 to 1.
    header : RunHeader or None
        As for `summarise`.
    """
    is_whole = reader.is_complete and reader.skipped_samples == 0
    duration = max(reader.duration, 1e-9)
    before = 0.0  # s of the segments before
    for item in _kept(reader) if is_whole and header is None else _analysed(reader, header or reader.header):
        yield item
        if isinstance(item, SegmentEnd):
            before += item.samples / reader.header.acquisition.rate
        elif on_progress is not None:
            on_progress(min(1.0, (before + item.time) / duration))


def _kept(reader: RunReader) -> Iterator[Snapshot | SegmentEnd]:
    ends = list(reader.segment_ends)
    for snapshot in reader.snapshots():
        while ends and ends[0].segment < snapshot.segment:
            yield ends.pop(0)
        yield snapshot
    yield from ends


def _analysed(reader: RunReader, header: RunHeader) -> Iterator[Snapshot | SegmentEnd]:
    analyser = Analyser(header.acquisition, header.settings)
    for item in reader.items():
        if isinstance(item, SampleBlock):
            yield from analyser.add_block(item)
        else:
            yield from analyser.end_segment(item)
            yield item


def corrected_header(header: RunHeader, calibrations: Mapping[str, Calibration]) -> RunHeader:
    """Return a run's header with other calibrations.

    Parameters
    ----------
    header : RunHeader
        Of the run.
    calibrations : mapping of str to Calibration
        By the name of the probe's channel; probes that are not named keep theirs.

    Raises
    ------
    UsageError
        The run has no probe of a name.
    """
    channels = header.acquisition.channels
    probes = [channel.name for channel in channels if channel.role is not Role.TACHO]
    for name in calibrations:
        if name not in probes:
            raise UsageError(f"run {header.run} has no probe {name!r}: expected {' or '.join(probes)}")
    corrected = tuple(
        replace(channel, calibration=calibrations.get(channel.name, channel.calibration)) for channel in channels
    )
    return replace(header, acquisition=replace(header.acquisition, channels=corrected))
