"""A motion that goes from speed to speed and is disturbed where it is unstable, as on a bench everything does.

Integrated in time, an unstable motion may stay where it is for thousands of turns: only rounding disturbs it. So it is
seeded at each speed: moved a little the way in which each film's unstable whirl begins, as the eigenvalues say. Then it
settles for as long as what is there of each whirl, the seed at least, takes to grow to the inner clearance; where the
synchronous motion is stable, for as long as it takes to decay to the seed; up to a limit.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.spectra.order_spectrum import order_spectrum
from model.dynamics.motion import ShaftMotion
from model.dynamics.stability import SynchronousOrbit, synchronous_orbit
from model.dynamics.whirl import FilmName, Whirl
from model.errors import ModelError
from model.rotor.parameters import ModelParameters

FloatArray = NDArray[np.float64]

STEPS_PER_TURN = 96  # a turn
DEFAULT_SEED = 0.02e-6  # m: a tenth of the smallest whirl that counts
MAX_GROWTH_TURNS = 4000  # that a seed is given to grow
WINDOW_HALF_WIDTH = 2.5  # lines of a spectrum beside a component: what the window spreads it over


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTurns:
    """What was seen of a motion over some turns, from theta = 0 on.

    Parameters
    ----------
    stations : ndarray of float64, shape (n_stations, 2, n)
        Displacement in X and Y, m.
    orders : ndarray of float64, shape (n_orders,)
        From 0.
    films : ndarray of float64, shape (2, n_orders)
        Spectrum of the inner and of the outer films' eccentricity ratios, peak, all directions and both bearings
        together: the root of the sum of squares.
    """

    stations: FloatArray
    orders: FloatArray
    films: FloatArray


@dataclass(slots=True)
class SteppedMotion:
    """A motion at one speed after the other.

    Parameters
    ----------
    parameters : ModelParameters
        The rotor.
    seed : float
        How far an unstable motion is moved, m, of the journal or ring that moves most; 0: not at all.
    growth_rate : float
        At the present speed, of the synchronous motion's least stable whirl, 1/s; NaN where it is not known.
    turns_settled : int
        At the present speed.

    Raises
    ------
    ValueError
        Where the seed makes no sense.
    """

    parameters: ModelParameters
    seed: float
    growth_rate: float = field(default=math.nan, init=False)
    turns_settled: int = field(default=0, init=False)
    _motion: ShaftMotion | None = field(default=None, init=False)
    _orbit: SynchronousOrbit | None = field(default=None, init=False)
    _recorded: RecordedTurns | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        clearance = self.parameters.floating_ring.inner_clearance
        if not 0 <= self.seed < clearance:
            raise ValueError(
                f"seed: {self.seed * 1e6:g} µm, expected 0 or more and less than the inner clearance of "
                f"{clearance * 1e6:g} µm"
            )

    def settle_at(self, speed: float, settle: int) -> "SteppedMotion":
        """Go to a speed, rad/s, settle there for so many turns or more; WallContactError where that is impossible."""
        motion, self._motion = self._motion, None  # none is left where the wall is reached
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
        """Return what every station and film does in the next turns."""
        if self._motion is None:
            raise ValueError("motion: none, expected one that has been brought to a speed")
        motion, self._motion = self._motion, None
        stations, films = motion.integrate_stations_and_films(turns, STEPS_PER_TURN)
        orders, spectrum = order_spectrum(films - films.mean(axis=-1, keepdims=True), turns)
        both = np.linalg.norm(spectrum.reshape(2, 4, -1), axis=1)
        self._motion, self._recorded = motion, RecordedTurns(stations, orders, both)
        return self._recorded

    def _disturb(self, motion: ShaftMotion) -> int:
        """Seed the motion where it is unstable; return the turns that whirls need to grow, or to decay."""
        if self.seed == 0:
            return 0
        try:
            self._orbit = synchronous_orbit(self.parameters, motion.speed, self._orbit)
        except ModelError:  # far beyond the limit of stability there may be none within the clearances
            self._orbit, self.growth_rate = None, math.nan
            return 0
        self.growth_rate = self._orbit.growth_rate
        clearance, needed = self.parameters.floating_ring.inner_clearance, 0.0
        for whirl, disturbance in zip(self._orbit.whirls, self._orbit.disturbances, strict=True):
            if whirl.growth_rate > 0:
                motion.disturb(self.seed * disturbance)
                part = clearance / min(max(self._size(whirl, 0.0), self.seed), clearance)
            else:  # what comes from rest is of the clearance's size
                part = max(min(self._size(whirl, clearance), clearance), self.seed) / self.seed
            per_turn = abs(whirl.growth_rate) * 2 * math.pi / motion.speed
            needed = max(needed, math.log(part) / max(per_turn, 1e-300))
        return math.ceil(min(needed, MAX_GROWTH_TURNS))

    def _size(self, whirl: Whirl, otherwise: float) -> float:
        """Return what there was of a whirl when the motion was last looked at, m; ``otherwise`` where it was not."""
        if self._recorded is None:
            return otherwise
        bearing, seen = self.parameters.floating_ring, self._recorded
        is_inner = whirl.film is FilmName.INNER
        near = np.abs(seen.orders - abs(whirl.order)) <= WINDOW_HALF_WIDTH * seen.orders[1]
        largest = float(seen.films[0 if is_inner else 1][near].max(initial=0.0))
        return largest * (bearing.inner_clearance if is_inner else bearing.outer_clearance)
