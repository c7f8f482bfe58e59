"""Scalar results and 1X vectors of a recorded run over time, cached by file; without spectra and orbits."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import RPM
from daq.reports.errors import DataNotFoundError
from daq.session.offline import OnProgress, results
from recordings.errors import NotFoundError
from recordings.mcap.reader import RunReader

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

MAX_TIME_DISTANCE = 1.0  # s, between a requested time and the nearest frame
SPEED_TOLERANCE = 0.02  # relative
MIN_SPEED_TOLERANCE = 100.0 * RPM  # rad/s
HISTORY_CACHE_SIZE = 8


@dataclass(frozen=True, slots=True, eq=False)
class RunHistory:
    """Results of a run over time, one entry per snapshot; values of the order frame are NaN without one.

    Parameters
    ----------
    header : RunHeader
        Header of the run.
    summary : RunSummary
        Summary of the same snapshots.
    is_recorded : bool
        Whether the results were recorded; false where the samples were analysed again.
    segment, sample : ndarray of int64, shape (n,)
        Segment, and index one past the last sample.
    time : ndarray of float64, shape (n,)
        Sample time in the segment, s.
    speed, frame_speed : ndarray of float64, shape (n,)
        Shaft speed of the snapshot and mean over its order frame, rad/s.
    peak_to_peak : ndarray of float64, shape (2, n)
        Overall vibration at the probes, m.
    gap_volts : ndarray of float64, shape (2, n)
        Mean gap voltage, V.
    vectors : ndarray of complex128, shape (2, n)
        1X at the probes, m peak.
    whirl_order, whirl_amplitude : ndarray of float64, shape (n,)
        Order and amplitude, m peak, of the strongest component below 1X; NaN without one.
    """

    header: RunHeader
    summary: RunSummary
    is_recorded: bool
    segment: IntArray
    sample: IntArray
    time: FloatArray
    speed: FloatArray
    frame_speed: FloatArray
    peak_to_peak: FloatArray
    gap_volts: FloatArray
    vectors: ComplexArray
    whirl_order: FloatArray
    whirl_amplitude: FloatArray

    def nearest(self, segment: int | None, time: float | None, speed: float | None) -> int:
        """Return the index of the snapshot with the frame nearest to a time or speed.

        Parameters
        ----------
        segment : int or None
            Only in this segment.
        time : float or None
            Sample time in the segment, s.
        speed : float or None
            Shaft speed, rad/s. With a time, the frame near this speed that is nearest to it; without either, the
            frame of the largest overall vibration.

        Raises
        ------
        DataNotFoundError
            No frame is within the tolerance.
        """
        candidates = np.isfinite(self.frame_speed)
        if segment is not None:
            candidates &= self.segment == segment
        if not candidates.any():
            raise DataNotFoundError(f"no order spectrum in {'the run' if segment is None else f'segment {segment}'}")
        if speed is not None:
            distance = np.abs(self.frame_speed - speed)
            near = candidates & (distance <= max(SPEED_TOLERANCE * speed, MIN_SPEED_TOLERANCE))
            if not near.any():
                low, high = np.array([self.frame_speed[candidates].min(), self.frame_speed[candidates].max()]) / RPM
                raise DataNotFoundError(
                    f"no order spectrum near {speed / RPM:,.0f} r/min; the run has them "
                    f"from {low:,.0f} to {high:,.0f} r/min"
                )
            if time is None:
                return int(np.argmin(np.where(near, distance, np.inf)))
            candidates = near
        if time is None:
            return int(np.argmax(np.where(candidates, self.peak_to_peak.max(axis=0), -np.inf)))
        distance = np.where(candidates, np.abs(self.time - time), np.inf)
        index = int(np.argmin(distance))
        if distance[index] > MAX_TIME_DISTANCE and speed is None:
            raise DataNotFoundError(f"no order spectrum within {MAX_TIME_DISTANCE:g} s of {time:g} s")
        return index


def file_status(path: Path) -> os.stat_result:
    """Return size and times of a run's file; NotFoundError where it does not exist."""
    try:
        return path.stat()
    except OSError as error:
        raise NotFoundError(f"{path}: file not found") from error


_histories: dict[tuple[Path, int, int], RunHistory] = {}


def load_history(path: Path, on_progress: OnProgress | None = None) -> RunHistory:
    """Return the history of a run's file, kept until it changes; RecordingError where it cannot be read."""
    status = file_status(path)
    key = path, status.st_size, status.st_mtime_ns
    if key not in _histories:
        history = _read(path, on_progress)
        if len(_histories) >= HISTORY_CACHE_SIZE:
            del _histories[next(iter(_histories))]
        _histories[key] = history
    return _histories[key]


def _read(path: Path, on_progress: OnProgress | None) -> RunHistory:
    """Return the history of a run's file; ``on_progress`` receives the fraction done, 0 to 1."""
    rows: list[tuple[float, ...]] = []
    vectors: list[ComplexArray] = []
    none = np.full(2, complex(np.nan, np.nan))
    with RunReader(path) as reader:
        builder = SummaryBuilder(reader.header)
        for item in results(reader, on_progress):
            if isinstance(item, SegmentEnd):
                builder.end_segment(item)
                continue
            builder.add_snapshot(item)
            rows.append(_row(item))
            vectors.append(none if item.frame is None else item.frame.vectors[0])
        header, is_recorded = reader.header, reader.is_complete and reader.skipped_samples == 0
    columns = np.array(rows, dtype=np.float64).reshape(-1, 11).T
    return RunHistory(
        header=header,
        summary=builder.summary(),
        is_recorded=is_recorded,
        segment=columns[0].astype(np.int64),
        sample=columns[1].astype(np.int64),
        time=columns[2],
        speed=columns[3],
        frame_speed=columns[4],
        peak_to_peak=columns[5:7],
        gap_volts=columns[7:9],
        vectors=np.array(vectors, dtype=np.complex128).reshape(-1, 2).T,
        whirl_order=columns[9],
        whirl_amplitude=columns[10],
    )


def _row(snapshot: Snapshot) -> tuple[float, ...]:
    frame = snapshot.frame
    whirl = None if frame is None else frame.whirl
    return (
        snapshot.segment,
        snapshot.sample,
        snapshot.time,
        snapshot.speed,
        np.nan if frame is None else frame.speed,
        *snapshot.peak_to_peak,
        *snapshot.gap_volts,
        np.nan if whirl is None else whirl.order,
        np.nan if whirl is None else whirl.amplitude,
    )


def snapshot_at(path: Path, history: RunHistory, index: int) -> tuple[Snapshot, OrderFrame]:
    """Return the snapshot at an index of the history, and its frame; ValueError without a frame."""
    position = int(history.segment[index]), int(history.sample[index])
    with RunReader(path) as reader:
        snapshot = reader.snapshot(*position) if history.is_recorded else None
        if snapshot is None:
            snapshot = next(item for item in run_snapshots(reader) if (item.segment, item.sample) == position)
    if snapshot.frame is None:
        raise ValueError(f"snapshot {index} of {path.name}: no order frame, expected one")
    return snapshot, snapshot.frame


def run_snapshots(reader: RunReader) -> Iterator[Snapshot]:
    """Yield the results of a run in order: recorded, or from analysing the samples again."""
    for item in results(reader):
        if isinstance(item, Snapshot):
            yield item
