"""Motion at stepped speeds, with a small perturbation where it is unstable.

In an integration only rounding disturbs an unstable motion, so it may take thousands of turns to leave it; a real rotor
is always disturbed. Therefore the motion is perturbed at each speed: moved slightly along the eigenvector of the
unstable whirl of each film. It then settles for as long as the present whirl, at least the perturbation, needs to grow
to the inner clearance or, if the synchronous motion is stable, to decay to the size of the perturbation, up to a limit.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import order_spectrum
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import SynchronousOrbit, synchronous_orbit
from model.dynamics.whirl import FilmName, Whirl
from model.errors import NoSolutionError, ParameterError
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]

STEPS_PER_TURN = 96
DEFAULT_PERTURBATION = 0.02e-6  # m: a tenth of the smallest whirl that is evaluated
MAX_GROWTH_TURNS = 4000  # for a perturbation to grow
WINDOW_HALF_WIDTH = 2.5  # lines on each side of a component: width of the Hann window


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
    ValueError
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
