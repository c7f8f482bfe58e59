"""Vectors (amplitude and phase) of one order, whole or not, through a record, with their uncertainty."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import ComplexArray, FloatArray
from analysis.signals.uncertainty import noise_floor_sigma, phase_sigma
from analysis.spectra.order_map import RevolutionFrames
from analysis.spectra.windows import HANN

MAX_NOISE_RATIO = 3.0  # of a line to the median; one noise line in 500 is larger
FLOOR_LINES = 6  # lines on either side of the order, beyond the main lobe, for the noise floor


@dataclass(frozen=True, slots=True, eq=False)
class OrderTrack:
    """Vectors of one order in successive frames.

    Parameters
    ----------
    order : float
        Frequency over shaft frequency.
    vectors : ndarray of complex128, shape (2, n)
        At the probes x and y, m peak, x(t) = Re[X exp(i order theta)]; theta counts from the first pulse, so that the
        phase of a non-integer order is continuous. Phases are shown as lag, -arg X.
    sigma : ndarray of float64, shape (2, n)
        Standard deviation of each amplitude, m peak.
    phase_sigma : ndarray of float64, shape (2, n)
        Standard deviation of each phase, rad, from noise and tacho jitter; pi / sqrt(3), that of an unknown phase,
        without a tacho.
    speeds : ndarray of float64, shape (n,)
        Mean speed of each frame, rad/s.
    speed_sigma : ndarray of float64, shape (n,)
        Standard deviation of the speeds, rad/s; NaN without a tacho.
    times : ndarray of float64, shape (n,)
        Middle of each frame, s.
    revolutions, step : int
        Revolutions in a frame, and from one frame to the next.
    """

    order: float
    vectors: ComplexArray
    sigma: FloatArray
    phase_sigma: FloatArray
    speeds: FloatArray
    speed_sigma: FloatArray
    times: FloatArray
    revolutions: int
    step: int

    def subtract(self, vectors: ComplexArray, sigma: FloatArray) -> "OrderTrack":
        """Return the track minus one vector per probe, shape (2,), such as run-out; variances add."""
        residual = self.vectors - vectors[:, None]
        both = np.hypot(self.sigma, sigma[:, None])
        angle = np.sqrt(
            np.maximum(self.phase_sigma**2 - (self.sigma / np.maximum(np.abs(self.vectors), 1e-300)) ** 2, 0.0)
        )
        # an error of the angle turns the whole measured vector, not only the residual
        turned = angle * np.abs(self.vectors) / np.maximum(np.abs(residual), 1e-300)
        return replace(self, vectors=residual, sigma=both, phase_sigma=phase_sigma(np.abs(residual), both, turned, 1.0))


def track_order(record: AngularRecord, order: float, *, revolutions: int = 16, overlap: float = 0.75) -> OrderTrack:
    """Return the vectors of one order, whole or not, by a Hann window over many revolutions.

    Parameters
    ----------
    record : AngularRecord
        Displacement against angle.
    order : float
        Above 0; components closer than 2 / revolutions to it are not resolved.
    revolutions : int
        Revolutions in a frame; at least 8 to resolve whirl from 1X.
    overlap : float
        Overlap of successive frames, 0 to below 1.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than a frame.
    ValueError
        Order or settings out of range.

    Notes
    -----
    X = 2 sum(w x exp(-i order theta)) with a Hann window w of sum 1 (A. Brandt, Noise and Vibration Analysis, 2011, ch.
    12). The amplitude uncertainty comes from the median of the lines beside the order that are clear of the main lobes
    of the whole orders (see `analysis.signals.uncertainty`).
    """
    if not 0.0 < order <= record.highest_order or revolutions < 4:
        raise ValueError(
            f"order {order}, revolutions {revolutions}: expected above 0 to {record.highest_order}, at least 4"
        )
    frames = RevolutionFrames(record, revolutions, overlap, HANN)
    lines = _lines(order, revolutions)
    kernel = _kernel(lines, revolutions * record.points, record.points)
    found = np.empty((2, len(frames), lines.size), dtype=np.complex128)
    for where, waveforms in frames.chunks():
        found[:, where] = waveforms @ kernel
    sigma = np.hypot(noise_floor_sigma(_floor(np.abs(found[:, :, 1:]))), frames.clipping_sigma)
    vectors = found[:, :, 0] * np.exp(-2j * np.pi * order * frames.turns)
    angle_sigma = frames.angle_sigma if record.is_measured else np.full(len(frames), np.inf)
    return OrderTrack(
        order=order,
        vectors=vectors,
        sigma=sigma,
        phase_sigma=phase_sigma(np.abs(vectors), sigma, angle_sigma, order),
        speeds=frames.speeds,
        speed_sigma=frames.speed_sigma,
        times=frames.times,
        revolutions=revolutions,
        step=frames.step,
    )


def _lines(order: float, revolutions: int) -> FloatArray:
    """Return the order and the lines beside it for the noise floor, clear of the whole orders where possible."""
    away = np.arange(HANN.main_lobe + 1, HANN.main_lobe + 1 + FLOOR_LINES) / revolutions
    beside = np.concatenate([order - away, order + away])
    beside = beside[beside > (HANN.main_lobe - 0.5) / revolutions]
    clear = np.abs(beside - np.round(beside)) * revolutions > HANN.main_lobe - 0.01
    return np.concatenate([[order], beside[clear] if clear.any() else beside])


def _floor(sizes: FloatArray) -> FloatArray:
    """Return the median over the lines of each frame, shape (2, n, n_lines), without lines above the noise."""
    median = np.median(sizes, axis=(0, 2), keepdims=True)
    return np.asarray(np.nanmedian(np.where(sizes <= MAX_NOISE_RATIO * median, sizes, np.nan), axis=(0, 2)))


def _kernel(lines: FloatArray, points: int, points_per_turn: int) -> ComplexArray:
    """Return the matrix that gives the lines of a frame, shape (points, n_lines)."""
    theta = 2.0 * np.pi * np.arange(points) / points_per_turn
    kernel = 2.0 * HANN.weights(points)[:, None] * np.exp(-1j * theta[:, None] * lines)
    return np.asarray(kernel - HANN.weights(points)[:, None] * kernel.sum(axis=0))  # makes a constant vanish
