"""Run-out that is taken off while a run goes: known before it, or told by its own slow turning."""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import RunOutSettings
from analysis.signals.snapshot import RunOut

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FASTER = 1.05  # over the speed of slow roll: beyond it what the slow frames told stands


class RunOutWatch:
    """Knows the run-out at each frame, from frames alone: the same live and in replay.

    Frames up to the speed of slow roll are averaged. From the first frame that is clearly faster on, their mean stands
    for the rest of the run, slow turning later in it included: a run-down shows by what is left whether it still holds.

    Parameters
    ----------
    settings : RunOutSettings
        Vectors known before, or the speed of slow roll.
    """

    def __init__(self, settings: RunOutSettings) -> None:
        self._slow_roll = settings.slow_roll_speed
        self._known: RunOut | None = None
        self._sum: ComplexArray = np.zeros((0, 2), dtype=np.complex128)
        self._sigmas = np.zeros(2)
        self._frames = 0
        if settings.vectors:
            vectors = np.full((max(2, *(order for order, _, _ in settings.vectors)), 2), np.nan, dtype=np.complex128)
            for order, x, y in settings.vectors:
                vectors[order - 1] = x, y
            self._known = RunOut(vectors, np.array(settings.sigma))

    @property
    def mean(self) -> RunOut | None:
        """What is known so far; None where nothing is."""
        if self._known is not None or not self._frames:
            return self._known
        return RunOut(self._sum / self._frames, self._sigmas / self._frames)

    def frame(self, speed: float, vectors: ComplexArray, sigma: FloatArray) -> RunOut | None:
        """Take a frame and return the run-out to be taken off it; None where none is known yet.

        Parameters
        ----------
        speed : float
            Its mean speed, rad/s.
        vectors : ndarray of complex128, shape (n_orders, 2)
            Of the whole orders from 1 on at the probes x and y, m peak.
        sigma : ndarray of float64, shape (2,)
            Standard deviation of the amplitudes of 1X and 2X, m peak.
        """
        if self._known is not None or not self._slow_roll > 0.0:
            return self._known
        if speed <= self._slow_roll:
            self._sum = vectors + (self._sum if self._frames else 0.0)
            self._sigmas = self._sigmas + sigma  # frames share samples: their mean is taken as no surer than one
            self._frames += 1
        elif speed > FASTER * self._slow_roll:
            self._known = self.mean
        return self._known
