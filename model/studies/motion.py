"""Motion at one speed, or stepped through several: orbit, order spectrum and Poincaré section at any station.

In an integration only rounding disturbs an unstable motion, so it may take thousands of turns to leave it; a real rotor
is always disturbed. Therefore the motion is perturbed at each speed: moved slightly along the eigenvector of the
unstable whirl of each film. It then settles for as long as the present whirl, at least the perturbation, needs to grow
to the inner clearance or, if the synchronous motion is stable, to decay to the size of the perturbation, up to a limit.
"""

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from analysis.signals.units import MICROMETRE, MILLIMETRE, phase_lag_degrees
from analysis.spectra.order_map import order_spectrum
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import FilmName, SynchronousOrbit, Whirl, synchronous_orbit
from model.errors import NoSolutionError, ParameterError
from model.rotor.parameters import ModelParameters
from model.studies.study import Plot, Series, Study, Style

STEPS_PER_TURN = 96
DEFAULT_PERTURBATION = 0.02e-6  # m: a tenth of the smallest whirl that is evaluated
MAX_GROWTH_TURNS = 4000  # for a perturbation to grow
WHIRL_ORDER_RANGE = (0.05, 0.95)  # orders searched for whirl, reduced by the width of the window about 0X and 1X
MIN_AMPLITUDE = 0.2e-6  # m peak: smaller components are ignored
WINDOW_HALF_WIDTH = 2.5  # lines on each side of a component: width of the Hann window
MAX_ORDER = 4.0
ORBIT_TURNS = 8  # drawn and listed


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTurns:
    """Recorded motion over some turns, from theta = 0 on.

    Parameters
    ----------
    stations : ndarray of float64, shape (n_stations, 2, n)
        Displacement in X and Y, m.
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    films : ndarray of float64, shape (2, n_orders)
        Spectrum of the eccentricity ratios of the inner and of the outer films, peak: root of the sum of squares over
        directions and bearings.
    """

    stations: FloatArray
    orders: FloatArray
    films: FloatArray


@dataclass(slots=True)
class SteppedMotion:
    """A motion at successive speeds.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    perturbation : float
        Size of the disturbance, m, at the journal or ring that moves most; 0: no perturbation.
    growth_rate : float
        Growth rate of the least stable whirl of the synchronous motion at the present speed, 1/s; NaN if unknown.
    turns_settled : int
        Turns settled at the present speed.

    Raises
    ------
    ParameterError
        If the perturbation is invalid.
    """

    parameters: ModelParameters
    perturbation: float
    growth_rate: float = field(default=math.nan, init=False)
    turns_settled: int = field(default=0, init=False)
    _motion: ShaftMotion | None = field(default=None, init=False)
    _orbit: SynchronousOrbit | None = field(default=None, init=False)
    _recorded: RecordedTurns | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        clearance = self.parameters.floating_ring.inner_clearance
        if not 0 <= self.perturbation < clearance:
            raise ParameterError(
                f"perturbation: {self.perturbation / MICROMETRE:g} µm, expected 0 or more and less than the inner "
                f"clearance of {clearance / MICROMETRE:g} µm"
            )

    def settle_at(self, speed: float, settle: int) -> "SteppedMotion":
        """Change to a speed, rad/s, and settle for at least ``settle`` turns; WallContactError on wall contact."""
        motion, self._motion = self._motion, None  # stays None if a wall is reached
        if motion is None:
            motion, self._recorded = ShaftMotion(self.parameters, speed, settle), None
            self.turns_settled = settle + self._disturb(motion)
            further = self.turns_settled - settle
        else:
            motion.change_speed(speed)
            self.turns_settled = further = max(settle, self._disturb(motion))
        if further:
            motion.integrate_turns(further, STEPS_PER_TURN)
        self._motion = motion
        return self

    def record(self, turns: int) -> RecordedTurns:
        """Record the motion of all stations and films over the next turns."""
        if self._motion is None:
            raise ValueError("motion: none, expected a call of settle_at first")
        motion, self._motion = self._motion, None
        stations, films = motion.integrate_stations_and_films(turns, STEPS_PER_TURN)
        orders, spectrum = order_spectrum(films - films.mean(axis=-1, keepdims=True), turns)
        both = np.linalg.norm(spectrum.reshape(2, 4, -1), axis=1)
        self._motion, self._recorded = motion, RecordedTurns(stations, orders, both)
        return self._recorded

    def _disturb(self, motion: ShaftMotion) -> int:
        """Perturb the motion if it is unstable; return the turns that whirls need to grow or decay."""
        if self.perturbation == 0:
            return 0
        try:
            self._orbit = synchronous_orbit(self.parameters, motion.speed, self._orbit)
        except NoSolutionError:  # far above the onset there may be no orbit within the clearances
            self._orbit, self.growth_rate = None, math.nan
            return 0
        self.growth_rate = self._orbit.growth_rate
        clearance, needed = self.parameters.floating_ring.inner_clearance, 0.0
        for whirl, disturbance in zip(self._orbit.whirls, self._orbit.disturbances, strict=True):
            if whirl.growth_rate > 0:
                motion.disturb(self.perturbation * disturbance)
                part = clearance / min(max(self._size(whirl, 0.0), self.perturbation), clearance)
            else:  # after a start from rest, assume the size of the clearance
                part = max(min(self._size(whirl, clearance), clearance), self.perturbation) / self.perturbation
            per_turn = abs(whirl.growth_rate) * 2 * math.pi / motion.speed
            needed = max(needed, math.log(part) / max(per_turn, 1e-300))
        return math.ceil(min(needed, MAX_GROWTH_TURNS))

    def _size(self, whirl: Whirl, default: float) -> float:
        """Return the amplitude of a whirl in the last recorded turns, m; ``default`` without a record."""
        if self._recorded is None:
            return default
        bearing, recorded = self.parameters.floating_ring, self._recorded
        is_inner = whirl.film is FilmName.INNER
        near = np.abs(recorded.orders - abs(whirl.order)) <= WINDOW_HALF_WIDTH * recorded.orders[1]
        largest = float(recorded.films[0 if is_inner else 1][near].max(initial=0.0))
        return largest * (bearing.inner_clearance if is_inner else bearing.outer_clearance)


class MotionTable(Enum):
    """Content of the table of the study."""

    STATIONS = "stations"
    ORBIT = "orbit"
    SPECTRUM = "spectrum"
    POINCARE = "poincare"


def motion_study(
    parameters: ModelParameters,
    speed: float,
    station: int | None = None,
    settle: int = 300,
    turns: int = 64,
    *,
    perturbation: float = 0.0,
    table: MotionTable = MotionTable.STATIONS,
) -> Study:
    """Return the settled motion at a speed, started from rest.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    speed : float
        rad/s, above 0.
    station : int, optional
        Station of plots and table; default the station of the probes.
    settle, turns : int
        Turns to settle, then turns evaluated.
    perturbation : float
        Size of the disturbance of an unstable motion, m: see `model.studies.motion`.
    table : MotionTable, optional
        Content of the table: all stations, or orbit, order spectrum or Poincaré section at one.

    Raises
    ------
    ParameterError
        If speed or station are invalid.
    WallContactError
        If the motion reaches a wall.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise ParameterError(f"speed: {speed:g} rad/s, expected a finite value above 0")
    if station is not None:
        parameters = replace(parameters, probe_station=station)
    station = parameters.probe_station
    stepped = SteppedMotion(parameters, perturbation)
    stations = stepped.settle_at(speed, settle).record(turns).stations
    path, points = stations[station - 1] / MICROMETRE, stations[station - 1, :, ::STEPS_PER_TURN] / MICROMETRE
    orders, spectrum = _spectrum(path, turns)
    orbit = path[:, -min(turns, ORBIT_TURNS) * STEPS_PER_TURN :]
    columns: dict[str, FloatArray | tuple[str, ...]]
    if table is MotionTable.STATIONS:
        columns = _station_columns(stations, turns, parameters.rotor.positions)
    elif table is MotionTable.ORBIT:
        turned = np.arange(orbit.shape[1]) / STEPS_PER_TURN
        columns = {"turns": turned, "x_um": orbit[0], "y_um": orbit[1]}
    elif table is MotionTable.SPECTRUM:
        columns = {"order": orders, "x_um_pk": np.abs(spectrum[0]), "y_um_pk": np.abs(spectrum[1])}
    else:
        columns = {"turn": np.arange(float(turns)), "x_um": points[0], "y_um": points[1]}
    title = f"Station {station} at {speed:,.0f} rad/s"
    remark = f"settled for {stepped.turns_settled:,} turns"
    if perturbation:
        remark += (
            f"; growth rate of the least stable whirl of the synchronous motion {stepped.growth_rate:.3g} /s"
            f"{f', perturbed by {perturbation / MICROMETRE:g} µm' if stepped.growth_rate > 0 else ''}"
        )
    return Study(
        f"Motion, {title[0].lower()}{title[1:]}", columns, _plots(title, orbit, points, orders, spectrum), (remark,)
    )


def _spectrum(path: FloatArray, turns: int) -> tuple[FloatArray, ComplexArray]:
    orders, spectrum = order_spectrum(path - path.mean(axis=-1, keepdims=True), turns)
    count = int(np.searchsorted(orders, MAX_ORDER, side="right"))
    return orders[:count], spectrum[..., :count]


def _station_columns(
    displacements: FloatArray, turns: int, positions: FloatArray
) -> dict[str, "FloatArray | tuple[str, ...]"]:
    """Return characteristic values of the motion at all stations."""
    orders, spectrum = _spectrum(displacements, turns)
    first = spectrum[:, :, int(np.argmin(np.abs(orders - 1)))]
    lowest, highest = (
        max(WHIRL_ORDER_RANGE[0], WINDOW_HALF_WIDTH / turns),
        min(WHIRL_ORDER_RANGE[1], 1 - WINDOW_HALF_WIDTH / turns),
    )
    below = (orders >= lowest) & (orders <= highest)
    strongest = np.argmax(np.abs(spectrum[:, 0, below]), axis=1)
    amplitude = np.take_along_axis(np.abs(spectrum[:, 0, below]), strongest[:, None], axis=1)[:, 0]
    return {
        "station": np.arange(1.0, positions.size + 1),
        "position_mm": positions / MILLIMETRE,
        "first_order_x_um_pk": np.abs(first[:, 0]) / MICROMETRE,
        "lag_x_deg": phase_lag_degrees(first[:, 0]),
        "first_order_y_um_pk": np.abs(first[:, 1]) / MICROMETRE,
        "lag_y_deg": phase_lag_degrees(first[:, 1]),
        "whirl_order": np.where(amplitude > MIN_AMPLITUDE, orders[below][strongest], np.nan),
        "whirl_x_um_pk": amplitude / MICROMETRE,
        "overall_x_um_pp": np.ptp(displacements[:, 0], axis=1) / MICROMETRE,
        "overall_y_um_pp": np.ptp(displacements[:, 1], axis=1) / MICROMETRE,
        "spread_x_um": np.ptp(displacements[:, 0, ::STEPS_PER_TURN], axis=1) / MICROMETRE,
        "mean_x_um": displacements[:, 0].mean(axis=1) / MICROMETRE,
        "mean_y_um": displacements[:, 1].mean(axis=1) / MICROMETRE,
    }


def _plots(
    title: str, orbit: FloatArray, points: FloatArray, orders: FloatArray, spectrum: ComplexArray
) -> tuple[Plot, ...]:
    floor = 1e-3  # µm peak
    marks = Series("once a turn, at θ = 0", points[0], points[1], Style.POINTS)
    return (
        Plot(
            f"{title}: orbit and Poincaré section",
            "X [µm]",
            "Y [µm]",
            (Series("orbit", orbit[0], orbit[1]), marks),
            is_square=True,
        ),
        Plot(
            "Order spectrum",
            "Frequency over the shaft's speed [X]",
            "Amplitude [µm peak]",
            tuple(
                Series(name, orders, np.clip(np.abs(values), floor, None))
                for name, values in zip("XY", spectrum, strict=True)
            ),
            y_log=True,
        ),
        Plot("Poincaré section", "X at θ = 0 [µm]", "Y at θ = 0 [µm]", (marks,), is_square=True),
    )
