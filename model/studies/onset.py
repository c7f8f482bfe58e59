"""Where the oil films let go of the synchronous motion: growth of each one's whirl over speed, onsets by bisection."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.dynamics.stability import SynchronousOrbit, synchronous_orbit
from model.dynamics.synchronous import SynchronousResponse, synchronous_response
from model.dynamics.whirl import FilmName, Whirl, dominant_film
from model.errors import ModelError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_rising
from model.studies.linear import SPEED_LABEL
from model.studies.study import Plot, Series, Study, Style

FloatArray = NDArray[np.float64]

PRECISION = 1.0  # rad/s, of an onset
_UNKNOWN = Whirl(math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class UnstableBand:
    """Speeds at which a film's whirl would grow about the synchronous motion.

    Parameters
    ----------
    film : FilmName
        Which film lets go.
    start, stop : float
        rad/s; the ends of the search where it grows there.
    order : float
        Of the whirl at the start, over the shaft's speed.
    """

    film: FilmName
    start: float
    stop: float
    order: float


@dataclass(frozen=True, slots=True, eq=False)
class Stability:
    """Growth of the least stable whirl over speed, and of each film's.

    Parameters
    ----------
    speeds, growth_rates, orders, inner_shares : ndarray of float64, shape (n,)
        rad/s, and of the least stable whirl 1/s, over the shaft's speed, and the inner film's share
        (`model.dynamics.whirl.Whirl`); NaN where no synchronous motion was found.
    film_growth_rates : mapping of FilmName to ndarray of float64, shape (n,)
        Of each film's least stable whirl, 1/s.
    bands : tuple of UnstableBand
        Where each film's whirl grows, in rising order of their starts.
    """

    speeds: FloatArray
    growth_rates: FloatArray
    orders: FloatArray
    inner_shares: FloatArray
    film_growth_rates: Mapping[FilmName, FloatArray]
    bands: tuple[UnstableBand, ...]

    def onset(self, film: FilmName) -> float:
        """Return the first speed at which a film's whirl grows, rad/s; NaN where it never does."""
        return min((band.start for band in self.bands if band.film is film), default=math.nan)


class _WhirlSolver:
    """The whirls about the synchronous motion at a speed, each solution begun from the last one found."""

    def __init__(self, parameters: ModelParameters) -> None:
        self._parameters = parameters
        self._orbit: SynchronousOrbit | None = None
        self._circle: SynchronousResponse | None = None

    def at(self, speed: float) -> tuple[Whirl, ...]:
        """Return the least stable whirls, one of each film; none where no motion is found."""
        try:
            if self._parameters.is_loaded:
                self._orbit = synchronous_orbit(self._parameters, speed, self._orbit)
                return self._orbit.whirls
            self._circle = synchronous_response(self._parameters, speed, self._circle)
        except ModelError:
            self._orbit = self._circle = None
            return ()
        return self._circle.whirls


def stability(parameters: ModelParameters, speeds: FloatArray, precision: float = PRECISION) -> Stability:
    """Return where the films let go of the synchronous motion: by eigenvalues at each speed, then by bisection.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor; with weight or loads at rest by Floquet's multipliers, without them in the turning frame.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s: an unstable band between two of them is not seen.
    precision : float
        Of the ends of the bands, rad/s.

    Returns
    -------
    Stability
        Along the speeds, upwards.
    """
    speeds = np.asarray(speeds, np.float64)
    require_rising(speeds)
    motions = _WhirlSolver(parameters)
    found = [motions.at(float(speed)) for speed in speeds]
    worst = [whirls[0] if whirls else _UNKNOWN for whirls in found]
    edges = _Edges(parameters, speeds, found, precision)
    bands = [band for film in FilmName for band in edges.bands(film)]
    return Stability(
        speeds=speeds,
        growth_rates=np.array([whirl.growth_rate for whirl in worst]),
        orders=np.array([whirl.order for whirl in worst]),
        inner_shares=np.array([whirl.inner_share for whirl in worst]),
        film_growth_rates={film: np.array([_of(whirls, film).growth_rate for whirls in found]) for film in FilmName},
        bands=tuple(sorted(bands, key=lambda band: band.start)),
    )


def _of(whirls: tuple[Whirl, ...], film: FilmName) -> Whirl:
    """Return a film's whirl; one without numbers where there is none."""
    return next((whirl for whirl in whirls if whirl.film is film), _UNKNOWN)


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """Where films let go, between speeds at which the whirls are known; none where there is no motion."""

    parameters: ModelParameters
    speeds: FloatArray
    found: list[tuple[Whirl, ...]]
    precision: float

    def bands(self, film: FilmName) -> list[UnstableBand]:
        """Return where a film's whirl grows."""
        bands: list[UnstableBand] = []
        whirls = [_of(one, film) for one in self.found]
        start = (float(self.speeds[0]), whirls[0].order) if whirls[0].growth_rate > 0 else None
        for place, (below, above) in enumerate(itertools.pairwise(whirls)):
            is_known = self.found[place] and self.found[place + 1]
            if not is_known or (below.growth_rate > 0) == (above.growth_rate > 0):
                continue
            edge, order = self._edge(film, place, above.order if above.growth_rate > 0 else below.order)
            if start is None:
                start = (edge, order)
            else:
                bands.append(UnstableBand(film, start[0], edge, start[1]))
                start = None
        if start is not None:
            bands.append(UnstableBand(film, start[0], float(self.speeds[-1]), start[1]))
        return bands

    def _edge(self, film: FilmName, place: int, order: float) -> tuple[float, float]:
        """Return between which speeds a film's growth rate changes its sign, and the order of what grows there."""
        low, high = float(self.speeds[place]), float(self.speeds[place + 1])
        motions = _WhirlSolver(self.parameters)
        grows_below = _of(motions.at(low), film).growth_rate > 0
        while high - low > self.precision:
            middle = (low + high) / 2
            whirl = _of(motions.at(middle), film)
            if whirl.growth_rate > 0:
                order = whirl.order
            if (whirl.growth_rate > 0) == grows_below:
                low = middle
            else:
                high = middle
        return (low + high) / 2, order


def onset_study(parameters: ModelParameters, speeds: FloatArray) -> Study:
    """Return the films' growth rates over speed and the bands in which they let go of the synchronous motion.

    ModelError where no synchronous motion is found at any of the speeds.
    """
    found = stability(parameters, speeds)
    missing = int(np.count_nonzero(np.isnan(found.growth_rates)))
    extent = f"from {speeds[0]:,.0f} to {speeds[-1]:,.0f} rad/s"
    if missing == speeds.size:
        raise ModelError(f"synchronous motion: none found within the clearances at any of {missing} speeds {extent}")
    title = "Stability of the synchronous motion"
    remarks = [
        f"{band.film} film: unstable from {band.start:,.0f} to {band.stop:,.0f} rad/s, whirl at {band.order:.2f}X"
        for band in found.bands
    ] or [f"stable {extent}"]
    if len({band.film for band in found.bands}) == 2:
        remarks.append("each about the motion without whirl: once one film whirls the other lets go at another speed")
    if missing:
        remarks.append(f"left out: {missing} of {speeds.size} speeds, without motion within the clearances")
    onsets = np.array([edge for band in found.bands for edge in (band.start, band.stop) if edge < speeds[-1]])
    columns: dict[str, FloatArray | tuple[str, ...]] = {
        "speed_rad_s": speeds,
        "speed_rpm": np.asarray(speeds * 30 / math.pi),
        "growth_rate_1_s": found.growth_rates,
        "whirl_order": found.orders,
        "film": tuple("–" if math.isnan(share) else dominant_film(share).value for share in found.inner_shares),
        "inner_share": found.inner_shares,
        **{f"{film}_growth_rate_1_s": rates for film, rates in found.film_growth_rates.items()},
    }
    return Study(title, columns, _stability_plots(title, found, onsets), tuple(remarks))


def _stability_plots(title: str, found: Stability, onsets: FloatArray) -> tuple[Plot, Plot]:
    speeds, is_inner = found.speeds, found.inner_shares > 0.5
    return (
        Plot(
            title,
            SPEED_LABEL,
            "Growth of the least stable whirl [1/s]",
            (
                *(Series(f"{film} film", speeds, rates) for film, rates in found.film_growth_rates.items()),
                Series("", speeds, np.zeros(speeds.size), Style.REFERENCE),
                Series("onset or end", onsets, np.zeros(onsets.size), Style.MARKERS),
            ),
        ),
        Plot(
            "Frequency of the less stable of the two",
            SPEED_LABEL,
            "Whirl over the shaft's speed [X]",
            tuple(
                Series(f"{film} film", speeds, np.where(chosen, found.orders, np.nan), Style.POINTS)
                for film, chosen in zip(FilmName, (is_inner, ~is_inner), strict=True)
            ),
        ),
    )
