"""Standard deviations of the amplitude and phase of spectral lines.

Noise in a spectrum is assumed complex normal: its amplitudes are Rayleigh distributed, with a median of 1.1774 times
the standard deviation of the real or imaginary part. Systematic errors are not included: tacho delay, probe
calibration, run-out.
"""

import numpy as np

from analysis.signals import FloatArray

MAD_TO_SIGMA = 1.4826  # standard deviation of normal noise over its median absolute deviation
RAYLEIGH_MEDIAN = float(np.sqrt(2.0 * np.log(2.0)))  # over the standard deviation of the real or imaginary part


def noise_floor_sigma(floor: FloatArray) -> FloatArray:
    """Return the standard deviation of a line's amplitude from the median ``floor`` of the neighbouring lines.

    For white noise of rms sigma_x this is sigma_x sqrt(2 B / N) with N samples in the frame and a noise bandwidth of B
    lines (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    return np.asarray(floor / RAYLEIGH_MEDIAN, dtype=np.float64)


def phase_sigma(amplitude: FloatArray, sigma: FloatArray, angle_sigma: FloatArray, order: float) -> FloatArray:
    """Return the standard deviation of a line's phase, rad, at most pi / sqrt(3), that of an unknown phase.

    Parameters
    ----------
    amplitude, sigma : ndarray of float64
        Amplitude and its standard deviation, in the same unit.
    angle_sigma : ndarray of float64
        Standard deviation of the shaft angle, from the tacho jitter, rad.
    order : float
        Order of the line, by which the error of the angle is multiplied.

    Notes
    -----
    sigma / A for a line well above the noise (D. Rife and R. Boorstyn, IEEE Trans. Inf. Theory 20, 1974); pi / sqrt(3)
    is the rms of an angle that is uniformly distributed from -pi to pi.
    """
    ratio = np.divide(sigma, amplitude, out=np.full(np.shape(amplitude), np.inf), where=amplitude > 0.0)
    return np.asarray(np.minimum(np.hypot(ratio, order * angle_sigma), np.pi / np.sqrt(3.0)), dtype=np.float64)


def clipping_sigma(fraction: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Return the standard deviation of an order's amplitude, of any order, in a waveform whose peaks are clipped.

    Parameters
    ----------
    fraction : ndarray of float64
        Fraction of the samples at a limit of the converter range.
    amplitude : ndarray of float64
        Root 2 times the rms of the waveform, m.

    Notes
    -----
    A sine of amplitude A of which one peak is cut off over the angle 2a, a = pi fraction, lacks (A / pi) (sin a - a cos
    a) of its mean; the amplitude of any line changes by at most twice that. The error lies between 0 and this bound, so
    that its standard deviation is the bound over root 3 (JCGM 100:2008, 4.3.7).
    """
    half = np.pi * fraction
    bound = 2.0 * amplitude / np.pi * (np.sin(half) - half * np.cos(half))
    return np.asarray(bound / np.sqrt(3.0), dtype=np.float64)


def independent_frames(weights: FloatArray, step: int, frames: int, *, of_power: bool = False) -> float:
    """Return the number of independent frames whose mean has the same variance as that of overlapping frames.

    Parameters
    ----------
    weights : ndarray of float64, shape (n,)
        The window.
    step : int
        Distance from one frame to the next, in points of the window.
    frames : int
        Number of averaged frames, at least 1.
    of_power : bool
        Whether powers are averaged; otherwise vectors.

    Notes
    -----
    The noise of frames k steps apart has the autocorrelation of the window, rho_k, their powers its square;
    the mean of n has 1 / n + 2 / n² sum (n - k) rho_k of one frame's variance (P. Welch, IEEE Trans. Audio
    Electroacoust. 15, 1967).
    """
    lags = np.arange(1, min(-(-weights.size // step), frames))
    energy = float(weights @ weights)
    alike = np.array([float(weights[: weights.size - lag] @ weights[lag:]) / energy for lag in (lags * step).tolist()])
    alike = alike**2 if of_power else alike
    return float(frames / (1.0 + 2.0 * np.sum((1.0 - lags / frames) * alike)))


def mean_angle_sigma(speeds: FloatArray, jitter: float, revolutions: int, noise_bandwidth: float) -> FloatArray:
    """Return the standard deviation of the shaft angle, averaged by a window over many revolutions, rad.

    Parameters
    ----------
    speeds : ndarray of float64
        Speed of each frame, rad/s.
    jitter : float
        Standard deviation of the pulse times, independent of one another, s.
    revolutions : int
        Revolutions in a frame, with one pulse each.
    noise_bandwidth : float
        Equivalent noise bandwidth B of the window, lines.

    Notes
    -----
    The window averages independent errors as it averages noise: jitter sqrt(B / revolutions).
    """
    return np.asarray(speeds * jitter * np.sqrt(noise_bandwidth / revolutions), dtype=np.float64)
