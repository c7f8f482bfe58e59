"""A motion that goes from speed to speed and is disturbed where it is unstable, as on a bench everything does.

Integrated in time, an unstable motion may stay where it is for thousands of turns: only rounding disturbs it. So it is
seeded at each speed: moved a little the way in which its least stable whirl begins, as the eigenvalues say. Then it
settles for as long as what is there of a whirl, the seed at least, takes to grow to the inner clearance; where the
synchronous motion is stable, for as long as it takes to decay to the seed; up to a limit.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from model.errors import ModelError
from model.motion import ShaftMotion
from model.parameters import ModelParameters
from model.stability import SynchronousOrbit, synchronous_orbit

FloatArray = NDArray[np.float64]

STEPS = 96  # a turn
SEED = 0.02e-6  # m: a tenth of the smallest whirl that counts
MOST_TURNS = 4000  # that a seed is given to grow


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
    """

    parameters: ModelParameters
    seed: float
    growth_rate: float = field(default=math.nan, init=False)
    turns_settled: int = field(default=0, init=False)
    _motion: ShaftMotion | None = field(default=None, init=False)
    _orbit: SynchronousOrbit | None = field(default=None, init=False)
    _spread: float | None = field(default=None, init=False)  # of positions once a turn when last looked at, m

    def at(self, speed: float, settle: int) -> "SteppedMotion":
        """Go to a speed, rad/s, settle there for so many turns or more; WallContactError where that is impossible."""
        motion, self._motion = self._motion, None  # none is left where the wall is reached
        if motion is None:
            motion, self._spread = ShaftMotion(self.parameters, speed, settle), None
            self.turns_settled = settle + self._disturb(motion)
            further = self.turns_settled - settle
        else:
            motion.change_speed(speed)
            self.turns_settled = further = max(settle, self._disturb(motion))
        if further:
            motion.turns(further, STEPS)
        self._motion = motion
        return self

    def look(self, turns: int) -> FloatArray:
        """Return what every station does in the next turns, (n_stations, 2, n), m, from theta = 0 on."""
        if self._motion is None:
            raise ValueError("motion: none, expected one that has been brought to a speed")
        motion, self._motion = self._motion, None
        moved = motion.turns_of_all(turns, STEPS)
        self._spread = float(np.ptp(moved[self.parameters.probe_station - 1, :, ::STEPS], axis=1).max())
        self._motion = motion
        return moved

    def _disturb(self, motion: ShaftMotion) -> int:
        """Seed the motion where it is unstable; return the turns that a whirl needs to grow, or to decay."""
        if self.seed == 0:
            return 0
        try:
            self._orbit = synchronous_orbit(self.parameters, motion.speed, self._orbit)
        except ModelError:  # far beyond the limit of stability there may be none within the clearances
            self._orbit, self.growth_rate = None, math.nan
            return 0
        self.growth_rate = self._orbit.growth_rate
        clearance = self.parameters.bearing.inner_clearance
        if self.growth_rate > 0:
            motion.disturb(self.seed * self._orbit.disturbance)
            part = clearance / min(max(self._spread or 0.0, self.seed), clearance)
        else:  # what comes from rest is of the clearance's size
            part = max(clearance if self._spread is None else min(self._spread, clearance), self.seed) / self.seed
        per_turn = abs(self.growth_rate) * 2 * math.pi / motion.speed
        return math.ceil(min(math.log(part) / max(per_turn, 1e-300), MOST_TURNS))
