"""Live analysis: turns blocks of converter codes into snapshots, with bounded memory."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from analysis.live.order_frame import SPARE_REVOLUTIONS, OrderFrameBuilder
from analysis.shaft.overall import glitch_samples, trimmed_extremes
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, AnalysisSettings, Channel, Role
from analysis.signals.snapshot import OrderFrame, Snapshot, TachoReport, TachoState, Trace
from analysis.tacho.edge_reader import TachoEdgeReader
from analysis.tacho.pulse_train import NO_PULSE_TIMEOUT, PulseTrain
from analysis.tacho.shaft_angle import smooth_angle

FloatArray = NDArray[np.float64]

FIT_REVOLUTIONS = 8  # revolutions before a frame that the fit of its shaft angle includes
MAX_TRACE_POINTS = 1000  # approximately
_CODES = np.arange(2**16, dtype=np.uint16).view(np.int16)  # tables over them are indexed by a code's bits as uint16


class Analyser:
    """Computes a snapshot every update interval of sample time, and one at the end of a segment.

    The samples are processed in hops that end at multiples of ``round(update_interval * rate)`` in their segment, so
    that snapshots are identical, bit for bit, for every block size. A jump in segment or sample index restarts the
    analysis, except the counts of pulses and clipped samples. It raises for no int16 samples.

    Parameters
    ----------
    acquisition : Acquisition
        Channels, rates, calibrations and tacho.
    settings : AnalysisSettings
        Settings of the order analysis.

    Raises
    ------
    ValueError
        A role has no channel, a probe has no calibration, or the probes are parallel.
    """

    def __init__(self, acquisition: Acquisition, settings: AnalysisSettings) -> None:
        self._rate = acquisition.rate
        self._n_channels = len(acquisition.channels)
        self._rows = (acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))
        self._tacho_row = acquisition.row(Role.TACHO)
        self._tacho = TachoEdgeReader(acquisition)
        probes = [acquisition.channels[row] for row in self._rows]
        self._gap_windows = np.array([(probe.gap_low, probe.gap_high) for probe in probes])
        self._calibrated = np.array([_calibrated_span(probe) for probe in probes])
        self._probe_volts = [probe.volts(_CODES) for probe in probes]
        self._probe_displacement = [probe.displacement(_CODES) for probe in probes]
        self._tacho_volts = acquisition.channels[self._tacho_row].volts(_CODES)

        self._settings = settings
        self._hop = max(round(settings.update_interval * acquisition.rate), 1)
        self._frames = OrderFrameBuilder(acquisition, settings)
        self._train = PulseTrain(acquisition.tacho, settings.revolutions + FIT_REVOLUTIONS + SPARE_REVOLUTIONS + 1)
        self._clipped = np.zeros(self._n_channels, dtype=np.int64)
        self._beyond = np.zeros(len(self._rows), dtype=np.int64)
        self._codes = np.empty((self._n_channels, self._hop), dtype=np.int16)
        hops_in_a_turn = int(NO_PULSE_TIMEOUT / settings.update_interval) + 2
        self._extremes: deque[tuple[int, FloatArray, FloatArray]] = deque(maxlen=hops_in_a_turn)
        self._restart(-1, 0)

    def _restart(self, segment: int, first: int) -> None:
        self._segment = segment
        self._position = first  # index one past the last sample added
        self._filled = 0  # samples of the incomplete hop
        self._tacho.restart(first)
        self._train.restart()
        self._pyramid = self._frames.new_pyramid(first)
        self._extremes.clear()

    def add_block(self, block: SampleBlock) -> list[Snapshot]:
        """Add a block and return the snapshots that it completes.

        Raises
        ------
        ValueError
            The number of channels differs from that of the acquisition.
        """
        if block.codes.shape[0] != self._n_channels:
            raise ValueError(f"block of {block.codes.shape[0]} channels, expected {self._n_channels}")
        if block.segment != self._segment or block.first_sample != self._position:
            self._restart(block.segment, block.first_sample)
        self._tacho.add_block(block)
        snapshots = []
        taken = 0
        while taken < block.n_samples:
            to_hop_end = self._hop - self._position % self._hop
            n = min(to_hop_end, block.n_samples - taken)
            self._codes[:, self._filled : self._filled + n] = block.codes[:, taken : taken + n]
            self._filled += n
            self._position += n
            taken += n
            if n == to_hop_end:
                snapshots.append(self._snapshot())
        return snapshots

    def end_segment(self, end: SegmentEnd) -> list[Snapshot]:
        """End the segment and return the snapshot of its incomplete hop, if there is one."""
        snapshots = [self._snapshot()] if self._filled and end.segment == self._segment else []
        self._restart(-1, 0)
        return snapshots

    def _snapshot(self) -> Snapshot:
        codes = self._codes[:, : self._filled]
        self._filled = 0
        first, now = self._position - codes.shape[1], self._position / self._rate
        unsigned = codes.view(np.uint16)
        self._clipped += np.count_nonzero((codes == CODE_MIN) | (codes == CODE_MAX), axis=1)
        displacement, volts = np.empty((2, codes.shape[1])), np.empty((2, codes.shape[1]))
        for probe, row in enumerate(self._rows):
            places = unsigned[row].astype(np.intp)
            np.take(self._probe_displacement[probe], places, out=displacement[probe], mode="clip")
            np.take(self._probe_volts[probe], places, out=volts[probe], mode="clip")
        gap = volts.mean(axis=1)
        low, high = self._calibrated[:, :1], self._calibrated[:, 1:]
        self._beyond += np.count_nonzero((volts < low) | (volts > high), axis=1)
        tacho = self._tacho_volts[unsigned[self._tacho_row]]

        stretch = self._tacho.read(tacho, first)
        self._train.advance(stretch.edges, stretch.known, stretch.elapsed, self._rate)
        self._pyramid.push(displacement)
        speed, report, frame = self._shaft(now)
        return Snapshot(
            segment=self._segment,
            sample=self._position,
            time=now,
            speed=speed,
            tacho=report,
            gap_volts=gap,
            gap_in_window=(gap >= self._gap_windows[:, 0]) & (gap <= self._gap_windows[:, 1]),
            peak_to_peak=self._peak_to_peak(displacement, speed),
            clipped=self._clipped.copy(),
            frame=frame,
            trace=self._trace(first, displacement, tacho),
            outside_calibration=self._beyond.copy(),
            counter=self._tacho.report(self._position),
        )

    def _shaft(self, now: float) -> tuple[float, TachoReport, OrderFrame | None]:
        speed = self._train.speed(self._settings.update_interval)
        turns, times = self._train.marks
        if np.isnan(speed):
            return speed, self._train.report(self._train.state(now, speed, np.nan), np.nan), None
        angle = smooth_angle(turns, times)
        state = self._train.state(now, speed, angle.jitter)
        report = self._train.report(state, angle.jitter)
        if state not in {TachoState.GOOD, TachoState.TOO_FAST}:
            return np.nan, report, None
        return speed, report, self._frames.build(self._pyramid, angle, int(turns[0]), int(turns[-1]))

    def _peak_to_peak(self, displacement: FloatArray, speed: float) -> FloatArray:
        n = displacement.shape[1]
        self._extremes.append((n, *trimmed_extremes(displacement, glitch_samples(n, self._rate))))
        turn = 0.0 if np.isnan(speed) else 2.0 * np.pi / speed * self._rate
        needed = max(self._hop, turn)
        covered, low, high = 0, np.full(2, np.inf), np.full(2, -np.inf)
        for n, lowest, highest in reversed(self._extremes):
            low, high = np.minimum(low, lowest), np.maximum(high, highest)
            covered += n
            if covered >= needed:
                break
        return np.asarray(high - low, dtype=np.float64)

    def _trace(self, first: int, displacement: FloatArray, tacho: FloatArray) -> Trace:
        stride = -(-tacho.size // MAX_TRACE_POINTS)
        thinned = displacement[:, ::stride]
        return Trace(
            time=(first + np.arange(0, tacho.size, stride)) / self._rate,
            displacement=thinned - thinned.mean(axis=1, keepdims=True),
            tacho=tacho[::stride].copy(),
        )


def _calibrated_span(probe: Channel) -> tuple[float, float]:
    """Return the calibrated voltage range, V; NaN for a channel without calibration."""
    calibration = probe.calibration
    return (np.nan, np.nan) if calibration is None else (calibration.volts_low, calibration.volts_high)
