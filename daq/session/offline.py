"""Results and summary of a recorded run, from the stored results or from its samples analysed again."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from analysis.live.analyser import Analyser
from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Calibration, Role, RunHeader
from analysis.signals.snapshot import Snapshot
from daq.errors import UsageError
from recordings.mcap.reader import RunReader

OnProgress = Callable[[float], None]


def summarise(reader: RunReader, on_progress: OnProgress | None = None, header: RunHeader | None = None) -> RunSummary:
    """Return the summary of a recording.

    The file holds the results of the live analysis. Where that skipped samples, or the file is incomplete, the samples
    are analysed again; the result equals that of a live analysis that skips nothing.

    Parameters
    ----------
    reader : RunReader
        The recording; it is not changed.
    on_progress : callable or None
        Receives the fraction done, 0 to 1.
    header : RunHeader or None
        Header from `corrected_header` for an analysis with other calibrations; None: the recording's own.
    """
    builder = SummaryBuilder(header or reader.header)
    for item in results(reader, on_progress, header):
        if isinstance(item, SegmentEnd):
            builder.end_segment(item)
        else:
            builder.add_snapshot(item)
    return builder.summary()


def results(
    reader: RunReader, on_progress: OnProgress | None = None, header: RunHeader | None = None
) -> Iterator[Snapshot | SegmentEnd]:
    """Yield the snapshots and segment ends of a recording, stored or computed again as `summarise` does.

    Parameters
    ----------
    reader : RunReader
        The recording.
    on_progress : callable or None
        Receives the fraction done, 0 to 1.
    header : RunHeader or None
        As for `summarise`.
    """
    is_whole = reader.is_complete and reader.skipped_samples == 0
    duration = max(reader.duration, 1e-9)
    previous = 0.0  # s, duration of the segments before
    for item in (
        _stored_results(reader) if is_whole and header is None else _computed_results(reader, header or reader.header)
    ):
        yield item
        if isinstance(item, SegmentEnd):
            previous += item.samples / reader.header.acquisition.rate
        elif on_progress is not None:
            on_progress(min(1.0, (previous + item.time) / duration))


def _stored_results(reader: RunReader) -> Iterator[Snapshot | SegmentEnd]:
    ends = list(reader.segment_ends)
    for snapshot in reader.snapshots():
        while ends and ends[0].segment < snapshot.segment:
            yield ends.pop(0)
        yield snapshot
    yield from ends


def _computed_results(reader: RunReader, header: RunHeader) -> Iterator[Snapshot | SegmentEnd]:
    analyser = Analyser(header.acquisition, header.settings)
    for item in reader.items():
        if isinstance(item, SampleBlock):
            yield from analyser.add_block(item)
        else:
            yield from analyser.end_segment(item)
            yield item


def corrected_header(header: RunHeader, calibrations: Mapping[str, Calibration]) -> RunHeader:
    """Return a run's header with other calibrations, to analyse its samples again.

    Parameters
    ----------
    header : RunHeader
        Header of the run.
    calibrations : mapping of str to Calibration
        New calibrations by name of the probe's channel; other probes keep theirs.

    Raises
    ------
    UsageError
        The run has no probe with one of the names.
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
