"""Spectral windows: one entry each, with its weights, main lobe, noise bandwidth and interpolation between lines.

A line is 1 / N of the sample rate for a frame of N samples, and 1 / R of an order for a frame of R revolutions. All
windows are periodic sums of cosines (F. Harris, Proc. IEEE 66, 1978).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from analysis.signals import BoolArray, FloatArray
from analysis.signals.header import WindowName
from analysis.signals.uncertainty import independent_frames

POINTS = 8  # per revolution, of the weights from which the correlation of overlapping frames is computed
MOMENT_POINTS = 1024  # of the weights from which their moments are computed
MIN_AMPLITUDE = 1e-100  # in any unit: smaller amplitudes are no line


@lru_cache(maxsize=16)
def _weights(cosines: tuple[float, ...], n: int) -> FloatArray:
    angle = 2.0 * np.pi * np.arange(n) / n
    weights = np.full(n, cosines[0])
    for harmonic, cosine in enumerate(cosines[1:], 1):
        weights += cosine * np.cos(harmonic * angle)
    weights /= weights.sum()
    weights.flags.writeable = False
    return weights


@dataclass(frozen=True, slots=True)
class LineInterpolation:
    """Rule that finds a component between two lines, from the peak line A and its larger neighbour B.

    Parameters
    ----------
    neighbour_weight, peak_weight : float
        b and a of the offset (b B - a A) / (A + B).
    noise_correlation : float
        Correlation of the noise of two adjacent lines, each along its own phase.
    gain : callable
        Amplitude of the peak line over that of the component, for an offset.
    """

    neighbour_weight: float
    peak_weight: float
    noise_correlation: float
    gain: Callable[[FloatArray], FloatArray]

    def offset(self, peak: FloatArray, neighbour: FloatArray) -> FloatArray:
        """Return the distance of the component from the peak line towards the neighbour, lines."""
        difference = self.neighbour_weight * neighbour - self.peak_weight * peak
        return np.asarray(difference / np.maximum(peak + neighbour, 1e-300), dtype=np.float64)

    def offset_sigma(self, peak: FloatArray, neighbour: FloatArray, sigma: FloatArray) -> FloatArray:
        """Return the standard deviation of the offset, lines.

        Parameters
        ----------
        peak, neighbour : ndarray of float64
            Amplitudes A and B.
        sigma : ndarray of float64
            Standard deviation of one line, in the same unit.

        Notes
        -----
        The variance of the offset is (a + b)² (A² + B² - 2 rho A B) sigma² / (A + B)^4.
        """
        spread = peak**2 + neighbour**2 - 2.0 * self.noise_correlation * peak * neighbour
        total = np.maximum(peak + neighbour, MIN_AMPLITUDE)
        return np.asarray(
            (self.neighbour_weight + self.peak_weight) * np.sqrt(spread) / total * (sigma / total), dtype=np.float64
        )


@dataclass(frozen=True, slots=True)
class Window:
    """A window with the constants that depend on it.

    Parameters
    ----------
    name : WindowName
        Its name in settings and requests.
    cosines : tuple of float
        a_k of the weights sum a_k cos(2 pi k n / N); a_0 is the coherent gain.
    noise_bandwidth : float
        Equivalent noise bandwidth, lines (A. Brandt, Noise and Vibration Analysis, 2011, table 9.2).
    rule : LineInterpolation or None
        Rule between two lines; None where there is none.
    """

    name: WindowName
    cosines: tuple[float, ...]
    noise_bandwidth: float
    rule: LineInterpolation | None = None

    @property
    def main_lobe(self) -> int:
        """Half width of the main lobe, lines: components must be so far apart, and so far from 0."""
        return len(self.cosines)

    @property
    def min_revolutions(self) -> int:
        """Revolutions in a frame from which the main lobes of successive whole orders only touch."""
        return 2 * self.main_lobe

    @property
    def side_lines(self) -> tuple[float, ...]:
        """The lines 1, 2, … away from a component that lies on a line, over it; all others are 0."""
        return tuple(0.5 * cosine / self.cosines[0] for cosine in self.cosines[1:])

    @property
    def second_moment(self) -> float:
        """Second moment of the weights about their middle, frames squared."""
        return self._moment(2)

    @property
    def fourth_moment(self) -> float:
        """Fourth moment of the weights about their middle, frames to the fourth."""
        return self._moment(4)

    def _moment(self, power: int) -> float:
        place = (np.arange(MOMENT_POINTS) + 0.5) / MOMENT_POINTS - 0.5
        return float(_weights(self.cosines, 2 * MOMENT_POINTS)[1::2] @ place**power) * 2.0

    def correlation(self, revolutions: int, lag: int) -> float:
        """Return the correlation of the noise of two frames ``lag`` revolutions apart."""
        weights = self.weights(POINTS * revolutions)
        shared = max(weights.size - POINTS * lag, 0)
        return float(weights[:shared] @ weights[weights.size - shared :] / (weights @ weights))

    @property
    def interpolation(self) -> LineInterpolation:
        """The rule between two lines; ValueError where the window has none."""
        if self.rule is None:
            raise ValueError(f"window: {self.name}, expected one with an interpolation between its lines")
        return self.rule

    def component(self, sizes: FloatArray, line: int) -> tuple[float, float]:
        """Return the distance, lines, from a peak line to its component, and the component's amplitude.

        Parameters
        ----------
        sizes : ndarray of float64, shape (n,)
            Amplitudes of the lines.
        line : int
            The peak, not the first or last; the line itself where the window has no rule between lines.
        """
        if self.rule is None:
            return 0.0, float(sizes[line])
        towards = 1 if sizes[line + 1] > sizes[line - 1] else -1
        # beyond half a line the peak would be the neighbour's, below 0 the other neighbour would be larger
        offset = towards * min(max(float(self.rule.offset(sizes[line], sizes[line + towards])), 0.0), 0.5)
        return offset, float(sizes[line] / self.rule.gain(np.asarray(offset)))

    def weights(self, n: int) -> FloatArray:
        """Return ``n`` weights that sum to 1 (shared: read only)."""
        return _weights(self.cosines, n)

    def response(self, offset: FloatArray) -> FloatArray:
        """Return the size of a line over that of a component ``offset`` lines away, with sign.

        The phase of the line is exp(i pi offset) times that of the component, for many samples.
        """
        size = np.sinc(offset)
        for k, side in enumerate(self.side_lines, 1):
            size = size + (-1) ** k * side * (np.sinc(offset - k) + np.sinc(offset + k))
        return np.asarray(size, dtype=np.float64)

    def clear_lines(self, count: int, revolutions: int) -> BoolArray:
        """Return which of the first ``count`` lines are clear of the main lobes of all whole orders and of 0.

        In a frame of so few revolutions that the lobes touch, these are the lines halfway between the orders.
        """
        lines = np.arange(count)
        distance = np.abs(lines - revolutions * np.round(lines / revolutions))
        return np.asarray(distance > min(self.main_lobe, revolutions // 2 - 1), dtype=np.bool_)

    def independent_frames(self, revolutions: int, step: int, count: int) -> float:
        """Return the number of independent frames that overlapping frames, ``step`` revolutions apart, are worth.

        Notes
        -----
        P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967.
        """
        return independent_frames(self.weights(POINTS * revolutions), POINTS * step, count)


def _hann_gain(offset: FloatArray) -> FloatArray:
    return np.asarray(np.sinc(offset) / (1.0 - offset**2), dtype=np.float64)


# Resolves lines two apart; between two lines up to 15 % low. Rule: A. Brandt, Noise and Vibration Analysis, 2011, ch. 9
HANN = Window(WindowName.HANN, (0.5, -0.5), 1.5, LineInterpolation(2.0, 1.0, 2.0 / 3.0, _hann_gain))
# Within 0.12 % at any frequency, the most halfway between two lines (ISO 18431-2)
FLAT_TOP = Window(
    WindowName.FLAT_TOP, (0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368), noise_bandwidth=3.7702
)
# Exact on the lines only; all else leaks
UNIFORM = Window(WindowName.UNIFORM, (1.0,), noise_bandwidth=1.0)

WINDOWS = {window.name: window for window in (HANN, FLAT_TOP, UNIFORM)}
