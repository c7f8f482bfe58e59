"""Run-out compensation: run-out from the slow roll of a record, and estimation during a run.

Live, `OrderFrame.compensated` (`analysis.signals.snapshot`) subtracts it from 1X and 2X.
"""

from dataclasses import dataclass

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import ComplexArray, FloatArray
from analysis.signals.errors import RecordTooShortError
from analysis.signals.header import RunOutSettings
from analysis.signals.snapshot import RunOut
from analysis.signals.standards import allowed_combined_runout
from analysis.vectors.order_track import OrderTrack

MAX_SPEED_FRACTION = 0.1  # of the first critical speed, of a valid slow roll: the shaft hardly vibrates there
MIN_REVOLUTIONS = 8  # revolutions
MAX_DRIFT = 0.2  # relative change of the 1X vector over a valid slow roll
RUN_UP_FACTOR = 1.05  # times the slow-roll speed: above it the run-out estimate is final


@dataclass(frozen=True, slots=True, eq=False)
class SlowRoll:
    """Run-out measured during a slow roll.

    Parameters
    ----------
    waveform : ndarray of float64, shape (2, points)
        Towards the probes x and y from theta = 0 on, m, mean subtracted.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of its points, m.
    vector_sigma : ndarray of float64, shape (2,)
        Standard deviation of the amplitudes of the vectors, m peak.
    slowest, fastest : float
        Speed range of the revolutions used, rad/s.
    revolutions : int
        Number of averaged revolutions.
    drift : float
        Change of the 1X vector between the two halves of the slow roll, over 1X: above 0.2 the shaft vibrated.
    """

    waveform: FloatArray
    sigma: FloatArray
    vector_sigma: FloatArray
    slowest: float
    fastest: float
    revolutions: int
    drift: float

    def vectors(self, order: int) -> ComplexArray:
        """Return the run-out vector of a whole order at the probes, shape (2,), m peak."""
        if order < 1 or 2 * order >= self.waveform.shape[1]:
            raise ValueError(f"order: {order}, expected a whole order from 1 to {self.waveform.shape[1] // 2 - 1}")
        return np.asarray(2.0 * np.fft.rfft(self.waveform, axis=1)[:, order] / self.waveform.shape[1])

    @property
    def peak_to_peak(self) -> FloatArray:
        """Run-out at each probe, shape (2,), m peak-to-peak."""
        return np.asarray(np.ptp(self.waveform, axis=1), dtype=np.float64)

    def is_valid(self, critical_speed: float) -> bool:
        """Whether it was far below the first critical speed, rad/s, and the shaft did not vibrate."""
        return self.fastest <= MAX_SPEED_FRACTION * critical_speed and self.drift <= MAX_DRIFT

    def exceeds_api_670(self, allowed: float) -> bool:
        """Whether the run-out exceeds the limit of API 670 for an allowed vibration, m peak-to-peak."""
        return bool(self.peak_to_peak.max() > allowed_combined_runout(allowed))

    def subtract_waveform(self, record: AngularRecord) -> AngularRecord:
        """Return a record minus the run-out at every angle, scratches included.

        A scratch narrower than about a sixteenth of a revolution may be removed only in part: it has orders above the
        highest order of the record.
        """
        if record.points != self.waveform.shape[1]:
            raise ValueError(f"record of {record.points} points per revolution, expected {self.waveform.shape[1]}")
        return record.with_waveform(record.waveform - self.waveform[:, None])

    def subtract_vectors(self, track: OrderTrack) -> OrderTrack:
        """Return the track of a whole order minus the run-out vector of that order; variances add."""
        if track.order != round(track.order):
            raise ValueError(f"track of order {track.order}, expected a whole order: run-out has no others")
        return track.subtract(self.vectors(round(track.order)), self.vector_sigma)


def slow_roll(record: AngularRecord, slowest: float, fastest: float) -> SlowRoll:
    """Return the run-out from the revolutions of a record between two speeds, rad/s.

    Parameters
    ----------
    record : AngularRecord
        Record that contains a slow roll.
    slowest, fastest : float
        Speed range of the revolutions used, rad/s.

    Raises
    ------
    RecordTooShortError
        Fewer than 8 such revolutions.

    Notes
    -----
    D. Bently and C. Hatch, Fundamentals of Rotating Machinery Diagnostics, 2002: slow-roll vector and waveform.
    """
    chosen = np.flatnonzero((record.speeds >= slowest) & (record.speeds <= fastest))
    if chosen.size < MIN_REVOLUTIONS:
        raise RecordTooShortError(
            f"{chosen.size} revolutions between {slowest:.1f} and {fastest:.1f} rad/s, expected at least "
            f"{MIN_REVOLUTIONS}"
        )
    used = record.waveform[:, chosen]
    used = used - used.mean(axis=2, keepdims=True)
    mean = used.mean(axis=1)
    rest = np.sqrt(np.mean((used - mean[:, None]) ** 2, axis=(1, 2)))
    first = np.fft.rfft(used, axis=2)[:, :, 1] * 2.0 / record.points
    halves = first[:, : chosen.size // 2].mean(axis=1) - first[:, chosen.size // 2 :].mean(axis=1)
    size = float(np.abs(first.mean(axis=1)).max())
    scatter = np.sqrt(0.5 * np.mean(np.abs(first - first.mean(axis=1, keepdims=True)) ** 2, axis=1))
    return SlowRoll(
        waveform=mean,
        sigma=rest / np.sqrt(chosen.size),
        vector_sigma=scatter / np.sqrt(chosen.size),
        slowest=float(record.speeds[chosen].min()),
        fastest=float(record.speeds[chosen].max()),
        revolutions=int(chosen.size),
        drift=float(np.abs(halves).max()) / size if size > 0.0 else 0.0,
    )


class RunOutEstimator:
    """Estimates the run-out from the order frames of a run, the same live and in replay.

    Frames up to the slow-roll speed are averaged. From the first clearly faster frame on, the mean is final, also for
    a later slow roll: the residual after the run-down then shows whether the run-out still applies.

    Parameters
    ----------
    settings : RunOutSettings
        Known vectors, or the slow-roll speed.
    """

    def __init__(self, settings: RunOutSettings) -> None:
        self._slow_roll = settings.slow_roll_speed
        self._known: RunOut | None = None
        self._sum: ComplexArray = np.zeros((0, 2), dtype=np.complex128)
        self._sigmas = np.zeros(2)
        self._frames = 0
        if settings.vectors:
            vectors = np.full((max(2, *(order for order, _, _ in settings.vectors)), 2), np.nan, dtype=np.complex128)
            for order, x, y in settings.vectors:
                vectors[order - 1] = x, y
            self._known = RunOut(vectors, np.array(settings.sigma))

    @property
    def estimate(self) -> RunOut | None:
        """Present estimate; None where nothing is known."""
        if self._known is not None or not self._frames:
            return self._known
        return RunOut(self._sum / self._frames, self._sigmas / self._frames)

    def update(self, speed: float, vectors: ComplexArray, sigma: FloatArray) -> RunOut | None:
        """Add a frame and return the run-out to subtract from it; None where unknown.

        Parameters
        ----------
        speed : float
            Mean speed of the frame, rad/s.
        vectors : ndarray of complex128, shape (n_orders, 2)
            Vectors of the whole orders from 1 on at the probes x and y, m peak.
        sigma : ndarray of float64, shape (2,)
            Standard deviation of the amplitudes of 1X and 2X, m peak.
        """
        if self._known is not None or not self._slow_roll > 0.0:
            return self._known
        if speed <= self._slow_roll:
            self._sum = vectors + (self._sum if self._frames else 0.0)
            self._sigmas = self._sigmas + sigma  # frames share samples: the mean counts as one frame
            self._frames += 1
        elif speed > RUN_UP_FACTOR * self._slow_roll:
            self._known = self.estimate
        return self._known
