"""Stability of the synchronous motion over speed: growth rates of each film's whirl, onsets by bisection."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.signals import FloatArray
from analysis.signals.units import RPM
from model.dynamics.stability import FilmName, SynchronousOrbit, Whirl, dominant_film, synchronous_orbit
from model.dynamics.synchronous import SynchronousResponse, synchronous_response
from model.errors import NoSolutionError
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import require_rising
from model.studies.linear_studies import SPEED_LABEL
from model.studies.study import Plot, Series, Study, Style

PRECISION = 1.0  # rad/s, of the limits of unstable bands
_NO_WHIRL = Whirl(math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class UnstableBand:
    """Speed range in which the whirl of a film grows about the synchronous motion.

    Parameters
    ----------
    film : FilmName
        The unstable film.
    start, stop : float
        rad/s; an end of the search range if the whirl grows there.
    order : float
        Order of the whirl at the start of the band.
    """

    film: FilmName
    start: float
    stop: float
    order: float


@dataclass(frozen=True, slots=True, eq=False)
class Stability:
    """Growth rates over speed: of the least stable whirl, and of the whirl of each film.

    Parameters
    ----------
    speeds, growth_rates, orders, inner_shares : ndarray of float64, shape (n,)
        Speeds, rad/s; growth rate, 1/s, order and inner share of the least stable whirl
        (`model.dynamics.stability.Whirl`); NaN where no synchronous motion was found.
    film_growth_rates : mapping of FilmName to ndarray of float64, shape (n,)
        Growth rate of the least stable whirl of each film, 1/s.
    bands : tuple of UnstableBand
        Unstable bands of both films, by rising start.
    """

    speeds: FloatArray
    growth_rates: FloatArray
    orders: FloatArray
    inner_shares: FloatArray
    film_growth_rates: Mapping[FilmName, FloatArray]
    bands: tuple[UnstableBand, ...]

    def onset(self, film: FilmName) -> float:
        """Return the onset speed of a film, rad/s; NaN if its whirl never grows."""
        return min((band.start for band in self.bands if band.film is film), default=math.nan)


class _WhirlSolver:
    """Solver for the least stable whirls over speed; each solution starts from the previous one."""

    def __init__(self, parameters: ModelParameters) -> None:
        self._parameters = parameters
        self._orbit: SynchronousOrbit | None = None
        self._circle: SynchronousResponse | None = None

    def at(self, speed: float) -> tuple[Whirl, ...]:
        """Return the least stable whirl of each film; empty if no synchronous motion is found."""
        try:
            if self._parameters.is_loaded:
                self._orbit = synchronous_orbit(self._parameters, speed, self._orbit)
                return self._orbit.whirls
            self._circle = synchronous_response(self._parameters, speed, self._circle)
        except NoSolutionError:
            self._orbit = self._circle = None
            return ()
        return self._circle.whirls


def stability(parameters: ModelParameters, speeds: FloatArray, precision: float = PRECISION) -> Stability:
    """Return the stability of the synchronous motion: eigenvalues at each speed, then bisection.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor; with weight or constant loads by Floquet multipliers, without them in the rotating frame.
    speeds : ndarray of float64, shape (n,)
        Rising, rad/s; a band between two neighbouring speeds is not found.
    precision : float
        Of the limits of the bands, rad/s.

    Returns
    -------
    Stability
        Growth rates at the speeds, and the unstable bands.
    """
    speeds = np.asarray(speeds, np.float64)
    require_rising(speeds)
    motions = _WhirlSolver(parameters)
    found = [motions.at(float(speed)) for speed in speeds]
    worst = [whirls[0] if whirls else _NO_WHIRL for whirls in found]
    edges = _BandSearch(parameters, speeds, found, precision)
    bands = [band for film in FilmName for band in edges.bands(film)]
    return Stability(
        speeds=speeds,
        growth_rates=np.array([whirl.growth_rate for whirl in worst]),
        orders=np.array([whirl.order for whirl in worst]),
        inner_shares=np.array([whirl.inner_share for whirl in worst]),
        film_growth_rates={
            film: np.array([_whirl_of(whirls, film).growth_rate for whirls in found]) for film in FilmName
        },
        bands=tuple(sorted(bands, key=lambda band: band.start)),
    )


def _whirl_of(whirls: tuple[Whirl, ...], film: FilmName) -> Whirl:
    """Return the whirl of a film; NaN values if there is none."""
    return next((whirl for whirl in whirls if whirl.film is film), _NO_WHIRL)


@dataclass(frozen=True, slots=True, eq=False)
class _BandSearch:
    """Search for the limits of unstable bands between speeds with known whirls."""

    parameters: ModelParameters
    speeds: FloatArray
    found: list[tuple[Whirl, ...]]
    precision: float

    def bands(self, film: FilmName) -> list[UnstableBand]:
        """Return the unstable bands of a film."""
        bands: list[UnstableBand] = []
        whirls = [_whirl_of(one, film) for one in self.found]
        start = (float(self.speeds[0]), whirls[0].order) if whirls[0].growth_rate > 0 else None
        for index, (below, above) in enumerate(itertools.pairwise(whirls)):
            is_known = self.found[index] and self.found[index + 1]
            if not is_known or (below.growth_rate > 0) == (above.growth_rate > 0):
                continue
            edge, order = self._band_limit(film, index, above.order if above.growth_rate > 0 else below.order)
            if start is None:
                start = (edge, order)
            else:
                bands.append(UnstableBand(film, start[0], edge, start[1]))
                start = None
        if start is not None:
            bands.append(UnstableBand(film, start[0], float(self.speeds[-1]), start[1]))
        return bands

    def _band_limit(self, film: FilmName, index: int, order: float) -> tuple[float, float]:
        """Return the speed at which the growth rate of a film changes sign, and the order of the growing whirl."""
        low, high = float(self.speeds[index]), float(self.speeds[index + 1])
        motions = _WhirlSolver(self.parameters)
        grows_below = _whirl_of(motions.at(low), film).growth_rate > 0
        while high - low > self.precision:
            middle = (low + high) / 2
            whirl = _whirl_of(motions.at(middle), film)
            if whirl.growth_rate > 0:
                order = whirl.order
            if (whirl.growth_rate > 0) == grows_below:
                low = middle
            else:
                high = middle
        return (low + high) / 2, order


def onset_study(parameters: ModelParameters, speeds: FloatArray) -> Study:
    """Return growth rates over speed and the unstable bands of both films.

    Raises NoSolutionError if no synchronous motion is found at any speed.
    """
    stability_over_speed = stability(parameters, speeds)
    missing = int(np.count_nonzero(np.isnan(stability_over_speed.growth_rates)))
    extent = f"from {speeds[0]:,.0f} to {speeds[-1]:,.0f} rad/s"
    if missing == speeds.size:
        raise NoSolutionError(
            f"synchronous motion: none found within the clearances at any of {missing} speeds {extent}"
        )
    title = "Stability of the synchronous motion"
    remarks = [
        f"{band.film} film: unstable from {band.start:,.0f} to {band.stop:,.0f} rad/s, whirl at {band.order:.2f}X"
        for band in stability_over_speed.bands
    ] or [f"stable {extent}"]
    if len({band.film for band in stability_over_speed.bands}) == 2:
        remarks.append(
            "each onset is about the motion without whirl; once one film whirls, the onset of the other one changes"
        )
    if missing:
        remarks.append(f"omitted: {missing} of {speeds.size} speeds without synchronous motion within the clearances")
    onsets = np.array(
        [edge for band in stability_over_speed.bands for edge in (band.start, band.stop) if edge < speeds[-1]]
    )
    columns: dict[str, FloatArray | tuple[str, ...]] = {
        "speed_rad_s": speeds,
        "speed_rpm": np.asarray(speeds / RPM),
        "growth_rate_1_s": stability_over_speed.growth_rates,
        "whirl_order": stability_over_speed.orders,
        "film": tuple(
            "–" if math.isnan(share) else dominant_film(share).value for share in stability_over_speed.inner_shares
        ),
        "inner_share": stability_over_speed.inner_shares,
        **{f"{film}_growth_rate_1_s": rates for film, rates in stability_over_speed.film_growth_rates.items()},
    }
    return Study(title, columns, _stability_plots(title, stability_over_speed, onsets), tuple(remarks))


def _stability_plots(title: str, stability_over_speed: Stability, onsets: FloatArray) -> tuple[Plot, Plot]:
    speeds, is_inner = stability_over_speed.speeds, stability_over_speed.inner_shares > 0.5
    return (
        Plot(
            title,
            SPEED_LABEL,
            "Growth rate of the least stable whirl [1/s]",
            (
                *(
                    Series(f"{film} film", speeds, rates)
                    for film, rates in stability_over_speed.film_growth_rates.items()
                ),
                Series("", speeds, np.zeros(speeds.size), Style.REFERENCE),
                Series("onset or end", onsets, np.zeros(onsets.size), Style.MARKERS),
            ),
        ),
        Plot(
            "Order of the least stable whirl",
            SPEED_LABEL,
            "Whirl over the shaft's speed [X]",
            tuple(
                Series(f"{film} film", speeds, np.where(chosen, stability_over_speed.orders, np.nan), Style.POINTS)
                for film, chosen in zip(FilmName, (is_inner, ~is_inner), strict=True)
            ),
        ),
    )
