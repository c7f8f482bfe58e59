"""Live analysis: turns blocks of converter codes into snapshots, with bounded memory.

`OrderFrameBuilder` computes the order frame of the last whole revolutions, `Analyser` everything else.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.resampling.rate_conversion import HALF_WIDTH, STOP_BAND, DecimationPyramid, interpolate
from analysis.shaft.overall import OverallWindow
from analysis.signals import BoolArray, ComplexArray, FloatArray, IntArray
from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, AnalysisSettings, Channel, Role
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, RunOut, Snapshot, TachoReport, TachoState, Trace, Whirl
from analysis.signals.uncertainty import clipping_sigma, mean_angle_sigma, noise_floor_sigma
from analysis.spectra.order_map import order_spectrum, order_vectors
from analysis.spectra.windows import HANN, WINDOWS, Window
from analysis.tacho.edges import MAX_TIMESTAMP_DELAY, TachoEdgeReader
from analysis.tacho.pulse_train import NO_PULSE_TIMEOUT, PulseTrain
from analysis.tacho.shaft_angle import SmoothAngle, smooth_angle
from analysis.vectors.runout import RunOutEstimator
from analysis.whirl.components import find_whirls, noise_floor, quantile

MIN_TURN_RATE = 1.0  # Hz, revolutions per second: no frame below 60 r/min
FLOOR_LINES = 6  # lines on either side of an order, beyond the main lobe, for the noise floor, as in `order_track`
SPARE_REVOLUTIONS = 4  # revolutions that the pyramid stores in addition to a frame
_PASSBAND_FRACTION = 0.2  # highest order over the angular samples per revolution
FIT_REVOLUTIONS = 8  # revolutions before a frame that the fit of its shaft angle includes
MAX_CLIPPED_INTERVALS = 256  # update intervals with clipped samples that are stored
BENT_TO_SIGMA = 2.5 / np.sqrt(2.0)  # of a bend: 1.7 of it is the bias of a parabola, 3.5 that of a beat in 1.25 frames
BENT_NOISE, MIN_BENT_SIGMAS = 0.41, 5.0  # its standard deviation over that of a line, and how far it must stand out
MAX_TRACE_POINTS = 1000  # approximately
_CODES = np.arange(2**16, dtype=np.uint16).view(np.int16)  # tables over them are indexed by a code's bits as uint16


class OrderFrameBuilder:
    """Builds order frames from the samples of a decimation pyramid.

    The angular grid has enough points G per revolution (``points_per_revolution``, doubled as needed) that the highest
    order H lies below 0.2 G. The grid is read from the finest level of the pyramid without components, images of the
    interpolation included, above the order G - H, which the grid would fold onto H. So nothing folds into the spectrum,
    and H lies below 0.3 of the rate of that level, where filters and interpolation are accurate to 0.01 %.

    Parameters
    ----------
    acquisition : Acquisition
        Rates, multiplexer and probes.
    settings : AnalysisSettings
        Revolutions, points, orders and window.
    """

    def __init__(self, acquisition: Acquisition, settings: AnalysisSettings) -> None:
        if settings.revolutions < 4 or settings.points_per_revolution < 4 or settings.highest_order < 2.0:
            raise ValueError(
                f"settings: {settings.revolutions} revolutions of {settings.points_per_revolution} points to order "
                f"{settings.highest_order}, expected at least 4 revolutions of 4 points to order 2"
            )
        self._window = WINDOWS[settings.window]
        if settings.revolutions < self._window.min_revolutions:
            raise ValueError(
                f"settings: {settings.revolutions} revolutions with the window {settings.window}, expected at least "
                f"{self._window.min_revolutions}"
            )
        self._settings = settings
        self._rate = acquisition.rate
        self._late = round(MAX_TIMESTAMP_DELAY * acquisition.rate) if acquisition.tacho.reference == "counter" else 0
        rows = (acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))
        self._pair = ProbePair(acquisition.channels[rows[0]].angle, acquisition.channels[rows[1]].angle)
        self._skews = np.array(rows)[:, None] / acquisition.convert_rate
        self._stride = 1
        while settings.highest_order > _PASSBAND_FRACTION * settings.points_per_revolution * self._stride:
            self._stride *= 2
        self._points = settings.points_per_revolution * self._stride
        self._runout = RunOutEstimator(settings.runout)
        # of a level that the angular grid does not alias
        self._max_samples_per_revolution = (self._points - settings.highest_order) / STOP_BAND

    def new_pyramid(self, first: int) -> DecimationPyramid:
        """Return an empty pyramid for every speed, for samples from index ``first`` on."""
        turns = self._settings.revolutions + SPARE_REVOLUTIONS
        keep = int(turns * self._max_samples_per_revolution) + 8 * HALF_WIDTH
        return DecimationPyramid(2, self._level(MIN_TURN_RATE) + 1, keep, first, self._late)

    def _level(self, turn_rate: float) -> int:
        return max(int(np.ceil(np.log2(self._rate / (self._max_samples_per_revolution * turn_rate)))), 0)

    def build(
        self,
        pyramid: DecimationPyramid,
        angle: SmoothAngle,
        first_turn: int,
        last_turn: int,
        clipping: Sequence[tuple[int, IntArray]] = (),
    ) -> OrderFrame | None:
        """Return the frame that ends at the last mark within the samples.

        Parameters
        ----------
        pyramid : DecimationPyramid
            Displacement towards the probes x and y, m.
        angle : SmoothAngle
            Time against revolutions, s.
        first_turn, last_turn : int
            Range of validity of the angle, revolutions.
        clipping : sequence of (int, ndarray of int64, shape (2,))
            Update intervals with clipped samples: index one past their last sample, and the most in a row at either
            probe.

        Returns
        -------
        OrderFrame or None
            None with too few samples or revolutions, or below the minimum speed.
        """
        revolutions = self._settings.revolutions
        for end in range(last_turn, max(last_turn - SPARE_REVOLUTIONS, first_turn + revolutions - 1), -1):
            begin = end - revolutions
            edges = angle.time(np.array([begin, begin + 0.5 * revolutions, end]))
            turn_rate = revolutions / float(edges[2] - edges[0])
            if not MIN_TURN_RATE <= turn_rate < self._rate:
                return None
            level = self._level(turn_rate)
            samples, first = pyramid.level(level)
            scale = self._rate / 2**level
            outside = (edges[[0, 2]] - self._skews) * scale - first  # channel k is sampled k / convert_rate later
            if outside.min() < HALF_WIDTH - 1:
                return None
            if outside.max() < samples.shape[1] - 1 - HALF_WIDTH:
                turns = begin + np.arange(revolutions * self._points) / self._points
                positions = (angle.time(turns) - self._skews) * scale - first
                if positions.min() < HALF_WIDTH - 1 or positions.max() >= samples.shape[1] - 1 - HALF_WIDTH:
                    return None
                inside = [longest for end, longest in clipping if end > edges[0] * self._rate]
                clipped = np.max(inside, axis=0) * turn_rate / self._rate if inside else np.zeros(2)
                return self._evaluate(interpolate(samples, positions), edges, angle.jitter, clipped)
        return None

    def _evaluate(self, waveform: FloatArray, edges: FloatArray, jitter: float, clipped: FloatArray) -> OrderFrame:
        settings = self._settings
        revolutions = settings.revolutions
        waveform = waveform - waveform.mean(axis=1, keepdims=True)
        orders, spectrum = order_spectrum(waveform, revolutions, self._window)
        wanted = int(np.searchsorted(orders, settings.highest_order, side="right"))
        orders, spectrum = orders[:wanted], spectrum[:, :wanted]
        noise = noise_floor(spectrum, revolutions, self._window)
        halves = np.diff(edges)
        speeds = np.pi * revolutions / halves  # mean of each half
        orbit = waveform[:, -min(settings.orbit_revolutions, revolutions) * self._points :: self._stride]
        orbit = orbit - orbit.mean(axis=1, keepdims=True)
        speed = float(2.0 * np.pi * revolutions / halves.sum())
        floors = [_floor_beside(spectrum, revolutions, order, noise, self._window) for order in (1, 2)]
        widening = float(clipping_sigma(clipped, np.sqrt(2.0) * waveform.std(axis=1)).max())
        sigma = noise_floor_sigma(np.array(floors))
        changes = [_change_in_frame(spectrum, revolutions, order, sigma[order - 1], self._window) for order in (1, 2)]
        sigma = np.sqrt(sigma**2 + np.array(changes) ** 2 + widening**2)
        multiples = order_vectors(spectrum, revolutions, int(settings.highest_order))
        runout = self._runout.update(speed, multiples, sigma)
        return OrderFrame(
            speed=speed,
            acceleration=float((speeds[1] - speeds[0]) / (0.5 * halves.sum())),
            orders=orders,
            spectrum=spectrum,
            vectors=multiples[:2],
            noise=noise,
            whirls=self._whirls(waveform, spectrum, noise, jitter * speed, widening),
            orbit=self._pair.to_bench(orbit),
            sigma=sigma,
            angle_sigma=float(mean_angle_sigma(np.asarray(speed), jitter, revolutions, self._window.noise_bandwidth)),
            runout=runout,
            compensated_orbit=self._compensated_orbit(orbit, runout),
        )

    def _whirls(
        self, waveform: FloatArray, spectrum: ComplexArray, noise: float, scatter: float, widening: float
    ) -> tuple[Whirl, ...]:
        """Return the components below 1X, from the spectrum if it is a Hann spectrum, else from one for the search."""
        revolutions = self._settings.revolutions
        if self._window != HANN:
            spectrum = order_spectrum(waveform, revolutions)[1][:, : spectrum.shape[1]]
            noise = noise_floor(spectrum, revolutions)
        found = find_whirls(spectrum, revolutions, noise, self._pair, scatter)
        return tuple(replace(whirl, sigma=math.hypot(whirl.sigma, widening)) for whirl in found)

    def _compensated_orbit(self, orbit: FloatArray, runout: RunOut | None) -> FloatArray | None:
        """Return the orbit at the probes minus run-out, in bench axes; None where not requested or unknown."""
        if runout is None or not self._settings.runout.from_orbit:
            return None
        points = self._settings.points_per_revolution
        turns = orbit.shape[1] // points
        return self._pair.to_bench(orbit - np.tile(runout.waveform(points), (1, turns)))


def _floor_beside(spectrum: ComplexArray, revolutions: int, order: int, noise: float, window: Window) -> float:
    """Return the median amplitude of the lines beside a whole order, clear of the lobes of whole orders, m peak.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_orders)
        Spectrum of a frame.
    revolutions, order : int
        Revolutions in the frame, and the whole order.
    noise : float
        Median over all orders, m peak, used where a frame of few revolutions has no such line.
    window : Window
        Window of the spectrum.
    """
    side = len(window.side_lines)  # lines on either side that a component on a line reaches
    away = np.arange(window.main_lobe + 1, window.main_lobe + 1 + FLOOR_LINES)
    lines = order * revolutions + np.concatenate([-away, away])
    clear = np.abs((lines + revolutions // 2) % revolutions - revolutions // 2) > side
    lines = lines[clear & (lines > side) & (lines < spectrum.shape[1])]
    return quantile(np.abs(spectrum[:, lines]), 0.5) if lines.size else noise


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
        max_hops_per_revolution = int(NO_PULSE_TIMEOUT / settings.update_interval) + 2
        self._clipping: deque[tuple[int, IntArray]] = deque(maxlen=MAX_CLIPPED_INTERVALS)
        self._overall = OverallWindow(acquisition.rate, self._hop, max_hops_per_revolution)
        self._restart(-1, 0)

    def _restart(self, segment: int, first: int) -> None:
        self._segment = segment
        self._position = first  # index one past the last sample added
        self._filled = 0  # samples of the incomplete hop
        self._tacho.restart(first)
        self._train.restart()
        self._pyramid = self._frames.new_pyramid(first)
        self._overall.clear()
        self._clipping.clear()

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
        is_clipped = (codes == CODE_MIN) | (codes == CODE_MAX)
        self._clipped += np.count_nonzero(is_clipped, axis=1)
        longest = np.array([_longest_run(is_clipped[row]) for row in self._rows])
        if longest.any():
            self._clipping.append((self._position, longest))
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
            overall=self._overall.add(displacement, speed),
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
        return speed, report, self._frames.build(self._pyramid, angle, int(turns[0]), int(turns[-1]), self._clipping)

    def _trace(self, first: int, displacement: FloatArray, tacho: FloatArray) -> Trace:
        stride = -(-tacho.size // MAX_TRACE_POINTS)
        thinned = displacement[:, ::stride]
        return Trace(
            time=(first + np.arange(0, tacho.size, stride)) / self._rate,
            displacement=thinned - thinned.mean(axis=1, keepdims=True),
            tacho=tacho[::stride].copy(),
        )


def _change_in_frame(spectrum: ComplexArray, revolutions: int, order: int, sigma: float, window: Window) -> float:
    """Return the standard deviation of a whole order from its change within the frame, m peak; 0 where none stands out.

    A vector that bends over the frame, on a ramp through a resonance or beside a component that the frame does not
    resolve, shows in the sum of the lines on either side: beyond -1/2 of the order's line each.
    """
    line = order * revolutions
    if window != HANN or line + 1 >= spectrum.shape[1]:
        return 0.0
    bent = np.abs(0.5 * (spectrum[:, line - 1] + spectrum[:, line + 1]) - HANN.side_lines[0] * spectrum[:, line])
    largest = float(bent.max())
    return BENT_TO_SIGMA * largest if largest > MIN_BENT_SIGMAS * BENT_NOISE * sigma else 0.0


def _longest_run(flags: BoolArray) -> int:
    """Return the largest number of successive true values."""
    if not flags.any():
        return 0
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max())


def _calibrated_span(probe: Channel) -> tuple[float, float]:
    """Return the calibrated voltage range, V; NaN for a channel without calibration."""
    calibration = probe.calibration
    return (np.nan, np.nan) if calibration is None else (calibration.volts_low, calibration.volts_high)
