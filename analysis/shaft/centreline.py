"""Shaft centreline: mean position of the shaft in the clearance circle, against speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Centreline:
    """Mean shaft positions relative to the middle of the clearance circle.

    Parameters
    ----------
    positions : ndarray of float64, shape (2, n)
        In the bench axes X and Y, m.
    sigma : ndarray of float64, shape (2, n)
        Standard deviation of each, from the scatter of the averaged revolutions, m. Drift of the probes since the
        measurement at rest is not included.
    speeds : ndarray of float64, shape (n,)
        Speed at each position, rad/s.
    times : ndarray of float64, shape (n,)
        Time of each position, s.
    clearance : float
        Radius of the clearance circle, m.
    """

    positions: FloatArray
    sigma: FloatArray
    speeds: FloatArray
    times: FloatArray
    clearance: float

    @property
    def eccentricity_ratio(self) -> FloatArray:
        """Eccentricity over clearance, shape (n,); above 1 the rest position or the clearance is wrong."""
        return np.asarray(np.hypot(*self.positions) / self.clearance, dtype=np.float64)

    @property
    def attitude(self) -> FloatArray:
        """Attitude angle from straight down to the shaft, rad, positive in the direction of rotation, shape (n,)."""
        x, y = self.positions
        return np.asarray(np.arctan2(x, -y), dtype=np.float64)

    @property
    def is_inside(self) -> NDArray[np.bool_]:
        """Whether each position lies within the circle, shape (n,)."""
        return self.eccentricity_ratio <= 1.0

    def circle(self, points: int = 181) -> FloatArray:
        """Return the clearance circle, shape (2, points), m."""
        angle = np.linspace(0.0, 2.0 * np.pi, points)
        return self.clearance * np.stack([np.cos(angle), np.sin(angle)])


def centreline(
    record: AngularRecord,
    rest_displacement: FloatArray,
    clearance: float,
    *,
    revolutions: int = 16,
    rest_position: tuple[float, float] | None = None,
) -> Centreline:
    """Return the shaft centreline from the mean displacements at the probes.

    Parameters
    ----------
    record : AngularRecord
        Record of probes with DC response.
    rest_displacement : ndarray of float64, shape (2,)
        Displacement towards the probes x and y with the shaft at rest, m.
    clearance : float
        Radius of the clearance circle, m.
    revolutions : int
        Revolutions averaged for each position.
    rest_position : tuple of float or None
        Position of the shaft at rest, in X and Y from the middle, m; None for the bottom of the circle.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than are averaged.

    Notes
    -----
    D. Bently and C. Hatch, Fundamentals of Rotating Machinery Diagnostics, 2002, ch. 6.
    """
    if not clearance > 0.0 or rest_displacement.shape != (2,) or revolutions < 2:
        raise ValueError(
            f"clearance {clearance} m, rest_displacement {rest_displacement.shape}, revolutions {revolutions}: "
            "expected above 0, (2,), at least 2"
        )
    count = record.revolutions // revolutions
    if count == 0:
        raise RecordTooShortError(f"{record.revolutions} revolutions in the record, expected at least {revolutions}")
    used = count * revolutions
    means = record.waveform[:, :used].mean(axis=2).reshape(2, count, revolutions)
    origin = np.array(rest_position if rest_position is not None else (0.0, -clearance))
    moved = record.pair.to_bench(means.mean(axis=2) - rest_displacement[:, None])
    scatter = record.pair.to_bench(means - rest_displacement[:, None, None]).std(axis=2, ddof=1)
    edges = record.times[: used + 1 : revolutions]
    return Centreline(
        positions=origin[:, None] + moved,
        sigma=scatter / np.sqrt(revolutions),
        speeds=2.0 * np.pi * revolutions / np.diff(edges),
        times=0.5 * (edges[1:] + edges[:-1]),
        clearance=clearance,
    )
