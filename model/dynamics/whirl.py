"""Which film whirls, and at what order: told from how journals and rings move against each other.

A film whirls where its own surfaces move against each other: the journal in the ring, or the ring in the housing, each
in parts of that film's clearance. The work that the films do tells less: where the outer film lets go it is the inner
one that feeds the whirl, for the surfaces in the outer film go round at just half of their speed's sum.
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
    """A way in which the synchronous motion may be left.

    Parameters
    ----------
    growth_rate : float
        1/s; positive where it grows.
    order : float
        Frequency over the shaft's; negative where it goes against the shaft.
    inner_share : float
        Of its motion in both films, in parts of their clearances, that is in the inner ones, 0 to 1.
    """

    growth_rate: float
    order: float
    inner_share: float

    @property
    def film(self) -> FilmName:
        """The film that whirls."""
        return dominant_film(self.inner_share)


def dominant_film(share: float) -> FilmName:
    """Return the film in which most of a whirl is, of the inner one's share."""
    return FilmName.INNER if share > 0.5 else FilmName.OUTER


def inner_shares(eccentricities: NDArray[np.generic]) -> FloatArray:
    """Return the inner films' share of motions, (4, ...) in parts of the clearances, inner films first, (...)."""
    inner, outer = (np.linalg.norm(films, axis=0) for films in (eccentricities[:2], eccentricities[2:]))
    both = inner + outer
    return np.asarray(np.divide(inner, both, out=np.full_like(both, 0.5), where=both > 0))


def order_and_share(eccentricities: ComplexArray, exponent: complex) -> tuple[float, float]:
    """Return order and inner share of a disturbance from its course through a turn.

    Parameters
    ----------
    eccentricities : ndarray of complex128, shape (4, 2, n)
        Of the films, inner ones first, in X and Y at the ends of n equal steps: the disturbance is the real part of
        these.
    exponent : complex
        By which the disturbance grows and goes round in a radian of the shaft's angle, exp(exponent theta); the
        imaginary part is known only to whole numbers.

    Returns
    -------
    order : float
        Of the largest of the circles of which the disturbance consists; negative where against the shaft.
    inner_share : float
        Of that circle.
    """
    n = eccentricities.shape[-1]
    theta = 2 * math.pi * np.arange(1, n + 1) / n
    x, y = eccentricities[:, 0], eccentricities[:, 1]
    # Re[X] + i Re[Y] goes round with (X + i Y)/2, and against that with (X - i Y)/2
    circles = np.fft.fft(np.stack((x + 1j * y, x - 1j * y)) * np.exp(-exponent * theta), axis=-1)
    side, place = np.unravel_index(int(np.argmax(np.linalg.norm(circles, axis=1))), (2, n))
    turned = exponent.imag + float(np.fft.fftfreq(n, 1 / n)[place])
    return (turned if side == 0 else -turned), float(inner_shares(circles[side, :, place]))
