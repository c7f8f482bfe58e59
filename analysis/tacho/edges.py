"""Edge detection in the tacho waveform.

`edge_detector` returns the detector of a tacho. A further type of tacho needs a class with the method `edges` and its
line in `edge_detector`; the callers do not name a type.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Edge, Tacho

FloatArray = NDArray[np.float64]


class SchmittTrigger:
    """Schmitt trigger that finds the tacho edges of a waveform given in consecutive pieces.

    An edge needs a waveform below the lower level that then reaches the upper level (mirrored for falling edges). The
    time of the edge is the last crossing of the middle level before that, interpolated linearly between two samples.

    Parameters
    ----------
    tacho : Tacho
        Threshold, hysteresis and edge.

    Notes
    -----
    O. Schmitt, A thermionic trigger, J. Sci. Instrum. 15, 1938; interpolation of the edge time: A. Brandt, Noise and
    Vibration Analysis, 2011, ch. 12.
    """

    def __init__(self, tacho: Tacho) -> None:
        if not tacho.hysteresis >= 0.0:
            raise ValueError(f"hysteresis: {tacho.hysteresis} V, expected 0 or more")
        self._sign = 1.0 if tacho.edge is Edge.RISING else -1.0
        self._middle = self._sign * tacho.threshold
        self._low = self._middle - 0.5 * tacho.hysteresis
        self._high = self._middle + 0.5 * tacho.hysteresis
        self._last: FloatArray = np.empty(0)
        self._state = 0  # 1 above the upper level, -1 below the lower, 0 not yet known
        self._crossing = 0.0

    def edges(self, volts: FloatArray, first: int) -> FloatArray:
        """Return the positions of the edges in the next piece of the waveform.

        Parameters
        ----------
        volts : ndarray of float64, shape (n,)
            Samples that follow the previous piece, V.
        first : int
            Index of the first sample of the piece.

        Returns
        -------
        ndarray of float64, shape (n_edges,)
            Positions in samples, on the same axis as ``first``, rising.

        Raises
        ------
        ValueError
            The samples are not finite.
        """
        if not np.isfinite(volts).all():
            raise ValueError("volts: holds values that are not finite")
        wave = np.concatenate([self._last, self._sign * volts])
        if wave.size == 0:
            return np.empty(0)
        origin = first - self._last.size
        self._last = wave[-1:].copy()

        above = wave >= self._middle
        after = np.flatnonzero(above[1:] & ~above[:-1]) + 1
        start, stop = wave[after - 1], wave[after]
        crossings = origin + after - 1 + (self._middle - start) / (stop - start)

        level = np.where(wave >= self._high, 1, np.where(wave < self._low, -1, 0))
        known = np.flatnonzero(level)
        states = np.concatenate([[self._state], level[known]])
        flips = known[(states[1:] == 1) & (states[:-1] == -1)]
        self._state = int(states[-1])

        candidates = np.concatenate([[self._crossing], crossings])
        edges = candidates[np.searchsorted(after, flips, side="right")]
        self._crossing = float(candidates[-1])
        return np.asarray(edges, dtype=np.float64)


def edge_detector(tacho: Tacho) -> SchmittTrigger:
    """Return a new detector of the edges in the waveform of a tacho, with the settings of the tacho."""
    return SchmittTrigger(tacho)
