"""Tables of a run, or part of it, for export: samples, recorded results and counter pulses, in display units."""

import json
import math

import numpy as np

from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import Channel
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import LENGTH, MICROMETRE, readings
from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.file_operations import Progress, ignore_progress
from recordings.mcap.header import to_json
from recordings.mcap.layout import sample_time_ns
from recordings.mcap.reader import RunReader
from recordings.mcap.results import features_message, stored_number

CHUNK_SAMPLES = 2_000_000  # per channel, read at a time
MAX_SAMPLES = 50_000_000
"""Samples per channel in one table, which is held in memory."""
RESULT_UNITS = {
    "segment": "",
    "time_s": "s",
    "speed_rpm": "r/min",
    "gap_x_v": "V",
    "gap_y_v": "V",
    **{name: LENGTH.unit for name, reading in readings(Snapshot).items() if reading.attribute == "overall"},
    "x_1x_um": "µm",
    "x_1x_lag_deg": "deg",
    "y_1x_um": "µm",
    "y_1x_lag_deg": "deg",
    "x_2x_um": "µm",
    "x_2x_lag_deg": "deg",
    "y_2x_um": "µm",
    "y_2x_lag_deg": "deg",
    "whirl_order": "",
    "whirl_um": "µm",
    "noise_um": "µm",
    "x_1x_compensated_um": "µm",
    "x_1x_compensated_lag_deg": "deg",
    "y_1x_compensated_um": "µm",
    "y_1x_compensated_lag_deg": "deg",
    "sigma_1x_um": "µm",
    "sigma_2x_um": "µm",
    "whirl_sigma_um": "µm",
    "second_whirl_order": "",
    "second_whirl_um": "µm",
}


def samples_table(
    reader: RunReader,
    start: float = 0.0,
    stop: float = math.inf,
    segment: int | None = None,
    on_progress: Progress = ignore_progress,
) -> Table:
    """Return samples in engineering units.

    Probes have displacement towards the probe, zero at its tip, µm; other channels have volts at the input.

    Parameters
    ----------
    reader : RunReader
        The run.
    start, stop : float
        Part of the segment, s of sample time.
    segment : int or None
        The segment; None if the run has only one.
    on_progress : callable
        Called with the fraction read, 0 to 1.

    Raises
    ------
    ForeignFormatError
        If the part is empty or too large for a table, or no segment is given for a run with several.
    DamagedError
        If the file is damaged there.
    """
    end = _segment_end(reader, segment)
    acquisition = reader.header.acquisition
    first = max(0, math.ceil(start * acquisition.rate - 1e-6))
    last = end.samples if math.isinf(stop) else min(end.samples, math.ceil(stop * acquisition.rate - 1e-6))
    if not 0 < last - first <= MAX_SAMPLES:
        raise ForeignFormatError(
            f"{reader.path}: {max(0, last - first)} samples from {start:g} s to {stop:g} s of a segment of "
            f"{end.samples / acquisition.rate:g} s, expected 1 to {MAX_SAMPLES}"
        )
    codes = np.empty((len(acquisition.channels), last - first), dtype=np.int16)
    for low in range(first, last, CHUNK_SAMPLES):
        high = min(low + CHUNK_SAMPLES, last)
        codes[:, low - first : high - first] = reader.samples(end.segment, low, high)
        on_progress((high - first) / (last - first))
    times = Column("time_s", "s", np.arange(first, last) / acquisition.rate)
    columns = [_column(channel, row) for channel, row in zip(acquisition.channels, codes, strict=True)]
    started_ns = reader.segment_started_ns(end.segment) + sample_time_ns(first, acquisition.rate)
    properties = _properties(reader) | {"segment": str(end.segment), "convert_rate_hz": repr(acquisition.convert_rate)}
    return Table((times, *columns), acquisition.rate, started_ns, properties)


def results_table(
    reader: RunReader,
    start: float = 0.0,
    stop: float = math.inf,
    segment: int | None = None,
    on_progress: Progress = ignore_progress,
) -> Table:
    """Return the recorded results, one row per snapshot, NaN for missing values; amplitudes are peak, lags -arg X.

    Raises
    ------
    ForeignFormatError
        If there are none.
    """
    rows: list[list[float]] = []
    lengths = {end.segment: end.samples / reader.header.acquisition.rate for end in reader.segment_ends}
    for snapshot in reader.snapshots():
        if start <= snapshot.time < stop and segment in (None, snapshot.segment):
            rows.append(_row(snapshot))
        before = sum(length for number, length in lengths.items() if number < snapshot.segment)
        on_progress(min(1.0, (before + snapshot.time) / max(reader.duration, 1e-9)))
    if not rows:
        raise ForeignFormatError(f"{reader.path}: has no results from {start:g} s to {stop:g} s")
    values = np.array(rows, dtype=np.float64).T
    columns = tuple(Column(name, unit, row) for (name, unit), row in zip(RESULT_UNITS.items(), values, strict=True))
    properties = _properties(reader) | {
        "phase": "x(t) = Re[X exp(i k theta)], theta = 0 at the keyphasor mark; lag = -arg X"
    }
    return Table(columns, None, reader.header.started_ns, properties)


def pulses_table(
    reader: RunReader,
    start: float = 0.0,
    stop: float = math.inf,
    segment: int | None = None,
    on_progress: Progress = ignore_progress,
) -> Table:
    """Return the counter timestamps of the tacho edges, one row each; the tacho's delay is not subtracted.

    Raises
    ------
    ForeignFormatError
        If there are none.
    """
    acquisition = reader.header.acquisition
    counter, found = acquisition.tacho.counter, []
    for end in reader.segment_ends if counter is not None else ():
        if segment in {None, end.segment}:
            first, last = (min(end.samples, math.ceil(min(time, 1e9) * acquisition.rate)) for time in (start, stop))
            for low in range(first, last, CHUNK_SAMPLES):
                ticks_here = reader.ticks(end.segment, low, min(low + CHUNK_SAMPLES, last))
                found += [(end.segment, tick) for tick in ticks_here.tolist()]
                on_progress(min(low + CHUNK_SAMPLES, last) / max(reader.n_samples, 1))
    if counter is None or not found:
        raise ForeignFormatError(f"{reader.path}: has no counter timestamps from {start:g} s to {stop:g} s")
    segments, ticks = np.array(found, dtype=np.float64).T
    properties = _properties(reader) | {"timebase_hz": repr(counter.timebase), "delay_s": repr(acquisition.tacho.delay)}
    columns = (
        Column("segment", "", segments),
        Column("ticks", "", ticks),
        Column("time_s", "s", ticks / counter.timebase),
    )
    return Table(columns, None, reader.header.started_ns, properties)


def _segment_end(reader: RunReader, segment: int | None) -> SegmentEnd:
    ends = {end.segment: end for end in reader.segment_ends}
    if segment is None and len(ends) == 1:
        return reader.segment_ends[0]
    if segment not in ends:
        raise ForeignFormatError(
            f"{reader.path}: segment {segment}, expected one of {', '.join(map(str, ends))}: a gap lies between them"
        )
    return ends[segment]


def _column(channel: Channel, codes: np.ndarray[tuple[int], np.dtype[np.int16]]) -> Column:
    if channel.calibration is None:
        return Column(f"{channel.name}_v", "V", channel.volts(codes))
    return Column(f"{channel.name}_um", "µm", channel.displacement(codes) / MICROMETRE)


def _properties(reader: RunReader) -> dict[str, str]:
    header = reader.header
    properties = {"run": header.run, "rig": header.rig, "note": header.note, "program": header.program}
    for channel in header.acquisition.channels:
        properties[f"{channel.name}_angle_deg"] = repr(math.degrees(channel.angle))
        if channel.calibration is not None:
            properties[f"{channel.name}_calibration"] = json.dumps(to_json(channel.calibration))
    return properties


def _row(snapshot: Snapshot) -> list[float]:
    """Return the values of a snapshot in the order of `RESULT_UNITS`."""
    features = features_message(snapshot)
    values = {name: stored_number(features, name) for name in RESULT_UNITS if not name.startswith("second")}
    if snapshot.frame is not None and len(snapshot.frame.whirls) > 1:
        second = snapshot.frame.whirls[1]
        values |= {"second_whirl_order": second.order, "second_whirl_um": second.amplitude / MICROMETRE}
    return [values.get(name, math.nan) for name in RESULT_UNITS]
