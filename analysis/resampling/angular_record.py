"""Records of two probes sampled uniformly in shaft angle, for all order analysis, and their mean revolution."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from analysis.resampling.rate_conversion import HALF_WIDTH, STOP_BAND, DecimationPyramid, interpolate
from analysis.signals import CodeArray, FloatArray
from analysis.signals.errors import AnalysisError, RecordTooShortError
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Role
from analysis.signals.probes import ProbePair, require_displacement
from analysis.tacho.edges import edge_detector
from analysis.tacho.pulse_record import PulseRecord, pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle

PASSBAND_FRACTION = 0.2  # highest lossless order over the angular samples per revolution
CHUNK_POINTS = 16_384  # angular samples that are interpolated at a time, to fit the cache of a core
_CODES = np.arange(2**16, dtype=np.uint16).view(np.int16)  # tables over them are indexed by a code's bits as uint16
CHUNK_SAMPLES = 500_000  # tacho samples that are searched for edges at a time


@dataclass(frozen=True, slots=True, eq=False)
class AngularRecord:
    """Displacement towards two probes against shaft angle, in whole revolutions that begin at theta = 0.

    Parameters
    ----------
    waveform : ndarray of float64, shape (2, n_revolutions, points)
        Displacement towards the probes x and y, m.
    first_turn : int
        Number of the first revolution since the first pulse.
    times : ndarray of float64, shape (n_revolutions + 1,)
        Times at which the revolutions begin and the last one ends, s.
    pair : ProbePair
        Directions of the probes.
    angle_jitter : float
        Scatter of the tacho pulses about the smooth angle, s.
    time_sigma : ndarray of float64, shape (n_revolutions + 1,)
        Standard deviation of ``times``, s; NaN without a tacho.
    is_measured : bool
        Whether the angle was measured by a tacho.
    pulses : PulseRecord or None
        Tacho pulses, with the filled and rejected ones and whether the sensor response was exceeded; None where the
        angle was given.
    clipped : tuple of int
        Samples of each probe at the limits of the converter range: the displacement there is too small.
    clipped_fraction : ndarray of float64, shape (2, n_revolutions), or None
        Fraction of them in each revolution; None where there are none.
    """

    waveform: FloatArray
    first_turn: int
    times: FloatArray
    pair: ProbePair
    angle_jitter: float
    time_sigma: FloatArray
    is_measured: bool = True
    pulses: PulseRecord | None = None
    clipped: tuple[int, int] = (0, 0)
    clipped_fraction: FloatArray | None = None

    def __post_init__(self) -> None:
        shape, marks = self.waveform.shape, (self.waveform.shape[1] + 1,) if self.waveform.ndim == 3 else None
        if marks is None or shape[0] != 2 or self.times.shape != marks or self.time_sigma.shape != marks:
            raise ValueError(
                f"waveform {shape}, times {self.times.shape}, time_sigma {self.time_sigma.shape}: expected "
                "(2, n, points) and twice (n + 1,)"
            )
        if not np.isfinite(self.waveform).all() or not (np.diff(self.times) > 0.0).all():
            raise ValueError("waveform, times: expected finite metres and seconds that rise")

    @property
    def revolutions(self) -> int:
        """Number of whole revolutions."""
        return int(self.waveform.shape[1])

    @property
    def points(self) -> int:
        """Angular samples per revolution."""
        return int(self.waveform.shape[2])

    @property
    def highest_order(self) -> float:
        """Highest order without loss and without aliasing."""
        return PASSBAND_FRACTION * self.points

    @property
    def speeds(self) -> FloatArray:
        """Mean speed of each revolution, rad/s, shape (n_revolutions,)."""
        return np.asarray(2.0 * np.pi / np.diff(self.times), dtype=np.float64)

    def require(self, revolutions: int) -> None:
        """Raise RecordTooShortError where the record has fewer revolutions."""
        if self.revolutions < revolutions:
            raise RecordTooShortError(f"{self.revolutions} revolutions in the record, expected at least {revolutions}")

    def with_waveform(self, waveform: FloatArray) -> "AngularRecord":
        """Return the record with another waveform of the same shape."""
        if waveform.shape != self.waveform.shape:
            raise ValueError(f"waveform: shape {waveform.shape}, expected {self.waveform.shape}")
        return replace(self, waveform=waveform)

    def section(self, begin: int, end: int) -> "AngularRecord":
        """Return the revolutions from ``begin`` to before ``end``."""
        if not 0 <= begin < end <= self.revolutions:
            raise ValueError(f"begin, end: {begin} and {end}, expected a part of 0 to {self.revolutions}")
        return replace(
            self,
            waveform=self.waveform[:, begin:end],
            clipped_fraction=None if self.clipped_fraction is None else self.clipped_fraction[:, begin:end],
            first_turn=self.first_turn + begin,
            times=self.times[begin : end + 1],
            time_sigma=self.time_sigma[begin : end + 1],
        )


def angular_record(
    displacement: FloatArray,
    rate: float,
    angle: ShaftAngle,
    pair: ProbePair,
    *,
    points: int = 64,
    skews: tuple[float, float] = (0.0, 0.0),
) -> AngularRecord:
    """Return two probes resampled uniformly in shaft angle, without aliasing at any speed.

    Each revolution is interpolated by a windowed sinc of 32 samples, each probe at its own sampling times. It is read
    from a level of the decimation pyramid (rate over 1, 2, 4, …): the finest one without components that the angular
    grid would fold onto orders below 0.2 of its points.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes x and y, uniformly in time, m.
    rate : float
        Sample rate, Hz.
    angle : ShaftAngle
        Time against revolutions, where time 0 is the first sample.
    pair : ProbePair
        Directions of the probes.
    points : int
        Angular samples per revolution: 5 times the highest order of interest.
    skews : tuple of float
        Delay of each probe's samples relative to the time axis, s (multiplexer, filter).

    Raises
    ------
    RecordTooShortError
        The samples contain no whole revolution.
    ValueError
        Shapes, rate or samples that are not finite.

    Notes
    -----
    Computed order tracking (A. Brandt, Noise and Vibration Analysis, 2011, ch. 12); levels by half-band filters as R.
    Crochiere and L. Rabiner, Multirate Digital Signal Processing, 1983.
    """
    require_displacement(displacement, rate)
    if points < 4:
        raise ValueError(f"points: {points}, expected 4 at least")
    first, last = int(np.ceil(angle.first)), int(np.floor(angle.last))
    if last <= first:
        raise RecordTooShortError("the record holds no whole revolution")
    times = np.asarray(angle.time(np.arange(first, last + 1)), dtype=np.float64)
    reader = _LevelReader(displacement, rate, np.array(skews)[:, None], times, points)
    begin, end = reader.available_revolutions(times)
    waveform = reader.waveform(angle, first, begin, end)
    return AngularRecord(
        waveform=waveform,
        first_turn=first + begin,
        times=times[begin : end + 1],
        pair=pair,
        angle_jitter=angle.jitter,
        time_sigma=angle.time_sigma(np.arange(first + begin, first + end + 1, dtype=np.float64)),
        is_measured=angle.is_measured,
    )


class _LevelReader:
    """Reads each revolution from the pyramid level for its speed.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes, m.
    rate : float
        Sample rate, Hz.
    skew : ndarray of float64, shape (2, 1)
        Delay of each probe's samples, s.
    times : ndarray of float64, shape (n_revolutions + 1,)
        Begin of each revolution and end of the last, s.
    points : int
        Angular samples per revolution.
    """

    def __init__(self, displacement: FloatArray, rate: float, skew: FloatArray, times: FloatArray, points: int) -> None:
        max_per_turn = (1.0 - PASSBAND_FRACTION) * points / STOP_BAND  # samples of the level, to avoid aliasing
        self._levels = np.maximum(np.ceil(np.log2(rate * np.diff(times) / max_per_turn)), 0).astype(np.int64)
        self._pyramid = DecimationPyramid(2, int(self._levels.max()) + 1, displacement.shape[1], 0)
        self._pyramid.push(displacement)
        self._rate, self._skew, self._points = rate, skew, points

    def available_revolutions(self, times: FloatArray) -> tuple[int, int]:
        """Return first and end of the revolutions whose interpolation needs no samples outside the record."""
        inside = np.zeros(self._levels.size, dtype=np.bool_)
        for level in np.unique(self._levels):
            samples, origin = self._pyramid.level(int(level))
            scale = self._rate / 2 ** int(level)
            low = (times[:-1] - self._skew.max()) * scale - origin
            high = (times[1:] - self._skew.min()) * scale - origin
            inside |= (self._levels == level) & (low >= HALF_WIDTH) & (high < samples.shape[1] - 1 - HALF_WIDTH)
        if not inside.any():
            raise RecordTooShortError("the samples hold no whole revolution")
        return int(np.argmax(inside)), inside.size - int(np.argmax(inside[::-1]))

    def waveform(self, angle: ShaftAngle, first: int, begin: int, end: int) -> FloatArray:
        """Return the revolutions from ``begin`` to before ``end``, counted from ``first``, shape (2, n, points), m."""
        waveform = np.empty((2, end - begin, self._points))
        part = np.arange(self._points) / self._points
        step = max(CHUNK_POINTS // self._points, 1)
        breaks = np.flatnonzero(np.diff(self._levels[begin:end])) + begin + 1
        for start, stop in zip([begin, *breaks], [*breaks, end], strict=True):
            level = int(self._levels[start])
            samples, origin = self._pyramid.level(level)
            for low in range(int(start), int(stop), step):
                turns = np.arange(low, min(low + step, int(stop)))
                cubic = angle.cubics(first + turns)[..., None]
                instants = (((cubic[3] * part + cubic[2]) * part + cubic[1]) * part + cubic[0]).ravel()
                positions = (instants - self._skew) * (self._rate / 2**level) - origin
                waveform[:, turns - begin] = interpolate(samples, positions).reshape(2, -1, self._points)
        return waveform


def tacho_edges(acquisition: Acquisition, codes: CodeArray) -> FloatArray:
    """Return the times of the tacho edges in codes of shape (n_channels, n), s, not corrected for the delay."""
    row = acquisition.row(Role.TACHO)
    channel = acquisition.channels[row]
    volts = channel.volts(_CODES)
    detector = edge_detector(acquisition.tacho)
    edges = [
        detector.edges(volts[np.ascontiguousarray(codes[row, begin : begin + CHUNK_SAMPLES]).view(np.uint16)], begin)
        for begin in range(0, codes.shape[1], CHUNK_SAMPLES)
    ]
    found = np.concatenate([np.empty(0), *edges])
    return np.asarray(found / acquisition.rate + row / acquisition.convert_rate, dtype=np.float64)


def probe_displacement(acquisition: Acquisition, codes: CodeArray) -> FloatArray:
    """Return the displacement towards the probes x and y from converter codes, shape (2, n), m.

    Raises
    ------
    AnalysisError
        A probe is at a limit of the converter range throughout.
    ValueError
        The codes do not match the acquisition.
    """
    channels = len(acquisition.channels)
    if codes.ndim != 2 or codes.shape[0] != channels or codes.shape[1] == 0 or codes.dtype != np.int16:
        raise ValueError(f"codes: {codes.dtype} of shape {codes.shape}, expected int16 ({channels}, n) with n > 0")
    displacement = np.empty((2, codes.shape[1]))
    for probe, row in enumerate((acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))):
        channel = acquisition.channels[row]
        if codes[row, 0] in {CODE_MIN, CODE_MAX} and bool((codes[row] == codes[row, 0]).all()):
            raise AnalysisError(f"probe {channel.name!r} is at a limit of the converter range throughout")
        table = channel.displacement(_CODES)
        np.take(table, np.ascontiguousarray(codes[row]).view(np.uint16), out=displacement[probe], mode="clip")
    return displacement


def angular_record_from_codes(
    acquisition: Acquisition,
    codes: CodeArray,
    *,
    points: int = 64,
    pulse_times: FloatArray | None = None,
    angle: ShaftAngle | None = None,
) -> AngularRecord:
    """Return the angular record of one gap-free segment of converter codes.

    Parameters
    ----------
    acquisition : Acquisition
        Channels, rates, calibrations and tacho.
    codes : ndarray of int16, shape (n_channels, n)
        Consecutive samples.
    points : int
        Angular samples per revolution.
    pulse_times : ndarray of float64, shape (n_pulses,), or None
        Edge times from a counter, s from the first sample; replace the tacho channel.
    angle : ShaftAngle or None
        Shaft angle from another source (`analysis.spectra.tacholess_speed`); the tacho is then not used.

    Raises
    ------
    AmbiguousTachoError, RecordTooShortError
        Pulses or samples do not suffice.
    AnalysisError
        A probe is at a limit of the converter range throughout.
    ValueError
        The codes do not match the acquisition.
    """
    displacement = probe_displacement(acquisition, codes)
    pulses = None
    if angle is None:
        edges = tacho_edges(acquisition, codes) if pulse_times is None else pulse_times
        pulses = pulse_record(edges, acquisition.tacho)
        angle = shaft_angle(pulses)
    rows = (acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))
    pair = ProbePair(acquisition.channels[rows[0]].angle, acquisition.channels[rows[1]].angle)
    skews = (rows[0] / acquisition.convert_rate, rows[1] / acquisition.convert_rate)
    record = angular_record(displacement, acquisition.rate, angle, pair, points=points, skews=skews)
    clipped = [np.flatnonzero((codes[row] == CODE_MIN) | (codes[row] == CODE_MAX)) for row in rows]
    counts = (clipped[0].size, clipped[1].size)
    if not any(counts):
        return replace(record, pulses=pulses)
    times = [samples / acquisition.rate + skew for samples, skew in zip(clipped, skews, strict=True)]
    per_turn = np.stack([np.histogram(each, record.times)[0] for each in times])
    fraction = per_turn / (acquisition.rate * np.diff(record.times))
    return replace(record, pulses=pulses, clipped=counts, clipped_fraction=fraction)


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousAverage:
    """The mean revolution of a record.

    Parameters
    ----------
    waveform : ndarray of float64, shape (2, points)
        Displacement towards the probes x and y from theta = 0 on, m, including the mean displacement.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of its points, m: the rms of the residual over the root of the revolutions, for a residual
        that does not repeat.
    revolutions : int
        Number of averaged revolutions.
    """

    waveform: FloatArray
    sigma: FloatArray
    revolutions: int


def synchronous_average(record: AngularRecord) -> SynchronousAverage:
    """Return the mean revolution of a record at about one speed (S. Braun, Acustica 32, 1975)."""
    mean = record.waveform.mean(axis=1)
    rest = np.sqrt(np.mean((record.waveform - mean[:, None]) ** 2, axis=(1, 2)))
    return SynchronousAverage(mean, rest / np.sqrt(record.revolutions), record.revolutions)


def synchronous_residual(record: AngularRecord, revolutions: int = 16) -> AngularRecord:
    """Return the synchronous residual of a record: each revolution minus the mean of its neighbours.

    The residual contains whirl, rub and noise. 1X, 2X and all whole orders are removed as far as they are steady over
    the averaged revolutions. A component of non-integer order loses at most 1 / revolutions of its amplitude.

    Parameters
    ----------
    record : AngularRecord
        At any speed, also a run-up.
    revolutions : int
        Number of revolutions averaged around each revolution; at least 2.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions.

    Notes
    -----
    P. McFadden, A revised model for the extraction of periodic waveforms by time domain averaging, MSSP 1, 1987.
    """
    if revolutions < 2:
        raise ValueError(f"revolutions: {revolutions}, expected at least 2")
    record.require(revolutions)
    mean = uniform_filter1d(record.waveform, revolutions, axis=1, mode="nearest")
    return record.with_waveform(record.waveform - mean)
