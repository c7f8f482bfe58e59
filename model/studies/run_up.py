"""A stepped run-up in time: at each speed the motion settles, then is looked at; waterfalls and bifurcations."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.spectra.order_spectrum import order_spectrum
from model.dynamics.whirl import FilmName
from model.errors import WallContactError
from model.rotor.parameters import ModelParameters
from model.studies.linear import SPEED_LABEL
from model.studies.stepped_motion import MAX_GROWTH_TURNS, STEPS_PER_TURN, WINDOW_HALF_WIDTH, SteppedMotion
from model.studies.study import Plot, Series, Study, Style, Surface

FloatArray = NDArray[np.float64]

SUB_SYNCHRONOUS = (0.05, 0.95)  # orders of a whirl, less what the window spreads the mean and 1X over
MAX_COMBINATION_ORDER = 5  # times that a whirl's order may stand in the order of its combination with 1X
MAX_COMBINATION_OFFSET = 0.5  # lines within which a peak is at a combination's order
MAX_COMBINATION_SIZE = 0.25  # of a whirl's motion in its film: a combination is smaller
VISIBLE_RATIO = 0.1  # of 1X: a component above it counts
MIN_AMPLITUDE = 0.2e-6  # m peak: a component below it does not count
ORBIT_TURNS = 12  # that are kept of the motion
AMPLITUDE_FLOOR = 1e-2  # µm peak, lower end of the colours


@dataclass(frozen=True, slots=True, eq=False)
class Seeding:
    """How a run-up's unstable motions were disturbed: see `model.studies.stepped_motion`.

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
    films : ndarray of float64, shape (n, 2, n_orders)
        Spectra of the inner and the outer films' eccentricity ratios (`model.studies.stepped_motion.RecordedTurns`).
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
    films: FloatArray
    seeding: Seeding | None = None

    def component(self, band: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return the largest line within a band of orders at each speed: its order, and m peak; NaN at the wall."""
        inside = (self.orders >= band[0]) & (self.orders < band[1])
        place = np.argmax(self.spectrum[:, inside], axis=1)
        largest = np.take_along_axis(self.spectrum[:, inside], place[:, None], axis=1)[:, 0]
        return np.where(np.isnan(largest), np.nan, self.orders[inside][place]), largest

    def whirl(self, film: FilmName) -> tuple[FloatArray, FloatArray]:
        """Return what a film whirls at each speed: order, NaN where it does not, and m peak at the station.

        The line below 1X at which a film moves most is that film's if it has the larger part of it; the other film's
        is the largest of those in which it has the larger part and that are no combination of the first
        with 1X, as 1X less the inner film's 0.7X. NaN at the wall.
        """
        rows = [self._whirl(row, film) for row in range(self.speeds.size)]
        return np.array([order for order, _ in rows]), np.array([size for _, size in rows])

    def _whirl(self, row: int, film: FilmName) -> tuple[float, float]:
        films = self.films[row]
        if np.isnan(films).any():
            return math.nan, math.nan
        width = WINDOW_HALF_WIDTH * self.orders[1]
        lowest, highest = max(SUB_SYNCHRONOUS[0], width), min(SUB_SYNCHRONOUS[1], 1 - width)
        peaks = [_peaks(one, self.orders) for one in films]
        # those below 1X in which it has the larger part
        own = [
            [(one, place) for one, place in found if lowest <= one <= highest and films[k, place] > films[1 - k, place]]
            for k, found in enumerate(peaks)
        ]
        largest = [max((float(films[k, place]) for _, place in found), default=0.0) for k, found in enumerate(own)]
        first, wanted = int(np.argmax(largest)), list(FilmName).index(film)
        if first != wanted and own[first]:
            combined = combinations(max(own[first], key=lambda peak: films[first, peak[1]])[0])
            own[wanted] = [
                (one, place)
                for one, place in own[wanted]
                if np.abs(combined - one).min() > MAX_COMBINATION_OFFSET * self.orders[1]
                or films[wanted, place] >= MAX_COMBINATION_SIZE * largest[first]
            ]
        if not own[wanted]:
            return math.nan, 0.0
        order, place = max(own[wanted], key=lambda peak: films[wanted, peak[1]])
        return order, float(self.spectrum[row, place])

    @property
    def first_order(self) -> FloatArray:
        """Amplitude of 1X at each speed, m peak."""
        return np.asarray(self.spectrum[:, int(np.argmin(np.abs(self.orders - 1)))])

    def onset(self, film: FilmName) -> float:
        """Return the first of two successive speeds at which a film's whirl is visible, rad/s; NaN for none."""
        seen = self._visible(film)
        both = np.flatnonzero(seen[:-1] & seen[1:])
        return float(self.speeds[both[0]]) if both.size else math.nan

    def end(self, film: FilmName) -> float:
        """Return the last speed at which a film's whirl is visible, rad/s; NaN for none."""
        seen = np.flatnonzero(self._visible(film))
        return float(self.speeds[seen[-1]]) if seen.size else math.nan

    def _visible(self, film: FilmName) -> NDArray[np.bool_]:
        _, size = self.whirl(film)
        return np.asarray((size > VISIBLE_RATIO * self.first_order) & (size > MIN_AMPLITUDE))


def _peaks(spectrum: FloatArray, orders: FloatArray) -> list[tuple[float, int]]:
    """Return the peaks of a Hann-windowed spectrum: their orders, between the lines, and places."""
    inside = spectrum[1:-1]
    places = np.flatnonzero((inside > spectrum[:-2]) & (inside >= spectrum[2:])) + 1
    below, at, above = spectrum[places - 1], spectrum[places], spectrum[places + 1]
    beside = np.maximum(below, above) / at
    apart = np.where(above >= below, 1, -1) * np.clip((2 * beside - 1) / (1 + beside), 0.0, 0.5)  # lines
    return [(float(one), int(place)) for one, place in zip(orders[places] + apart * orders[1], places, strict=True)]


def combinations(order: float) -> FloatArray:
    """Return the orders of a component's combinations with 1X, itself among them."""
    times = np.arange(-MAX_COMBINATION_ORDER, MAX_COMBINATION_ORDER + 1)
    return np.asarray(np.abs(times[:, None] + order * times).ravel())


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
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    empty = order_spectrum(np.zeros(turns * STEPS_PER_TURN), turns)[0]
    highest = int(np.searchsorted(empty, 3.0, side="right"))
    spectrum = np.full((speeds.size, highest), np.nan)
    stroboscopic = np.full((speeds.size, 2, turns), np.nan)
    peak_to_peak, growth_rates, settled = np.full((3, speeds.size), np.nan)
    orbit = np.full((speeds.size, 2, min(turns, ORBIT_TURNS) * STEPS_PER_TURN), np.nan)
    films = np.full((speeds.size, 2, highest), np.nan)
    stepped = SteppedMotion(parameters, seed)
    for number, speed in enumerate(speeds):
        try:
            seen = stepped.settle_at(float(speed), settle).record(turns)
        except WallContactError:
            continue
        finally:
            growth_rates[number], settled[number] = stepped.growth_rate, stepped.turns_settled
        moved, films[number] = seen.stations[parameters.probe_station - 1], seen.films[:, :highest]
        spectrum[number] = np.abs(order_spectrum(moved[0] - moved[0].mean(), turns)[1][:highest])
        stroboscopic[number] = moved[:, ::STEPS_PER_TURN]
        peak_to_peak[number] = np.ptp(moved[0])
        orbit[number] = moved[:, -orbit.shape[2] :]
    seeding = Seeding(seed, growth_rates, settled) if seed else None
    return RunUp(speeds, empty[:highest], spectrum, stroboscopic, peak_to_peak, orbit, films, seeding)


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
    columns: dict[str, FloatArray] = {}
    for film in FilmName:
        order, size = found.whirl(film)
        columns |= {
            f"{film}_whirl_order": np.where(size > MIN_AMPLITUDE, order, np.nan),
            f"{film}_whirl_um_pk": size * 1e6,
        }
    return Study(
        f"Waterfall, {name}",
        {
            "speed_rad_s": found.speeds,
            "first_order_um_pk": found.first_order * 1e6,
            **columns,
            "overall_um_pp": found.peak_to_peak * 1e6,
            **_seeding_columns(found.seeding),
        },
        (waterfall_surface(found, f"Waterfall, {name}"),),
        (
            *(
                f"{film} film: " + (f"whirl from {onset:,.0f} rad/s" if math.isfinite(onset) else "no whirl")
                for film, onset in ((film, found.onset(film)) for film in FilmName)
            ),
            "a whirl is the film's in which its surfaces move most against each other, in parts of the clearance",
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
        f"unstable motions seeded with {size} along each film's whirl, with {MAX_GROWTH_TURNS:,} turns at most to grow"
    ]
    unstable = seeding.growth_rates > 0
    if unstable.any():
        said.append(f"by eigenvalues first unstable at {found.speeds[unstable][0]:,.0f} rad/s of these speeds")
    slow = found.speeds[unstable & (seeding.turns >= MAX_GROWTH_TURNS)]
    if slow.size:
        said.append(
            "too slow to grow to its end in that time: " + ", ".join(f"{speed:,.0f}" for speed in slow) + " rad/s"
        )
    return said


def waterfall_surface(found: RunUp, title: str) -> Surface:
    """Return a run-up's spectra as a picture: frequency over speed."""
    amplitude = np.asarray(np.clip(found.spectrum * 1e6, AMPLITUDE_FLOOR, None))
    largest = float(np.nanmax(amplitude)) if np.any(np.isfinite(amplitude)) else 1.0
    return Surface(
        title,
        "Frequency over the shaft's speed [X]",
        SPEED_LABEL,
        "Amplitude in X [µm peak]",
        found.orders,
        found.speeds,
        amplitude,
        (AMPLITUDE_FLOOR, max(largest, 10 * AMPLITUDE_FLOOR)),
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
