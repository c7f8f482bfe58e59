"""A recorded run evaluated anew: its samples, with calibrations that were corrected since."""

from collections.abc import Mapping
from dataclasses import replace

from analysis.analyser import Analyser
from analysis.run import Calibration, Role, RunHeader
from analysis.samples import SampleBlock
from analysis.summary import RunSummary, SummaryBuilder
from daq.errors import UsageError
from daq.session.offline import Progress
from recordings.reader import RunReader


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


def reevaluate(reader: RunReader, header: RunHeader, on_progress: Progress | None = None) -> RunSummary:
    """Return the summary of a recording as it is with another header; the recording stays as it is.

    Parameters
    ----------
    reader : RunReader
        The recording.
    header : RunHeader
        What its samples are taken to mean, of `corrected_header`.
    on_progress : callable or None
        Told the part that is done, 0 to 1.
    """
    builder = SummaryBuilder(header)
    analyser = Analyser(header.acquisition, header.settings)
    whole = max(reader.duration * header.acquisition.rate, 1.0)
    done = 0
    for item in reader.items():
        if isinstance(item, SampleBlock):
            snapshots = analyser.block(item)
            done += item.n_samples
        else:
            snapshots = analyser.segment_end(item)
        for snapshot in snapshots:
            builder.snapshot(snapshot)
        if not isinstance(item, SampleBlock):
            builder.segment_end(item)
        if on_progress is not None:
            on_progress(min(1.0, done / whole))
    return builder.summary()
