"""Oil whirl: its order, growth rate, and the film in which it occurs.

A whirl is assigned to the film whose surfaces move more relative to each other, in units of the film clearance: the
journal in the ring (inner film) or the ring in the housing (outer film). The work done by the films is no criterion: at
the onset of outer-film whirl the inner film feeds the whirl, because the whirl frequency is just half the sum of the
surface speeds of the outer film.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class FilmName(StrEnum):
    """The two films in series."""

    INNER = "inner"  # journal in ring
    OUTER = "outer"  # ring in housing


@dataclass(frozen=True, slots=True)
class Whirl:
    """A whirl disturbance of the synchronous motion.

    Parameters
    ----------
    growth_rate : float
        1/s; positive if it grows.
    order : float
        Frequency over shaft speed; negative for reverse whirl.
    inner_share : float
        Share of the inner films in the motion of all films, in units of their clearances, 0 to 1.
    """

    growth_rate: float
    order: float
    inner_share: float

    @property
    def film(self) -> FilmName:
        """The film with the larger share of the whirl."""
        return dominant_film(self.inner_share)


def dominant_film(share: float) -> FilmName:
    """Return the film with the larger share of a whirl, given the share of the inner film."""
    return FilmName.INNER if share > 0.5 else FilmName.OUTER


def inner_shares(eccentricities: NDArray[np.generic]) -> FloatArray:
    """Return the share of the inner films, (...), of eccentricity ratios, (4, ...), inner films first."""
    inner, outer = (np.linalg.norm(films, axis=0) for films in (eccentricities[:2], eccentricities[2:]))
    both = inner + outer
    return np.asarray(np.divide(inner, both, out=np.full_like(both, 0.5), where=both > 0))


def order_and_share(eccentricities: ComplexArray, exponent: complex) -> tuple[float, float]:
    """Return order and inner share of a disturbance from its time history over a turn.

    Parameters
    ----------
    eccentricities : ndarray of complex128, shape (4, 2, n)
        Eccentricity ratios of the films, inner films first, in X and Y at the ends of n equal steps; the disturbance is
        the real part.
    exponent : complex
        Floquet exponent per radian of shaft angle, exp(exponent theta); its imaginary part is known up to an
        integer.

    Returns
    -------
    order : float
        Order of the largest circular component of the disturbance; negative for reverse whirl.
    inner_share : float
        Inner share of that component.
    """
    n = eccentricities.shape[-1]
    theta = 2 * math.pi * np.arange(1, n + 1) / n
    x, y = eccentricities[:, 0], eccentricities[:, 1]
    # Re[X] + i Re[Y] consists of a forward circle (X + i Y)/2 and a reverse circle (X - i Y)/2
    circles = np.fft.fft(np.stack((x + 1j * y, x - 1j * y)) * np.exp(-exponent * theta), axis=-1)
    direction, line = np.unravel_index(int(np.argmax(np.linalg.norm(circles, axis=1))), (2, n))
    order = exponent.imag + float(np.fft.fftfreq(n, 1 / n)[line])
    return (order if direction == 0 else -order), float(inner_shares(circles[direction, :, line]))
