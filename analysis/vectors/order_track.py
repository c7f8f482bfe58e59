"""Vectors (amplitude and phase) of one order, whole or not, through a record, with their uncertainty."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import BoolArray, ComplexArray, FloatArray
from analysis.signals.uncertainty import noise_floor_sigma, phase_sigma
from analysis.spectra.order_map import RevolutionFrames
from analysis.spectra.windows import HANN

MAX_NOISE_RATIO = 3.0  # of a line to the median; one noise line in 500 is larger
MIN_SHORT_REVOLUTIONS = 8  # in a frame of half the length, to resolve whirl from 1X
MAX_SHORT_SIGMA = 0.5  # standard deviation of frames of half the length that are used, over that of the others
NEIGHBOUR_SPAN, MIN_NEIGHBOUR_SPAN = 12, 3  # frame lengths in which unresolved neighbours are sought
MIN_NEIGHBOUR_FRAMES = 10
MIN_BEATS = 3.0  # of a neighbour with the order in these frames
MAX_NEIGHBOUR_CHANGE = 0.5  # of a neighbour from the first half of these frames to the second
MAX_NEIGHBOUR_RESIDUAL = 0.5  # of the fit with a neighbour to that without
MIN_NEIGHBOUR_SIGMAS = 3.0  # amplitude of a neighbour over that of the noise
BIAS_LEFT = 0.5  # of the bias of fourth order: its uncertainty
MIN_BIAS_SIGMAS = 6.0  # standard deviations of the window's bias that is subtracted
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
        Standard deviation of each amplitude, m peak: noise, clipped samples, and what remains of the window's bias.
    phase_sigma : ndarray of float64, shape (2, n)
        Standard deviation of each phase, rad, from noise and tacho jitter; pi / sqrt(3), that of an unknown phase,
        without a tacho.
    speeds : ndarray of float64, shape (n,)
        Speed in the middle of each frame, rad/s.
    speed_sigma : ndarray of float64, shape (n,)
        Standard deviation of the speeds, rad/s; NaN without a tacho.
    times : ndarray of float64, shape (n,)
        Middle of each frame, s.
    revolutions, step : int
        Revolutions in a frame, and from one frame to the next.
    neighbour : ndarray of float64, shape (n,)
        Order of a component too close to be resolved by a frame, found over many frames and subtracted; NaN for none.
    leakage : ndarray of float64, shape (2, n)
        Part of each vector that it was, m peak; 0 for none.
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
    neighbour: FloatArray
    leakage: FloatArray

    @property
    def revolutions_needed(self) -> int:
        """Revolutions in a frame that would resolve all neighbours; those of a frame where there are none."""
        distance = np.abs(self.neighbour[np.isfinite(self.neighbour)] - self.order)
        needed = [math.ceil(round(HANN.main_lobe / float(each), 1)) for each in distance]
        return max([self.revolutions, *needed])

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

    A window averages: where the vector changes on a ramp through a resonance, it reads the vector plus moments of the
    window times the vector's second and fourth derivative. Both are subtracted by differences of successive frames, and
    half the latter is part of the uncertainty; frames of half the length are used where their uncertainty is less.
    """
    if not 0.0 < order <= record.highest_order or revolutions < 4:
        raise ValueError(
            f"order {order}, revolutions {revolutions}: expected above 0 to {record.highest_order}, at least 4"
        )
    frames = RevolutionFrames(record, revolutions, overlap, HANN)
    vectors, sigma, biased, neighbour, leakage = _estimate(record, order, frames)
    to_next = min(order, abs(order - round(order)) or 1.0)  # orders, to 0 and to other whole orders
    is_clear = to_next * (revolutions // 2) >= HANN.main_lobe
    if revolutions // 2 >= MIN_SHORT_REVOLUTIONS and is_clear and len(frames) > 2:
        margin = revolutions // 4  # frames of half the length with the same middles
        inner = record.section(margin, record.revolutions - margin)
        short = RevolutionFrames(inner, revolutions // 2, max(1.0 - 2.0 * frames.step / revolutions, 0.0), HANN)
        if len(short) == len(frames) and short.step == frames.step:
            other, other_sigma, _, _, other_leakage = _estimate(record, order, short)
            better = (
                biased
                & (other_sigma.max(axis=0) < MAX_SHORT_SIGMA * sigma.max(axis=0))
                & (other_leakage.max(axis=0) == 0.0)
            )
            vectors, sigma = np.where(better, other, vectors), np.where(better, other_sigma, sigma)
    angle_sigma = frames.angle_sigma if record.is_measured else np.full(len(frames), np.inf)
    return OrderTrack(
        order=order,
        vectors=vectors,
        sigma=sigma,
        phase_sigma=phase_sigma(np.abs(vectors), sigma, angle_sigma, order),
        speeds=frames.middle_speeds,
        speed_sigma=frames.speed_sigma,
        times=frames.times,
        revolutions=revolutions,
        step=frames.step,
        neighbour=neighbour,
        leakage=leakage,
    )


def _estimate(
    record: AngularRecord, order: float, frames: RevolutionFrames
) -> tuple[ComplexArray, FloatArray, BoolArray, FloatArray, FloatArray]:
    """Return the vectors of frames, their standard deviation, where they were biased, neighbours and leakage."""
    lines = _lines(order, frames.revolutions)
    kernel = _kernel(lines, frames.revolutions * record.points, record.points)
    found = np.empty((2, len(frames), lines.size), dtype=np.complex128)
    for where, waveforms in frames.chunks():
        found[:, where] = waveforms @ kernel
    vectors = found[:, :, 0] * np.exp(-2j * np.pi * order * frames.turns)
    noise = noise_floor_sigma(_floor(np.abs(found[:, :, 1:])))
    neighbour, tone, noise = _neighbours(vectors, noise, order, frames)
    turned = order * np.abs(vectors) * frames.angle_sigma  # by errors of the angle
    corrected, sigma, biased = _without_bias(vectors - tone, noise, turned, frames)
    of_frame = np.asarray(biased.any(axis=0))
    return corrected, np.hypot(sigma, frames.clipping_sigma), of_frame, neighbour, np.abs(tone)


def _without_bias(
    vectors: ComplexArray, noise: FloatArray, turned: FloatArray, frames: RevolutionFrames
) -> tuple[ComplexArray, FloatArray, BoolArray]:
    """Return vectors minus the window's bias, their standard deviation, and where the bias stood out of the noise.

    The bias of second and fourth order follows from differences of vectors about a quarter of a frame apart. Half of
    that of fourth order, for what is left, or a bias that does not stand out, is part of the standard deviation.
    """
    apart = max(round(frames.revolutions / (4 * frames.step)), 1)
    sigma = np.tile(noise, (2, 1))
    if vectors.shape[1] < 2 * apart + 1:
        return vectors, sigma, np.zeros(sigma.shape, dtype=np.bool_)
    ratio = (frames.revolutions / (apart * frames.step)) ** 2
    part = 0.5 * HANN.second_moment * ratio  # of the second difference
    fourth = HANN.fourth_moment * ratio**2 / 24.0 - part**2 - part / 12.0
    second, usual = _second_difference(vectors, apart), np.hypot(np.maximum(noise, np.median(noise)), turned)
    near, far = (HANN.correlation(frames.revolutions, lag * apart * frames.step) for lag in (1, 2))
    biased = np.abs(part * second) > MIN_BIAS_SIGMAS * part * np.sqrt(6.0 + 2.0 * far - 8.0 * near) * usual
    biased[:, :apart] = biased[:, vectors.shape[1] - apart :] = False  # whose curvature is that of other frames
    own = 1.0 + 2.0 * part
    inflation = np.sqrt(own**2 + 2.0 * part**2 * (1.0 + far) - 4.0 * own * part * near)
    of_fourth_order = fourth * _second_difference(second, apart)
    left = np.where(biased, BIAS_LEFT * np.abs(of_fourth_order), np.abs(part * second))
    beside = np.minimum(noise, np.median(noise))  # the sidebands of an order that changes are no noise
    sigma = np.hypot(np.where(biased, inflation * beside, noise), left)
    return vectors - np.where(biased, part * second + of_fourth_order, 0.0), sigma, biased


def _second_difference(values: ComplexArray, apart: int) -> ComplexArray:
    """Return second differences along the last axis, those at the ends of the nearest values that have one."""
    inner = values[:, 2 * apart :] - 2.0 * values[:, apart:-apart] + values[:, : -2 * apart]
    return np.pad(inner, ((0, 0), (apart, apart)), mode="edge")


def _neighbours(
    vectors: ComplexArray, noise: FloatArray, order: float, frames: RevolutionFrames
) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Return the orders of unresolved neighbours, their part of each vector, and the noise without them.

    A component within the main lobe turns the vectors by its distance in orders from frame to frame. It is fitted to
    stretches of frames together with a parabola for the order itself, and accepted where that halves the residual and
    both halves of the stretch contain it alike: a passage through a resonance is no component.
    """
    neighbour, tone, noise = np.full(vectors.shape[1], np.nan), np.zeros_like(vectors), noise.copy()
    in_frame = frames.revolutions / frames.step  # frames that begin within one
    count = max(int(vectors.shape[1] / (NEIGHBOUR_SPAN * in_frame)), 1)
    for stretch in np.array_split(np.arange(vectors.shape[1]), count):
        n = stretch.size
        if n < max(MIN_NEIGHBOUR_SPAN * in_frame, MIN_NEIGHBOUR_FRAMES):
            continue
        rows, smooth = vectors[:, stretch].T, np.vander(np.linspace(-1.0, 1.0, n), 3).astype(np.complex128)
        rest = rows - smooth @ np.linalg.lstsq(smooth, rows, rcond=None)[0]
        lines = np.fft.fft(rest * np.hanning(n + 2)[1:-1, None], 8 * n, axis=0)
        power = np.sum(np.abs(lines) ** 2, axis=1)
        distances = np.fft.fftfreq(8 * n, frames.step)
        distance = _refined(distances, np.where(np.abs(distances) * frames.step * n < MIN_BEATS, 0.0, power))
        basis = np.column_stack([np.exp(2j * np.pi * distance * frames.step * np.arange(n)), smooth])
        fit = np.linalg.lstsq(basis, rows, rcond=None)[0]
        halves = [np.linalg.lstsq(basis[part], rows[part], rcond=None)[0][0] for part in np.array_split(range(n), 2)]
        size = float(np.linalg.norm(fit[0]))
        left = float(np.linalg.norm(rows - basis @ fit))
        steady = np.linalg.norm(halves[1] - halves[0]) < MAX_NEIGHBOUR_CHANGE * size
        halved = left < MAX_NEIGHBOUR_RESIDUAL * np.linalg.norm(rest)
        if halved and steady and size > MIN_NEIGHBOUR_SIGMAS * float(np.median(noise[stretch])):
            neighbour[stretch] = order + distance
            tone[:, stretch] = (basis[:, :1] @ fit[:1]).T
            independent = HANN.independent_frames(frames.revolutions, frames.step, n)
            scatter = left / math.sqrt(4.0 * n * max(1.0 - basis.shape[1] / independent, 1.0 / n))
            noise[stretch] = np.minimum(noise[stretch], scatter)  # the neighbour's skirts are in the lines beside
    return neighbour, tone, noise


def _refined(distances: NDArray[np.floating], power: NDArray[np.floating]) -> float:
    """Return the place of the highest peak, by a parabola through its logarithm."""
    at = int(np.argmax(power))
    low, peak, high = np.log(np.maximum(power[[at - 1, at, (at + 1) % power.size]], 1e-300))
    curvature = low - 2.0 * peak + high
    offset = 0.5 * (low - high) / curvature if curvature < 0.0 else 0.0
    return float(distances[at] + np.clip(offset, -0.5, 0.5) * (distances[1] - distances[0]))


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
