"""Recorded runs analysed again: results, summary, corrected calibrations, and the slow roll of an earlier run."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.live.analyser import Analyser
from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition, Calibration, Role, RunHeader, RunOutSettings
from analysis.signals.snapshot import RunOut, Snapshot
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.order_map import order_vectors
from analysis.vectors.runout import RunOutEstimator
from daq.config.rig import Rig
from daq.config.schema import RunOutSection, RunOutVector
from daq.errors import UsageError
from recordings.catalogue.catalogue import SUFFIX
from recordings.errors import RecordingError
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


def with_reference_runout(rig: Rig, folder: Path) -> Rig:
    """Return the rig with the run-out of the run in ``runout.from_run``; the rig itself where none is named.

    Parameters
    ----------
    rig : Rig
        The rig.
    folder : Path
        The data folder that holds the run.

    Raises
    ------
    UsageError
        The run cannot be read, has no slow roll, or was measured with other probe angles or another tacho.
    """
    section = rig.config.runout
    if not section.from_run:
        return rig
    name = section.from_run
    path = rig.path.parent / name if name.endswith(SUFFIX) else folder / f"{name}{SUFFIX}"
    try:
        with RunReader(path) as reader:
            _require_same_sensors(rig, reader.header.acquisition)
            found = _slow_roll(reader, section.slow_roll_rpm * RPM)
            source = f"slow roll of {reader.header.run} up to {section.slow_roll_rpm:g} r/min"
    except RecordingError as error:
        raise UsageError(f"runout.from_run: {error}") from error
    if found is None:
        raise UsageError(f"runout.from_run: {path.stem} holds no order spectrum up to {section.slow_roll_rpm:g} r/min")
    vectors = tuple(_vector(order, found) for order in range(1, len(found.vectors) + 1))
    with_vectors = RunOutSection(correct_orbit=section.correct_orbit, vector=vectors, source=source)
    return replace(rig, config=rig.config.model_copy(update={"runout": with_vectors}))


def _slow_roll(reader: RunReader, speed: float) -> RunOut | None:
    settings = reader.header.settings
    watch = RunOutEstimator(RunOutSettings(slow_roll_speed=speed))
    for item in results(reader):
        if isinstance(item, SegmentEnd) or item.frame is None:
            continue
        frame = item.frame
        vectors = order_vectors(frame.spectrum, settings.revolutions, int(settings.highest_order))
        if watch.update(frame.speed, vectors, np.nan_to_num(frame.sigma)) is not None:
            break
    return watch.estimate


def _vector(order: int, runout: RunOut) -> RunOutVector:
    x, y = runout.vectors[order - 1].tolist()
    return RunOutVector(
        order=order,
        x_um=abs(x) / MICROMETRE,
        x_lag_deg=phase_lag_degrees(x) if x else 0.0,
        y_um=abs(y) / MICROMETRE,
        y_lag_deg=phase_lag_degrees(y) if y else 0.0,
        sigma_um=float(runout.sigma[order - 1]) / MICROMETRE if order <= len(runout.sigma) else 0.0,
    )


def _require_same_sensors(rig: Rig, earlier: Acquisition) -> None:
    """Raise UsageError where the earlier run has other probe angles or another tacho: its vectors do not apply."""
    angles = {channel.role: channel.angle_deg for channel in rig.config.channel}
    for channel in earlier.channels:
        if channel.calibration is not None and abs(math.degrees(channel.angle) - angles[channel.role]) > 1e-6:
            raise UsageError(
                f"runout.from_run: its probe {channel.name} is at {math.degrees(channel.angle):g} degrees, "
                f"expected {angles[channel.role]:g}: its vectors do not apply to this rig"
            )
    if earlier.tacho.edge is not rig.tacho.edge or earlier.tacho.pulses_per_revolution != 1:
        raise UsageError(
            f"runout.from_run: its tacho times the {earlier.tacho.edge.value} edge of "
            f"{earlier.tacho.pulses_per_revolution} marks, expected {rig.tacho.edge.value} of 1: "
            "its phases do not apply to this rig"
        )
