"""The strongest component below 1X, between the lines of an order spectrum."""

import numpy as np
from numpy.typing import NDArray

from analysis.orbit import ProbePair
from analysis.snapshot import Whirl

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LOWEST, HIGHEST = 0.08, 0.92  # orders searched
ABOVE_NOISE = 5.0  # times the floor
OF_SYNCHRONOUS = 0.005  # of 1X: what an imperfect angle leaves of it at least,
OF_SCATTER = 0.5  # and for each radian by which the marks scatter about the angle
_QUARTILE_TO_MEDIAN = 1.552  # of the Rayleigh distribution that the lines of noise have


def noise_floor(spectrum: ComplexArray, revolutions: int) -> float:
    """Return the median amplitude between the lines: two bins away from every whole order and from 0, m peak.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (n_probes, n_orders)
        From `analysis.orders.order_spectrum`.
    revolutions : int
        Revolutions in its frame.
    """
    bins = np.arange(spectrum.shape[-1])
    distance = np.abs(bins - revolutions * np.round(bins / revolutions))
    between = spectrum[:, distance > min(2, revolutions // 2 - 1)]
    return float(np.median(np.abs(between))) if between.size else 0.0


def without_synchronous(spectrum: ComplexArray, revolutions: int) -> ComplexArray:
    """Return the spectrum without 1X: its line and the two beside it that the Hann window gives it."""
    rest = spectrum.copy()
    line = spectrum[:, revolutions]
    rest[:, revolutions] = 0.0
    rest[:, revolutions - 1] += 0.5 * line
    rest[:, revolutions + 1] += 0.5 * line
    return rest


def find_whirl(
    spectrum: ComplexArray, revolutions: int, noise: float, pair: ProbePair, scatter: float = 0.0
) -> Whirl | None:
    """Return the strongest sub-synchronous component that stands above the floor, or None.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (2, n_orders)
        Hann spectrum of ``revolutions`` whole revolutions at the probes x and y, m peak, to 1X and a line beyond.
    revolutions : int
        Revolutions in the frame; at least 4.
    noise : float
        From `noise_floor`, m peak.
    pair : ProbePair
        Directions of the probes.
    scatter : float
        Of the tacho's marks about the smooth angle, rad: it modulates 1X, and lines of so small a part of 1X are not
        believed.

    Notes
    -----
    With A the line of the peak and B its larger neighbour, the component lies delta = (2 B - A) / (A + B) lines
    towards the neighbour, and the window shows it too small by sinc(delta) / (1 - delta²) (A. Brandt, Noise and
    Vibration Analysis, 2011, ch. 9; exact for one component in a periodic Hann window of many samples). The floor
    is also taken from the searched lines' lower quartile, where air and wandering speed raise it.
    """
    rest = without_synchronous(spectrum, revolutions)
    size = np.sqrt(np.sum(np.abs(rest) ** 2, axis=0))
    first = max(int(np.ceil(LOWEST * revolutions)), 2)
    last = int(HIGHEST * revolutions)
    searched = size[first : last + 1]
    is_peak = (searched >= size[first - 1 : last]) & (searched > size[first + 1 : last + 2])
    if not is_peak.any():
        return None
    line = first + int(np.argmax(np.where(is_peak, searched, -1.0)))
    side = 1 if size[line + 1] > size[line - 1] else -1
    delta = side * (2.0 * size[line + side] - size[line]) / (size[line] + size[line + side])
    delta = min(max(float(delta), -0.5), 0.5)  # further off it would be the neighbour's
    gain = np.sinc(delta) / (1.0 - delta**2)
    vectors = rest[:, line] / gain * np.exp(-1j * np.pi * delta)  # referred to the frame's first mark
    ellipse = pair.ellipse(vectors)
    floor = max(noise, _QUARTILE_TO_MEDIAN * float(np.quantile(np.abs(rest[:, first : last + 1]), 0.25)))
    synchronous = float(np.abs(spectrum[:, revolutions]).max())
    if ellipse.major <= max(ABOVE_NOISE * floor, (OF_SYNCHRONOUS + OF_SCATTER * scatter) * synchronous):
        return None
    order = (line + delta) / revolutions
    return Whirl(float(order), abs(ellipse.forward), abs(ellipse.backward), vectors)
