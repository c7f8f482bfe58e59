"""How far amplitude, phase and order of a line are to be trusted, in standard deviations.

Noise in a spectrum is taken as complex normal: its amplitudes are Rayleigh distributed, their median 1.1774 times the
standard deviation of one part. What all pulses of the tacho have in common (its delay), the calibration of the probes
and run-out are not in these figures.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

RAYLEIGH_MEDIAN = float(np.sqrt(2.0 * np.log(2.0)))  # over the standard deviation of one part
NEIGHBOUR_CORRELATION = 2.0 / 3.0  # correlation of the noise of two lines side by side, Hann, each along its own phase
MIN_AMPLITUDE = 1e-100  # amplitude, in any unit: below it there is no line


def noise_floor_sigma(floor: FloatArray) -> FloatArray:
    """Return the standard deviation of a line's amplitude where the median of the lines beside it is ``floor``.

    In white noise of rms sigma_x that is sigma_x sqrt(2 B / N) with N samples in the frame and a noise bandwidth of B
    lines, 1.5 for Hann's window (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    return np.asarray(floor / RAYLEIGH_MEDIAN, dtype=np.float64)


def phase_sigma(amplitude: FloatArray, sigma: FloatArray, angle_sigma: FloatArray, order: float) -> FloatArray:
    """Return the standard deviation of a line's phase, rad, at most that of an unknown phase, pi / sqrt(3).

    Parameters
    ----------
    amplitude, sigma : ndarray of float64
        Amplitude and its standard deviation, in the same unit.
    angle_sigma : ndarray of float64
        Of the shaft's angle, from the tacho's jitter, rad.
    order : float
        Of the line: the angle's error counts so many times.

    Notes
    -----
    sigma / A for a line well above the noise (D. Rife and R. Boorstyn, IEEE Trans. Inf. Theory 20, 1974); the rms of an
    angle that may be any.
    """
    ratio = np.divide(sigma, amplitude, out=np.full(np.shape(amplitude), np.inf), where=amplitude > 0.0)
    return np.asarray(np.minimum(np.hypot(ratio, order * angle_sigma), np.pi / np.sqrt(3.0)), dtype=np.float64)


def independent_frames(weights: FloatArray, step: int, frames: int, *, of_power: bool = False) -> float:
    """Return as how many independent frames so many overlapping ones count in their mean.

    Parameters
    ----------
    weights : ndarray of float64, shape (n,)
        The window.
    step : int
        From one frame to the next, in points of the window.
    frames : int
        That are averaged, at least 1.
    of_power : bool
        Whether powers are averaged; else vectors.

    Notes
    -----
    The noise of frames k steps apart is correlated by the window's own correlation rho_k, their powers by its square;
    the mean of n has 1 / n + 2 / n² sum (n - k) rho_k of one frame's variance (P. Welch, IEEE Trans. Audio
    Electroacoust. 15, 1967).
    """
    lags = np.arange(1, min(-(-weights.size // step), frames))
    energy = float(weights @ weights)
    alike = np.array([float(weights[: weights.size - lag] @ weights[lag:]) / energy for lag in (lags * step).tolist()])
    alike = alike**2 if of_power else alike
    return float(frames / (1.0 + 2.0 * np.sum((1.0 - lags / frames) * alike)))


def mean_angle_sigma(speeds: FloatArray, jitter: float, revolutions: int) -> FloatArray:
    """Return the standard deviation of the shaft's angle, rad, as a Hann window over many revolutions feels it.

    Parameters
    ----------
    speeds : ndarray of float64
        Of the frames, rad/s.
    jitter : float
        Scatter of the pulses, independent of one another, s.
    revolutions : int
        In a frame, one pulse in each.

    Notes
    -----
    Independent errors average out under the window as noise does: jitter sqrt(1.5 / revolutions).
    """
    return np.asarray(speeds * jitter * np.sqrt(1.5 / revolutions), dtype=np.float64)


def order_sigma(peak: FloatArray, neighbour: FloatArray, sigma: FloatArray, revolutions: int) -> FloatArray:
    """Return the standard deviation of an order interpolated between two lines of a Hann window.

    Parameters
    ----------
    peak, neighbour : ndarray of float64
        Amplitudes A of the peak's line and B of its larger neighbour.
    sigma : ndarray of float64
        Standard deviation of one line, in the same unit.
    revolutions : int
        In the frame.

    Notes
    -----
    delta = (2B - A) / (A + B) lines; its variance is 9 (A² + B² - 2 rho A B) sigma² / (A + B)^4 with the noise of the
    two lines, each along its own phase, correlated by rho = 2/3.
    """
    spread = peak**2 + neighbour**2 - 2.0 * NEIGHBOUR_CORRELATION * peak * neighbour
    total = np.maximum(peak + neighbour, MIN_AMPLITUDE)
    return np.asarray(3.0 * np.sqrt(spread) / total * (sigma / total) / revolutions, dtype=np.float64)
