"""Orbits, direct, filtered to or without chosen orders, and the shaft centreline in the clearance circle.

D. Bently and C. Hatch, Fundamentals of Rotating Machinery Diagnostics, 2002, ch. 5 and 6.
"""

from dataclasses import dataclass

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import BoolArray, FloatArray
from analysis.signals.probes import Ellipse
from analysis.vectors.order_track import track_order


@dataclass(frozen=True, slots=True, eq=False)
class Orbit:
    """An orbit of the shaft in the bench axes X and Y.

    Parameters
    ----------
    motion : ndarray of float64, shape (2, revolutions, points)
        Motion in X and Y, m, mean subtracted; every revolution begins at theta = 0.
    times : ndarray of float64, shape (revolutions, points)
        Time of each point, s, for a time-base plot.
    ellipses : tuple of Ellipse
        Ellipses of the chosen orders, one per order; empty for the direct orbit.
    sigma : float
        Standard deviation of the amplitudes of the ellipses, m peak; NaN for the direct orbit.
    speed : float
        Mean speed, rad/s.
    """

    motion: FloatArray
    times: FloatArray
    ellipses: tuple[Ellipse, ...]
    sigma: float
    speed: float

    @property
    def keyphasor_points(self) -> FloatArray:
        """Positions of the shaft at theta = 0, shape (2, revolutions), m."""
        return np.asarray(self.motion[:, :, 0], dtype=np.float64)

    @property
    def peak_to_peak(self) -> FloatArray:
        """Extent in X and Y, m peak-to-peak."""
        return np.asarray(np.ptp(self.motion, axis=(1, 2)), dtype=np.float64)


def direct_orbit(record: AngularRecord, revolutions: int = 4) -> Orbit:
    """Return the unfiltered orbit of the last revolutions of a record."""
    return _orbit(record, revolutions, _last(record, revolutions), (), np.nan)


def filtered_orbit(
    record: AngularRecord, orders: tuple[float, ...], *, revolutions: int = 1, averaging_revolutions: int = 16
) -> Orbit:
    """Return the orbit filtered to chosen orders: 1X, 2X, nX, non-integer orders, or several together.

    Parameters
    ----------
    record : AngularRecord
        Its last revolutions are used.
    orders : tuple of float
        Orders of the orbit.
    revolutions : int
        Revolutions of the orbit; that of a non-integer order closes after several.
    averaging_revolutions : int
        Revolutions from which the vectors are computed, with a Hann window.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than are averaged.
    """
    synthesis, ellipses, sigma = _components(record, orders, revolutions, averaging_revolutions)
    return _orbit(record, revolutions, synthesis, ellipses, sigma)


def orbit_without(
    record: AngularRecord, orders: tuple[float, ...] = (1.0,), *, revolutions: int = 4, averaging_revolutions: int = 16
) -> Orbit:
    """Return the orbit without chosen orders, not-1X by default; parameters as for `filtered_orbit`."""
    synthesis, ellipses, sigma = _components(record, orders, revolutions, averaging_revolutions)
    return _orbit(record, revolutions, _last(record, revolutions) - synthesis, ellipses, sigma)


def _last(record: AngularRecord, revolutions: int) -> FloatArray:
    if revolutions < 1:
        raise ValueError(f"revolutions: {revolutions}, expected at least 1")
    record.require(revolutions)
    return record.waveform[:, -revolutions:]


def _components(
    record: AngularRecord, orders: tuple[float, ...], revolutions: int, averaging_revolutions: int
) -> tuple[FloatArray, tuple[Ellipse, ...], float]:
    if not orders or revolutions < 1:
        raise ValueError(f"orders {orders}, revolutions {revolutions}: expected at least one of each")
    record.require(max(averaging_revolutions, revolutions))
    used = record.section(record.revolutions - averaging_revolutions, record.revolutions)
    first = record.first_turn + record.revolutions - revolutions
    theta = 2.0 * np.pi * (first + np.arange(revolutions * record.points) / record.points)
    synthesis = np.zeros((2, theta.size))
    ellipses, sigma = [], 0.0
    for order in orders:
        track = track_order(used, order, revolutions=averaging_revolutions)
        vectors = track.vectors[:, 0]
        synthesis += (vectors[:, None] * np.exp(1j * order * theta)).real
        ellipses.append(record.pair.ellipse(vectors))
        sigma = max(sigma, float(track.sigma[:, 0].max()))
    return synthesis.reshape(2, revolutions, record.points), tuple(ellipses), sigma


def _orbit(
    record: AngularRecord, revolutions: int, displacement: FloatArray, ellipses: tuple[Ellipse, ...], sigma: float
) -> Orbit:
    motion = record.pair.to_bench(displacement)
    edges = record.times[-revolutions - 1 :]
    fraction = np.arange(record.points) / record.points
    return Orbit(
        motion=motion - motion.mean(axis=(1, 2), keepdims=True),
        times=edges[:-1, None] + np.diff(edges)[:, None] * fraction,
        ellipses=ellipses,
        sigma=sigma,
        speed=float(2.0 * np.pi * revolutions / (edges[-1] - edges[0])),
    )


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
    def is_inside(self) -> BoolArray:
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
    record.require(revolutions)
    count = record.revolutions // revolutions
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
