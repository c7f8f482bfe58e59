"""Waterfall (against time) and cascade (against speed) of the order spectra of a run, of fixed size.

Both contain, at each order, the larger amplitude of the two probes, m peak, and 0 where there was no frame.
"""

from enum import StrEnum

import numpy as np

from analysis.signals import BoolArray, FloatArray
from analysis.signals.header import AnalysisSettings
from analysis.signals.snapshot import OrderFrame, Snapshot


def order_axis(settings: AnalysisSettings) -> FloatArray:
    """Return the order axis of frames with these settings, shape (n_orders,)."""
    return np.arange(int(settings.highest_order * settings.revolutions) + 1) / settings.revolutions


def _amplitude(frame: OrderFrame) -> FloatArray:
    return np.asarray(np.abs(frame.spectrum).max(axis=0), dtype=np.float64)


class Waterfall:
    """The last order spectra against time, the newest in the last row.

    A row covers ``span / rows`` of sample time and contains the largest amplitudes of its frames. Segments follow
    directly on one another, as the time between them is unknown.

    Parameters
    ----------
    settings : AnalysisSettings
        Revolutions and highest order of the frames.
    rows : int
        Number of rows.
    span : float
        Time that the rows cover, s.
    """

    def __init__(self, settings: AnalysisSettings, rows: int = 300, span: float = 60.0) -> None:
        if rows < 1 or not span > 0.0:
            raise ValueError(f"rows, span: {rows} and {span} s, expected at least 1 row and more than 0 s")
        self.orders = order_axis(settings)
        self._interval = span / rows
        self._amplitudes = np.zeros((rows, self.orders.size))
        self._newest = 0  # number of the last row since the start of the run
        self._segment = -1
        self._before = 0.0  # s of the segments before
        self._time = 0.0

    def add_snapshot(self, snapshot: Snapshot) -> None:
        """Add a snapshot."""
        if snapshot.segment != self._segment:
            self._segment = snapshot.segment
            self._before = self._time
        self._time = max(self._time, self._before + snapshot.time)
        row = int(self._time / self._interval)
        passed = min(row - self._newest, len(self._amplitudes))
        if passed > 0:
            self._amplitudes[:-passed] = self._amplitudes[passed:].copy()
            self._amplitudes[-passed:] = 0.0
            self._newest = row
        if snapshot.frame is not None:
            self._amplitudes[-1] = np.maximum(self._amplitudes[-1], _amplitude(snapshot.frame))

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes, shape (rows, n_orders), m peak, the newest row last (a copy)."""
        return self._amplitudes.copy()

    @property
    def times(self) -> FloatArray:
        """Sample time since the start of the run at the begin of each row, shape (rows,), s; negative before it."""
        rows = len(self._amplitudes)
        return np.asarray((self._newest - rows + 1 + np.arange(rows)) * self._interval, dtype=np.float64)


class CascadeMode(StrEnum):
    """Content of a row of a cascade."""

    LAST = "last"
    LARGEST = "largest"


class Cascade:
    """Order spectra against speed, one row a bin, from 0 up.

    Parameters
    ----------
    settings : AnalysisSettings
        Revolutions and highest order of the frames.
    highest_speed : float
        End of the speed axis, rad/s; faster frames go into the last row.
    rows : int
        Number of rows.
    keep : CascadeMode
        Whether a row contains its last frame or the largest amplitudes of all its frames.
    """

    def __init__(
        self, settings: AnalysisSettings, highest_speed: float, rows: int = 100, keep: CascadeMode = CascadeMode.LARGEST
    ) -> None:
        if rows < 1 or not highest_speed > 0.0:
            raise ValueError(
                f"rows, highest_speed: {rows} and {highest_speed} rad/s, expected at least 1 row and more than 0 rad/s"
            )
        self.orders = order_axis(settings)
        self._width = highest_speed / rows
        self._amplitudes = np.zeros((rows, self.orders.size))
        self._filled = np.zeros(rows, dtype=np.bool_)
        self._keep = keep

    def add_snapshot(self, snapshot: Snapshot) -> None:
        """Add a snapshot."""
        if snapshot.frame is None:
            return
        row = min(int(snapshot.frame.speed / self._width), len(self._amplitudes) - 1)
        amplitude = _amplitude(snapshot.frame)
        if self._keep is CascadeMode.LARGEST:
            amplitude = np.maximum(amplitude, self._amplitudes[row])
        self._amplitudes[row] = amplitude
        self._filled[row] = True

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes, shape (rows, n_orders), m peak, the slowest row first (a copy)."""
        return self._amplitudes.copy()

    @property
    def speeds(self) -> FloatArray:
        """Middle of each row's bin, shape (rows,), rad/s."""
        return np.asarray((np.arange(len(self._amplitudes)) + 0.5) * self._width, dtype=np.float64)

    @property
    def filled(self) -> BoolArray:
        """Whether each row contains a frame, shape (rows,)."""
        return self._filled.copy()
