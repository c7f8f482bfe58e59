"""Poincaré sections, shaft positions at theta = 0, which separate subharmonic motion, whirl and chaos."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import FloatArray

MIN_REVOLUTIONS = 48  # for a classification of the pattern
MAX_PERIOD = 6  # revolutions
MAX_POINT_EXTENT = 0.01  # of the motion: points within that are one
MAX_CLUSTER_SCATTER = 0.1  # within a cluster, of the extent of all points
MIN_FILLED_SECTORS, MAX_RADIUS_SCATTER = (
    10,
    0.35,
)  # of 16 sectors about the middle, and scatter of the radius of a curve


class Pattern(StrEnum):
    """Pattern of the points of a Poincaré section."""

    POINT = "point"  # synchronous alone
    CLUSTERS = "clusters"  # a subharmonic 1/k: rub, looseness
    CURVE = "curve"  # a second, incommensurate frequency: whirl
    CLOUD = "cloud"  # no pattern: chaos, noise, or whirl of varying amplitude
    UNKNOWN = "unknown"  # too few revolutions


@dataclass(frozen=True, slots=True, eq=False)
class PoincareSection:
    """Shaft positions at theta = 0, one per revolution.

    Parameters
    ----------
    points : ndarray of float64, shape (2, n)
        Positions in X and Y, m, mean of the record subtracted.
    speeds : ndarray of float64, shape (n,)
        Speed of each revolution, rad/s.
    pattern : Pattern
        Pattern of the points.
    period : int
        Revolutions after which the points repeat: 1 for a point, k for clusters; 0 otherwise.
    scatter : float
        For POINT and CLUSTERS the rms distance from the points one period before, over sqrt 2; otherwise the rms
        distance from their mean, m.
    """

    points: FloatArray
    speeds: FloatArray
    pattern: Pattern
    period: int
    scatter: float


def poincare_section(record: AngularRecord, noise: float = 0.0) -> PoincareSection:
    """Return the Poincaré section of a record at about constant speed.

    Parameters
    ----------
    record : AngularRecord
        At least 48 revolutions for a classification of the pattern.
    noise : float
        Rms noise of the probes in one sample, m: points closer than 5 times that, or than 1 % of the motion, are one.

    Notes
    -----
    k clusters are a 1/k subharmonic, a closed curve is a quasi-periodic whirl (D. Bently and C. Hatch, Fundamentals of
    Rotating Machinery Diagnostics, 2002; F. Ehrich, Handbook of Rotordynamics, 1992).
    """
    if not noise >= 0.0:
        raise ValueError(f"noise: {noise} m, expected 0 or more")
    points = record.pair.to_bench(record.waveform[:, :, 0])
    points = points - points.mean(axis=1, keepdims=True)
    extent = float(np.sqrt(np.mean(np.sum(points**2, axis=0))))
    if record.revolutions < MIN_REVOLUTIONS:
        return PoincareSection(points, record.speeds, Pattern.UNKNOWN, 0, extent)
    period, scatter = _period(points)
    if extent <= max(5.0 * noise, MAX_POINT_EXTENT * float(record.waveform.std())):
        return PoincareSection(points, record.speeds, Pattern.POINT, 1, extent)
    if scatter < max(MAX_CLUSTER_SCATTER * extent, 2.0 * noise):
        pattern = Pattern.POINT if period == 1 else Pattern.CLUSTERS
        return PoincareSection(points, record.speeds, pattern, period, scatter)
    pattern = Pattern.CURVE if _is_curve(points) else Pattern.CLOUD
    return PoincareSection(points, record.speeds, pattern, 0, extent)


def _period(points: FloatArray) -> tuple[int, float]:
    """Return the number of revolutions after which the points repeat best, and their distance then, m rms."""
    misses = [
        float(np.sqrt(0.5 * np.mean(np.sum((points[:, k:] - points[:, :-k]) ** 2, axis=0))))
        for k in range(1, MAX_PERIOD + 1)
    ]
    best = min(misses)
    period = next(k for k, miss in enumerate(misses, start=1) if miss <= 1.5 * best)
    return period, misses[period - 1]


def _is_curve(points: FloatArray) -> bool:
    """Return whether the points lie all around an ellipse about their mean."""
    axes, _ = np.linalg.qr((points / np.abs(points).max()).T)  # an ellipse becomes a circle
    radius = np.hypot(*axes.T)
    sectors = np.unique(np.floor(np.arctan2(axes[:, 1], axes[:, 0]) / (np.pi / 8.0)))
    return bool(sectors.size >= MIN_FILLED_SECTORS and radius.std() < MAX_RADIUS_SCATTER * radius.mean())


def bifurcation_diagram(record: AngularRecord, *, averaging_revolutions: int = 64) -> tuple[FloatArray, FloatArray]:
    """Return the data of a bifurcation diagram: speed and position at theta = 0 of every revolution.

    Parameters
    ----------
    record : AngularRecord
        Record of a run-up or run-down.
    averaging_revolutions : int
        Revolutions around each one whose mean position is subtracted, to remove the motion of the centreline.

    Returns
    -------
    speeds : ndarray of float64, shape (n,)
        Speed of each revolution, rad/s.
    positions : ndarray of float64, shape (2, n)
        Positions in X and Y, m.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than are averaged.

    Notes
    -----
    F. Ehrich, Handbook of Rotordynamics, 1992.
    """
    if averaging_revolutions < 2:
        raise ValueError(f"averaged: {averaging_revolutions}, expected at least 2 revolutions")
    record.require(averaging_revolutions)
    motion = record.pair.to_bench(record.waveform)
    middle = motion.mean(axis=2)
    smooth = np.stack([_running_mean(row, averaging_revolutions) for row in middle])
    return record.speeds, np.asarray(motion[:, :, 0] - smooth, dtype=np.float64)


def _running_mean(values: FloatArray, n: int) -> FloatArray:
    """Return the mean of the n values around each, over those available at the ends."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(values.size)
    begin, end = np.maximum(at - n // 2, 0), np.minimum(at + (n + 1) // 2, values.size)
    return np.asarray((total[end] - total[begin]) / (end - begin), dtype=np.float64)
