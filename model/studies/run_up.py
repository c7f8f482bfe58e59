"""A stepped run-up in time: at each speed the motion settles, then is looked at; waterfalls and bifurcations."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.orders import order_spectrum
from model.errors import WallContactError
from model.parameters import ModelParameters
from model.studies.linear import SPEED_LABEL
from model.studies.stepping import MOST_TURNS, STEPS, SteppedMotion
from model.studies.study import Plot, Series, Study, Style, Surface

FloatArray = NDArray[np.float64]

INNER = (0.40, 0.85)  # orders at which the inner films whirl
OUTER = (0.10, 0.40)
VISIBLE = 0.1  # of 1X: a component above it counts
LEAST = 0.2e-6  # m peak: a component below it does not count
ORBIT_TURNS = 12  # that are kept of the motion
FLOOR = 1e-2  # µm peak, lower end of the colours


@dataclass(frozen=True, slots=True, eq=False)
class Seeding:
    """How a run-up's unstable motions were disturbed: see `model.studies.stepping`.

    Parameters
    ----------
    size : float
        Of the seed, m.
    growth_rates : ndarray of float64, shape (n,)
        Of the synchronous motion's least stable whirl at each speed, 1/s; NaN where it is not known.
    turns : ndarray of float64, shape (n,)
        To settle at each speed.
    """

    size: float
    growth_rates: FloatArray
    turns: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RunUp:
    """What a stepped run-up showed.

    Parameters
    ----------
    speeds : ndarray of float64, shape (n,)
        rad/s.
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    spectrum : ndarray of float64, shape (n, n_orders)
        In X at the station, m peak, Hann-windowed.
    stroboscopic : ndarray of float64, shape (n, 2, n_turns)
        X and Y once a turn at theta = 0, m: Poincaré's points.
    peak_to_peak : ndarray of float64, shape (n,)
        In X, m.
    orbit : ndarray of float64, shape (n, 2, n_points)
        X and Y over the last few turns, m.
    seeding : Seeding, optional
        Where unstable motions were seeded.

    At speeds where the motion reached a wall all of it is NaN.
    """

    speeds: FloatArray
    orders: FloatArray
    spectrum: FloatArray
    stroboscopic: FloatArray
    peak_to_peak: FloatArray
    orbit: FloatArray
    seeding: Seeding | None = None

    def component(self, band: tuple[float, float]) -> FloatArray:
        """Return the largest amplitude within a band of orders at each speed, m peak; NaN at the wall."""
        inside = (self.orders >= band[0]) & (self.orders < band[1])
        return np.asarray(self.spectrum[:, inside].max(axis=1))

    @property
    def first_order(self) -> FloatArray:
        """Amplitude of 1X at each speed, m peak."""
        return np.asarray(self.spectrum[:, int(np.argmin(np.abs(self.orders - 1)))])

    def onset(self, band: tuple[float, float]) -> float:
        """Return the first of two successive speeds with a visible component in the band, rad/s; NaN for none."""
        component = self.component(band)
        seen = (component > VISIBLE * self.first_order) & (component > LEAST)
        both = np.flatnonzero(seen[:-1] & seen[1:])
        return float(self.speeds[both[0]]) if both.size else math.nan


def run_up(
    parameters: ModelParameters,
    speeds: FloatArray,
    settle: int = 40,
    turns: int = 64,
    *,
    station: int | None = None,
    seed: float = 0.0,
) -> RunUp:
    """Return the motion at each speed, begun from the one before.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speeds : ndarray of float64, shape (n,)
        rad/s, above 0; they may fall.
    settle, turns : int
        Turns at a speed that are left out, then those that are looked at.
    station : int, optional
        That is looked at; the probes' where none is given.
    seed : float
        How far a motion that is unstable is disturbed at each speed, m; such a motion settles as long as it needs to.

    Returns
    -------
    RunUp
        Where the motion reaches a wall the next speed begins from rest.
    """
    speeds = np.asarray(speeds, np.float64)
    if speeds.ndim != 1 or speeds.size < 2 or not np.all(speeds > 0):
        raise ValueError(f"speeds: {speeds}, rad/s, expected two or more above 0")
    if not (math.isfinite(seed) and seed >= 0):
        raise ValueError(f"seed: {seed:g} m, expected a finite value, 0 or more")
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    empty = order_spectrum(np.zeros(turns * STEPS), turns)[0]
    highest = int(np.searchsorted(empty, 3.0, side="right"))
    spectrum = np.full((speeds.size, highest), np.nan)
    stroboscopic = np.full((speeds.size, 2, turns), np.nan)
    peak_to_peak, growth_rates, settled = np.full((3, speeds.size), np.nan)
    orbit = np.full((speeds.size, 2, min(turns, ORBIT_TURNS) * STEPS), np.nan)
    stepped = SteppedMotion(parameters, seed)
    for number, speed in enumerate(speeds):
        try:
            moved = stepped.at(float(speed), settle).look(turns)[parameters.probe_station - 1]
        except WallContactError:
            continue
        finally:
            growth_rates[number], settled[number] = stepped.growth_rate, stepped.turns_settled
        spectrum[number] = np.abs(order_spectrum(moved[0] - moved[0].mean(), turns)[1][:highest])
        stroboscopic[number] = moved[:, ::STEPS]
        peak_to_peak[number] = np.ptp(moved[0])
        orbit[number] = moved[:, -orbit.shape[2] :]
    seeding = Seeding(seed, growth_rates, settled) if seed else None
    return RunUp(speeds, empty[:highest], spectrum, stroboscopic, peak_to_peak, orbit, seeding)


def waterfall_study(found: RunUp, name: str) -> Study:
    """Return spectra over speed: what grows where.

    Parameters
    ----------
    found : RunUp
        At rising speeds.
    name : str
        Of the case.

    Raises
    ------
    WallContactError
        Where the motion reached a wall at all of them.
    """
    at_the_wall = _wall_remarks(found)
    inner, outer = found.component(INNER) * 1e6, found.component(OUTER) * 1e6
    return Study(
        f"Waterfall, {name}",
        {
            "speed_rad_s": found.speeds,
            "first_order_um_pk": found.first_order * 1e6,
            "inner_whirl_um_pk": inner,
            "outer_whirl_um_pk": outer,
            "overall_um_pp": found.peak_to_peak * 1e6,
            **_seeding_columns(found.seeding),
        },
        (waterfall_surface(found, f"Waterfall, {name}"),),
        (
            *(
                f"{film} film: " + (f"whirl from {onset:,.0f} rad/s" if math.isfinite(onset) else "no whirl")
                for film, onset in (("inner", found.onset(INNER)), ("outer", found.onset(OUTER)))
            ),
            "told apart by order alone: the inner film's whirl at 0.7X comes with its difference to 1X at 0.3X",
            *at_the_wall,
            *_seeding_remarks(found),
        ),
    )


def _wall_remarks(found: RunUp) -> tuple[str, ...]:
    """Say at how many speeds nothing is known; WallContactError where at none."""
    touched = int(np.count_nonzero(np.isnan(found.peak_to_peak)))
    if touched == found.speeds.size:
        raise WallContactError(
            f"eccentricity: the motion reached a wall at each of the {touched} speeds "
            f"from {found.speeds.min():,.0f} to {found.speeds.max():,.0f} rad/s, expected less than the clearance"
        )
    return (f"the motion reached a wall at {touched} of {found.speeds.size} speeds: left out",) if touched else ()


def _seeding_columns(seeding: Seeding | None) -> dict[str, FloatArray]:
    if seeding is None:
        return {}
    return {"growth_rate_1_s": seeding.growth_rates, "settle_turns": seeding.turns}


def _seeding_remarks(found: RunUp) -> list[str]:
    """Return how the motion was seeded, where it is unstable, and where a seed had too little time to grow."""
    seeding = found.seeding
    if seeding is None:
        return ["not seeded: an unstable motion may stay where it is for long"]
    size = f"{seeding.size * 1e6:g} µm"
    said = [
        f"unstable motions seeded with {size} along their least stable whirl, with {MOST_TURNS:,} turns at most to grow"
    ]
    unstable = seeding.growth_rates > 0
    if unstable.any():
        said.append(f"by eigenvalues first unstable at {found.speeds[unstable][0]:,.0f} rad/s of these speeds")
    slow = found.speeds[unstable & (seeding.turns >= MOST_TURNS)]
    if slow.size:
        said.append(
            "too slow to grow to its end in that time: " + ", ".join(f"{speed:,.0f}" for speed in slow) + " rad/s"
        )
    return said


def waterfall_surface(found: RunUp, title: str) -> Surface:
    """Return a run-up's spectra as a picture: frequency over speed."""
    amplitude = np.asarray(np.clip(found.spectrum * 1e6, FLOOR, None))
    largest = float(np.nanmax(amplitude)) if np.any(np.isfinite(amplitude)) else 1.0
    return Surface(
        title,
        "Frequency over the shaft's speed [X]",
        SPEED_LABEL,
        "Amplitude in X [µm peak]",
        found.orders,
        found.speeds,
        amplitude,
        (FLOOR, max(largest, 10 * FLOOR)),
    )


def bifurcation_study(found: RunUp, name: str) -> Study:
    """Return Poincaré's points over speed: one point where the motion repeats itself every turn.

    Parameters
    ----------
    found : RunUp
        The motion.
    name : str
        Of the case.
    """
    at_the_wall = _wall_remarks(found)
    width = np.ptp(found.stroboscopic, axis=2) * 1e6
    return Study(
        f"Bifurcation diagram, {name}",
        {
            "speed_rad_s": found.speeds,
            "spread_x_um": width[:, 0],
            "spread_y_um": width[:, 1],
            "overall_um_pp": found.peak_to_peak * 1e6,
            **_seeding_columns(found.seeding),
        },
        (bifurcation_plot(found, f"Bifurcation diagram, {name}"),),
        (
            "spread: of the positions at theta = 0 over the turns; about 0 where the motion is synchronous",
            *at_the_wall,
            *_seeding_remarks(found),
        ),
    )


def bifurcation_plot(found: RunUp, title: str) -> Plot:
    """Return a run-up's Poincaré points over speed as a picture."""
    points = found.stroboscopic[:, 0] * 1e6
    speeds = np.repeat(found.speeds, points.shape[1])
    return Plot(title, SPEED_LABEL, "X at θ = 0 [µm]", (Series("", speeds, points.ravel(), Style.POINTS),))
