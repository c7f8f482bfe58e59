"""Orbits: direct, filtered to chosen orders, or without chosen orders, with their keyphasor points.

D. Bently and C. Hatch, Fundamentals of Rotating Machinery Diagnostics, 2002, ch. 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.signals.probes import Ellipse
from analysis.vectors.order_track import track_order

FloatArray = NDArray[np.float64]


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
    if record.revolutions < revolutions:
        raise RecordTooShortError(f"{record.revolutions} revolutions in the record, expected at least {revolutions}")
    return record.waveform[:, -revolutions:]


def _components(
    record: AngularRecord, orders: tuple[float, ...], revolutions: int, averaging_revolutions: int
) -> tuple[FloatArray, tuple[Ellipse, ...], float]:
    if not orders or revolutions < 1:
        raise ValueError(f"orders {orders}, revolutions {revolutions}: expected at least one of each")
    if record.revolutions < max(averaging_revolutions, revolutions):
        needed = max(averaging_revolutions, revolutions)
        raise RecordTooShortError(f"{record.revolutions} revolutions in the record, expected at least {needed}")
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
