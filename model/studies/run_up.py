"""Stepped run-up in time: settled motion at each speed; waterfall plot and bifurcation diagram."""

import math
from dataclasses import dataclass, replace

import numpy as np

from analysis.signals import BoolArray, FloatArray
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_spectrum
from model.dynamics.stability import FilmName
from model.errors import ParameterError, WallContactError
from model.rotor.parameters import ModelParameters
from model.studies.linear_studies import SPEED_LABEL
from model.studies.motion import (
    MAX_GROWTH_TURNS,
    MIN_AMPLITUDE,
    STEPS_PER_TURN,
    WHIRL_ORDER_RANGE,
    WINDOW_HALF_WIDTH,
    SteppedMotion,
)
from model.studies.study import Plot, Series, Study, Style, Surface

MAX_COMBINATION_ORDER = 5  # largest integer factor in combinations of a whirl with 1X
MAX_COMBINATION_OFFSET = 0.5  # lines between a peak and the order of a combination
MAX_COMBINATION_SIZE = 0.25  # relative to the whirl in its film: a larger component is no combination
VISIBLE_RATIO = 0.1  # of 1X: larger components are visible
ORBIT_TURNS = 12  # stored
AMPLITUDE_FLOOR = 1e-2  # µm peak, lower limit of the colour scale


@dataclass(frozen=True, slots=True, eq=False)
class Perturbation:
    """Perturbation of the unstable motions of a run-up; see `model.studies.motion`.

    Parameters
    ----------
    size : float
        Amplitude, m.
    growth_rates : ndarray of float64, shape (n,)
        Growth rate of the least stable whirl of the synchronous motion at each speed, 1/s; NaN if unknown.
    turns : ndarray of float64, shape (n,)
        Turns to settle at each speed.
    """

    size: float
    growth_rates: FloatArray
    turns: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RunUp:
    """Result of a stepped run-up.

    Parameters
    ----------
    speeds : ndarray of float64, shape (n,)
        rad/s.
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    spectrum : ndarray of float64, shape (n, n_orders)
        Hann-windowed order spectrum in X at the station, m peak.
    stroboscopic : ndarray of float64, shape (n, 2, n_turns)
        Poincaré section: X and Y once per turn at theta = 0, m.
    peak_to_peak : ndarray of float64, shape (n,)
        Overall vibration in X, m.
    orbit : ndarray of float64, shape (n, 2, n_points)
        X and Y over the last turns, m.
    films : ndarray of float64, shape (n, 2, n_orders)
        Spectra of the eccentricity ratios of inner and outer films (`model.studies.motion.RecordedTurns`).
    perturbation : Perturbation, optional
        Perturbation of unstable motions; None where not perturbed.

    All values are NaN at speeds where the motion reached a wall.
    """

    speeds: FloatArray
    orders: FloatArray
    spectrum: FloatArray
    stroboscopic: FloatArray
    peak_to_peak: FloatArray
    orbit: FloatArray
    films: FloatArray
    perturbation: Perturbation | None = None

    def component(self, band: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return order and amplitude, m peak, of the largest line in a band of orders; NaN at the wall."""
        inside = (self.orders >= band[0]) & (self.orders < band[1])
        index = np.argmax(self.spectrum[:, inside], axis=1)
        largest = np.take_along_axis(self.spectrum[:, inside], index[:, None], axis=1)[:, 0]
        return np.where(np.isnan(largest), np.nan, self.orders[inside][index]), largest

    def whirl(self, film: FilmName) -> tuple[FloatArray, FloatArray]:
        """Return order (NaN without whirl) and amplitude at the station, m peak, of the whirl of a film at each speed.

        Each sub-synchronous peak belongs to the film with the larger motion there. The largest peak is the whirl of its
        film. The whirl of the other film is its largest peak that is no combination of the first with 1X, such as 1X
        minus the 0.7X of the inner film. NaN at the wall.
        """
        rows = [self._whirl(row, film) for row in range(self.speeds.size)]
        return np.array([order for order, _ in rows]), np.array([size for _, size in rows])

    def _whirl(self, row: int, film: FilmName) -> tuple[float, float]:
        films = self.films[row]
        if np.isnan(films).any():
            return math.nan, math.nan
        width = WINDOW_HALF_WIDTH * self.orders[1]
        lowest, highest = max(WHIRL_ORDER_RANGE[0], width), min(WHIRL_ORDER_RANGE[1], 1 - width)
        peaks = [_peaks(one, self.orders) for one in films]
        # sub-synchronous peaks of each film: those with the larger motion in that film
        own = [
            [(one, index) for one, index in run if lowest <= one <= highest and films[k, index] > films[1 - k, index]]
            for k, run in enumerate(peaks)
        ]
        largest = [max((float(films[k, index]) for _, index in run), default=0.0) for k, run in enumerate(own)]
        first, wanted = int(np.argmax(largest)), list(FilmName).index(film)
        if first != wanted and own[first]:
            combined = combinations(max(own[first], key=lambda peak: films[first, peak[1]])[0])
            own[wanted] = [
                (one, index)
                for one, index in own[wanted]
                if np.abs(combined - one).min() > MAX_COMBINATION_OFFSET * self.orders[1]
                or films[wanted, index] >= MAX_COMBINATION_SIZE * largest[first]
            ]
        if not own[wanted]:
            return math.nan, 0.0
        order, index = max(own[wanted], key=lambda peak: films[wanted, peak[1]])
        return order, float(self.spectrum[row, index])

    @property
    def first_order(self) -> FloatArray:
        """Amplitude of 1X at each speed, m peak."""
        return np.asarray(self.spectrum[:, int(np.argmin(np.abs(self.orders - 1)))])

    @property
    def is_growing(self) -> BoolArray:
        """Whether the motion at each speed is unstable, but had too few turns for a whirl to become visible, (n,)."""
        if self.perturbation is None:
            return np.zeros(self.speeds.size, np.bool_)
        is_slow = (self.perturbation.growth_rates > 0) & (self.perturbation.turns >= MAX_GROWTH_TURNS)
        return np.asarray(is_slow & ~self._visible(FilmName.INNER) & ~self._visible(FilmName.OUTER))

    def onset(self, film: FilmName) -> float:
        """Return the first of two successive speeds with visible whirl of a film, rad/s; NaN without any."""
        is_visible = self._visible(film)
        both = np.flatnonzero(is_visible[:-1] & is_visible[1:])
        return float(self.speeds[both[0]]) if both.size else math.nan

    def end(self, film: FilmName) -> float:
        """Return the last speed with visible whirl of a film, rad/s; NaN without any."""
        is_visible = np.flatnonzero(self._visible(film))
        return float(self.speeds[is_visible[-1]]) if is_visible.size else math.nan

    def _visible(self, film: FilmName) -> BoolArray:
        _, size = self.whirl(film)
        return np.asarray((size > VISIBLE_RATIO * self.first_order) & (size > MIN_AMPLITUDE))


def _peaks(spectrum: FloatArray, orders: FloatArray) -> list[tuple[float, int]]:
    """Return the peaks of a Hann-windowed spectrum: interpolated order and index of the line."""
    inside = spectrum[1:-1]
    places = np.flatnonzero((inside > spectrum[:-2]) & (inside >= spectrum[2:])) + 1
    below, at, above = spectrum[places - 1], spectrum[places], spectrum[places + 1]
    ratio = np.maximum(below, above) / at
    offset = np.where(above >= below, 1, -1) * np.clip((2 * ratio - 1) / (1 + ratio), 0.0, 0.5)  # lines
    return [(float(one), int(index)) for one, index in zip(orders[places] + offset * orders[1], places, strict=True)]


def combinations(order: float) -> FloatArray:
    """Return the orders of all combinations of a component with 1X, including the component itself."""
    times = np.arange(-MAX_COMBINATION_ORDER, MAX_COMBINATION_ORDER + 1)
    return np.asarray(np.abs(times[:, None] + order * times).ravel())


def run_up(
    parameters: ModelParameters,
    speeds: FloatArray,
    settle: int = 40,
    turns: int = 64,
    *,
    station: int | None = None,
    perturbation: float = 0.0,
) -> RunUp:
    """Return the motion at each speed, started from that at the previous speed.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speeds : ndarray of float64, shape (n,)
        rad/s, above 0, in any order.
    settle, turns : int
        Turns to settle at a speed, then turns evaluated.
    station : int, optional
        Station evaluated; default the station of the probes.
    perturbation : float
        Size of the disturbance of an unstable motion at each speed, m; such a motion settles for as long as it needs.

    Returns
    -------
    RunUp
        After a contact with a wall, the next speed starts from rest.
    """
    speeds = np.asarray(speeds, np.float64)
    if speeds.ndim != 1 or speeds.size < 2 or not np.all(speeds > 0):
        raise ParameterError(f"speeds: {speeds}, rad/s, expected two or more above 0")
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    empty = order_spectrum(np.zeros(turns * STEPS_PER_TURN), turns)[0]
    highest = int(np.searchsorted(empty, 3.0, side="right"))
    spectrum = np.full((speeds.size, highest), np.nan)
    stroboscopic = np.full((speeds.size, 2, turns), np.nan)
    peak_to_peak, growth_rates, settled = np.full((3, speeds.size), np.nan)
    orbit = np.full((speeds.size, 2, min(turns, ORBIT_TURNS) * STEPS_PER_TURN), np.nan)
    films = np.full((speeds.size, 2, highest), np.nan)
    stepped = SteppedMotion(parameters, perturbation)
    for number, speed in enumerate(speeds):
        try:
            recorded = stepped.settle_at(float(speed), settle).record(turns)
        except WallContactError:
            continue
        finally:
            growth_rates[number], settled[number] = stepped.growth_rate, stepped.turns_settled
        moved, films[number] = recorded.stations[parameters.probe_station - 1], recorded.films[:, :highest]
        spectrum[number] = np.abs(order_spectrum(moved[0] - moved[0].mean(), turns)[1][:highest])
        stroboscopic[number] = moved[:, ::STEPS_PER_TURN]
        peak_to_peak[number] = np.ptp(moved[0])
        orbit[number] = moved[:, -orbit.shape[2] :]
    perturbed = Perturbation(perturbation, growth_rates, settled) if perturbation else None
    return RunUp(speeds, empty[:highest], spectrum, stroboscopic, peak_to_peak, orbit, films, perturbed)


def waterfall_study(run: RunUp, name: str) -> Study:
    """Return the waterfall of a run-up: spectra over speed.

    Parameters
    ----------
    run : RunUp
        Run-up at rising speeds.
    name : str
        Name of the case.

    Raises
    ------
    WallContactError
        If the motion reached a wall at all speeds.
    """
    wall_remarks = _wall_remarks(run)
    columns: dict[str, FloatArray] = {}
    for film in FilmName:
        order, size = run.whirl(film)
        columns |= {
            f"{film}_whirl_order": np.where(size > MIN_AMPLITUDE, order, np.nan),
            f"{film}_whirl_um_pk": size / MICROMETRE,
        }
    return Study(
        f"Waterfall, {name}",
        {
            "speed_rad_s": run.speeds,
            "first_order_um_pk": run.first_order / MICROMETRE,
            **columns,
            "overall_um_pp": run.peak_to_peak / MICROMETRE,
            **_perturbation_columns(run.perturbation),
        },
        (waterfall_surface(run, f"Waterfall, {name}"),),
        (
            *(
                f"{film} film: " + (f"whirl from {onset:,.0f} rad/s" if math.isfinite(onset) else "no whirl")
                for film, onset in ((film, run.onset(film)) for film in FilmName)
            ),
            "each whirl is assigned to the film whose surfaces move more against each other, relative to the clearance",
            *wall_remarks,
            *_perturbation_remarks(run),
        ),
    )


def _wall_remarks(run: RunUp) -> tuple[str, ...]:
    """Return a remark on the speeds with wall contact; WallContactError if these are all speeds."""
    touched = int(np.count_nonzero(np.isnan(run.peak_to_peak)))
    if touched == run.speeds.size:
        raise WallContactError(
            f"eccentricity: the motion reached a wall at each of the {touched} speeds "
            f"from {run.speeds.min():,.0f} to {run.speeds.max():,.0f} rad/s, expected less than the clearance"
        )
    return (f"the motion reached a wall at {touched} of {run.speeds.size} speeds: omitted",) if touched else ()


def _perturbation_columns(perturbation: Perturbation | None) -> dict[str, FloatArray]:
    if perturbation is None:
        return {}
    return {"growth_rate_1_s": perturbation.growth_rates, "settle_turns": perturbation.turns}


def _perturbation_remarks(run: RunUp) -> list[str]:
    """Return remarks on the perturbation, on the first unstable speed, and on speeds with too little time to grow."""
    perturbation = run.perturbation
    if perturbation is None:
        return ["not perturbed: an unstable motion may take long to grow"]
    size = f"{perturbation.size / MICROMETRE:g} µm"
    remarks = [
        f"unstable motions perturbed by {size} along each film's whirl, at most {MAX_GROWTH_TURNS:,} turns to grow"
    ]
    unstable = perturbation.growth_rates > 0
    if unstable.any():
        remarks.append(f"first of these speeds that is unstable by eigenvalues: {run.speeds[unstable][0]:,.0f} rad/s")
    slow = run.speeds[unstable & (perturbation.turns >= MAX_GROWTH_TURNS)]
    if slow.size:
        remarks.append("growth too slow for this time: " + ", ".join(f"{speed:,.0f}" for speed in slow) + " rad/s")
    return remarks


def waterfall_surface(run: RunUp, title: str) -> Surface:
    """Return the waterfall of a run-up as a colour map, order over speed."""
    amplitude = np.asarray(np.clip(run.spectrum / MICROMETRE, AMPLITUDE_FLOOR, None))
    largest = float(np.nanmax(amplitude)) if np.any(np.isfinite(amplitude)) else 1.0
    return Surface(
        title,
        "Frequency over the shaft's speed [X]",
        SPEED_LABEL,
        "Amplitude in X [µm peak]",
        run.orders,
        run.speeds,
        amplitude,
        (AMPLITUDE_FLOOR, max(largest, 10 * AMPLITUDE_FLOOR)),
    )


def bifurcation_study(run: RunUp, name: str) -> Study:
    """Return the bifurcation diagram of a run-up: Poincaré points over speed, one point if periodic.

    Parameters
    ----------
    run : RunUp
        The run-up.
    name : str
        Name of the case.
    """
    wall_remarks = _wall_remarks(run)
    width = np.ptp(run.stroboscopic, axis=2) / MICROMETRE
    return Study(
        f"Bifurcation diagram, {name}",
        {
            "speed_rad_s": run.speeds,
            "spread_x_um": width[:, 0],
            "spread_y_um": width[:, 1],
            "overall_um_pp": run.peak_to_peak / MICROMETRE,
            **_perturbation_columns(run.perturbation),
        },
        (bifurcation_plot(run, f"Bifurcation diagram, {name}"),),
        (
            "spread: range of the positions at theta = 0 over all turns; about 0 for synchronous motion",
            *wall_remarks,
            *_perturbation_remarks(run),
        ),
    )


def bifurcation_plot(run: RunUp, title: str) -> Plot:
    """Return the Poincaré points of a run-up over speed as a plot."""
    points = run.stroboscopic[:, 0] / MICROMETRE
    speeds = np.repeat(run.speeds, points.shape[1])
    return Plot(title, SPEED_LABEL, "X at θ = 0 [µm]", (Series("", speeds, points.ravel(), Style.POINTS),))
