"""Poincaré sections, shaft positions at theta = 0, which separate subharmonic motion, whirl and chaos."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from fractions import Fraction

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import FloatArray
from analysis.spectra.order_map import order_map
from analysis.spectra.windows import HANN
from analysis.vectors.order_track import track_order

MIN_REVOLUTIONS = 48  # for a classification of the pattern
MAX_PERIOD = 8  # revolutions
MAX_LOCK_UNCERTAINTY = 1e-3  # orders, 3 standard deviations: more does not exclude a whirl near the fraction
MIN_DRIFT = 0.005  # turns of the component over the record: less is an error of the shaft angle
MIN_TO_FLOOR = 3.0  # of the strongest component to the noise floor
FRAME_REVOLUTIONS = 16
MAX_ORDER = 2.5  # of the strongest component
MAX_POINT_EXTENT = 0.01  # of the motion: points within that are one
MAX_CLUSTER_SCATTER = 0.1  # within a cluster, of the extent of all points
MIN_CURVE_SHARE = 0.7  # of the extent of the points: less is more than one component


class Pattern(StrEnum):
    """Pattern of the points of a Poincaré section."""

    POINT = "point"  # synchronous alone
    CLUSTERS = "clusters"  # a component locked to j/k of the speed: rub, looseness
    CURVE = "curve"  # a second, incommensurate frequency: whirl
    CLOUD = "cloud"  # no pattern: chaos, noise, or several components
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
    order, order_sigma : float
        Order of the strongest component that is no whole order, from the drift of its phase over the record, and its
        standard deviation; NaN for a point or too few revolutions.
    revolutions_needed : int
        Revolutions with which an unknown pattern can be classified, at the same noise; 0 where it is.
    """

    points: FloatArray
    speeds: FloatArray
    pattern: Pattern
    period: int
    scatter: float
    order: float = math.nan
    order_sigma: float = math.nan
    revolutions_needed: int = 0


def poincare_section(record: AngularRecord, noise: float = 0.0) -> PoincareSection:
    """Return the Poincaré section of a record at about constant speed.

    The strongest component that is no whole order decides: its order follows from the drift of its phase over the whole
    record. Points repeat only where that order is a fraction j/k within 3 standard deviations, and these are small
    enough to exclude a whirl nearby.

    Parameters
    ----------
    record : AngularRecord
        At least 48 revolutions for a classification of the pattern.
    noise : float
        Rms noise of the probes in one sample, m. Points are one where they lie within 5 times that and no component
        stands out, or within 1 % of the motion.

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
    section = PoincareSection(points, record.speeds, Pattern.UNKNOWN, 0, extent)
    if record.revolutions < MIN_REVOLUTIONS:
        return replace(section, revolutions_needed=MIN_REVOLUTIONS)
    order, sigma, size = _strongest_component(record)
    if extent <= MAX_POINT_EXTENT * float(record.waveform.std()) or (extent <= 5.0 * noise and size == 0.0):
        return replace(section, pattern=Pattern.POINT, period=1)
    section = replace(section, order=order, order_sigma=sigma)
    nearest = Fraction(order).limit_denominator(MAX_PERIOD)
    period = nearest.denominator
    scatter = float(np.sqrt(0.5 * np.mean(np.sum((points[:, period:] - points[:, :-period]) ** 2, axis=0))))
    repeats = scatter < max(MAX_CLUSTER_SCATTER * extent, 2.0 * noise)
    if abs(order - nearest) <= max(3.0 * sigma, MIN_DRIFT / record.revolutions) and repeats:
        if 3.0 * sigma > MAX_LOCK_UNCERTAINTY:
            needed = record.revolutions * (3.0 * sigma / MAX_LOCK_UNCERTAINTY) ** (2.0 / 3.0)
            return replace(section, revolutions_needed=int(np.ceil(needed)))
        pattern = Pattern.POINT if period == 1 else Pattern.CLUSTERS
        return replace(section, pattern=pattern, period=period, scatter=scatter)
    without_noise = float(np.sqrt(max(extent**2 - 2.0 * noise**2, 0.0)))
    is_curve = size > 0.0 and size >= MIN_CURVE_SHARE * without_noise
    return replace(section, pattern=Pattern.CURVE if is_curve else Pattern.CLOUD)


def _strongest_component(record: AngularRecord) -> tuple[float, float, float]:
    """Return order, its standard deviation, and rms displacement, m, of the strongest component besides whole orders.

    The displacement is 0 where no component stands out of the noise.
    The phase of a component at a neighbouring order q drifts by its order minus q, in turns per revolution.
    """
    rest = record.with_waveform(record.waveform - record.waveform.mean(axis=1, keepdims=True))
    spectra = order_map(rest, revolutions=FRAME_REVOLUTIONS, highest_order=MAX_ORDER)
    size = np.sqrt(np.mean(np.abs(spectra.spectrum) ** 2, axis=(0, 1)))
    line = HANN.main_lobe + int(np.argmax(size[HANN.main_lobe : -1]))
    towards = 1 if size[line + 1] > size[line - 1] else -1
    away = towards * float(HANN.interpolation.offset(size[line], size[line + towards]))
    order = (line + float(np.clip(away, -0.5, 0.5))) / FRAME_REVOLUTIONS
    track = track_order(rest, order, revolutions=FRAME_REVOLUTIONS)
    probe = int(np.argmax(np.abs(track.vectors).mean(axis=1)))
    phase, turns = np.unwrap(np.angle(track.vectors[probe])), track.step * np.arange(track.times.size)
    turns = turns - turns.mean()
    spread = float(turns @ turns)
    drift = float(turns @ phase) / spread
    left = phase - phase.mean() - drift * turns
    independent = HANN.independent_frames(track.revolutions, track.step, phase.size)
    noise = float(np.sum(track.phase_sigma[probe] ** 2)) / independent
    variance = max(float(left @ left) / max(independent - 2.0, 1.0), noise)
    X, Y = record.pair.vectors_to_bench(track.vectors)
    displacement = float(np.sqrt(0.5 * np.mean(np.abs(X) ** 2 + np.abs(Y) ** 2)))
    stands_out = size[line] > MIN_TO_FLOOR * float(np.median(spectra.noise))
    return (
        order + drift / (2.0 * np.pi),
        float(np.sqrt(variance / spread)) / (2.0 * np.pi),
        displacement if stands_out else 0.0,
    )


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
