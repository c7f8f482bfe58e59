"""Tracks of the components below 1X through a record, each classified as whirl or whip."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from analysis.signals import FloatArray
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.spectra.order_map import OrderMap
from analysis.spectra.windows import HANN
from analysis.whirl.components import Components, ComponentSearch

MAX_ORDER_CHANGE = 0.05  # orders, of a component from frame to frame
MAX_BREAK_FRAMES = 4  # frame lengths without a component before it ends
MIN_FRAMES = 4
MIN_SPEED_RATIO = 1.05  # of the fastest to the slowest frame of a track that is classified
EXPONENT_TOLERANCE = 0.25  # of the exponent of frequency against speed: 1 is whirl, 0 is whip
MIN_PIECE = 0.02  # log of the speed, of either piece of a track that locks
LOCK_GRID = 60  # lock speeds tried
MAX_LOCK_RESIDUAL = 0.5  # of the fit with locking to the fit without


class Behaviour(StrEnum):
    """Behaviour of a component's frequency over shaft speed."""

    WHIRL = "whirl"  # proportional to the speed: constant order
    WHIP = "whip"  # constant, at a natural frequency
    WHIRL_TO_WHIP = "whirl, then whip"  # first proportional, then constant
    NEITHER = "between"  # neither
    UNKNOWN = "unknown"  # the speed hardly changed


@dataclass(frozen=True, slots=True, eq=False)
class SubsynchronousTrack:
    """One component from onset to end.

    Parameters
    ----------
    times, speeds : ndarray of float64, shape (n,)
        Middle, s, and mean speed, rad/s, of the frames that contain it.
    orders : ndarray of float64, shape (n,)
        Frequency over shaft frequency.
    order_sigma : ndarray of float64, shape (n,)
        Standard deviation of each, from the noise floor.
    forward, backward : ndarray of float64, shape (n,)
        Amplitudes of its circles, m peak; half the major axis is their sum.
    sigma : ndarray of float64, shape (n,)
        Standard deviation of either, m peak.
    behaviour : Behaviour
        Whirl, whip or both.
    exponent, exponent_sigma : float
        Exponent of frequency against speed, f proportional to speed^exponent, over the whole track, and its standard
        deviation; NaN where unknown.
    lock_speed, lock_speed_sigma : float
        Speed from which the frequency is constant, and its standard deviation, rad/s; NaN except for
        `Behaviour.WHIRL_TO_WHIP`.
    """

    times: FloatArray
    speeds: FloatArray
    orders: FloatArray
    order_sigma: FloatArray
    forward: FloatArray
    backward: FloatArray
    sigma: FloatArray
    behaviour: Behaviour
    exponent: float = math.nan
    exponent_sigma: float = math.nan
    lock_speed: float = math.nan
    lock_speed_sigma: float = math.nan

    @property
    def amplitudes(self) -> FloatArray:
        """Half the major axis of its ellipse, shape (n,), m peak."""
        return self.forward + self.backward

    @property
    def order(self) -> float:
        """Mean order, weighted with amplitude."""
        return float(np.average(self.orders, weights=self.amplitudes))

    @property
    def is_forward(self) -> bool:
        """Whether it precesses with the rotation, by the sum of its circles."""
        return bool(self.forward.sum() >= self.backward.sum())

    @property
    def onset_speed(self) -> float:
        """Speed of the first frame that contains it, rad/s."""
        return float(self.speeds[0])

    @property
    def end_speed(self) -> float:
        """Speed of the last frame that contains it, rad/s."""
        return float(self.speeds[-1])


def subsynchronous_tracks(order_map: OrderMap) -> tuple[SubsynchronousTrack, ...]:
    """Return the tracks of all components below 1X, in the order of their begin.

    1X is subtracted from each frame with its window lines. Then the strongest line between 0.08X and 0.92X is
    interpolated between the lines and subtracted likewise, up to four times. Components 5 times above the noise floor,
    and above the possible sidebands of 1X from an imperfect angle, are linked from frame to frame.

    Parameters
    ----------
    order_map : OrderMap
        With a Hann window and at least 8 revolutions per frame, up to at least two lines above 1X.

    Notes
    -----
    Whirl has a constant order of 0.42 to 0.49X, whip the constant frequency of a natural mode (A. Muszynska, Whirl and
    whip - rotor bearing stability problems, J. Sound Vib. 110, 1986). Floating-ring bearings whirl at lower orders.
    """
    if order_map.window != HANN or order_map.revolutions < 8:
        raise ValueError(
            f"order_map: {order_map.window.name} over {order_map.revolutions} revolutions, expected hann over 8"
        )
    if order_map.orders.size < order_map.revolutions + HANN.main_lobe + 1:
        raise ValueError(f"order_map: to order {order_map.orders[-1]:g}, expected at least two lines above 1X")
    scatter = order_map.angle_sigma * np.sqrt(order_map.revolutions / HANN.noise_bandwidth)
    noise = order_map.noise
    search = ComponentSearch(order_map.spectrum, order_map.revolutions, noise, noise, scatter, order_map.pair)
    found = search.find()
    return tuple(_track(order_map, found, links) for links in _linked(order_map, found))


def _linked(order_map: OrderMap, found: list[Components]) -> list[list[tuple[int, int]]]:
    """Return the tracks of sufficient length, as lists of (frame, index of component)."""
    if not found:
        return []
    orders = np.stack([component.order for component in found], axis=1)
    near = max(MAX_ORDER_CHANGE, 0.5 / order_map.revolutions)
    open_tracks: list[list[tuple[int, int]]] = []
    done: list[list[tuple[int, int]]] = []
    for frame, row in enumerate(orders):
        frame_turns = MAX_BREAK_FRAMES * order_map.revolutions
        for track in [t for t in open_tracks if order_map.turns[frame] - order_map.turns[t[-1][0]] > frame_turns]:
            open_tracks.remove(track)
            done.append(track)
        taken: set[int] = set()
        for index in np.flatnonzero(np.isfinite(row)).tolist():
            free = [i for i in range(len(open_tracks)) if i not in taken]
            best = min(free, key=lambda i: abs(orders[open_tracks[i][-1]] - row[index]), default=None)
            if best is None or abs(orders[open_tracks[best][-1]] - row[index]) > near:
                open_tracks.append([])
                best = len(open_tracks) - 1
            open_tracks[best].append((frame, index))
            taken.add(best)
    lasted = [
        track
        for track in done + open_tracks
        if len(track) >= MIN_FRAMES
        and order_map.turns[track[-1][0]] - order_map.turns[track[0][0]] >= order_map.revolutions
    ]
    return sorted(lasted)


def _track(order_map: OrderMap, found: list[Components], links: list[tuple[int, int]]) -> SubsynchronousTrack:
    frames = np.array([frame for frame, _ in links])
    orders = np.array([found[index].order[frame] for frame, index in links])
    sigma = np.array([found[index].order_sigma[frame] for frame, index in links])
    speeds = order_map.speeds[frames]
    part = HANN.independent_frames(order_map.revolutions, order_map.step, frames.size) / frames.size
    return SubsynchronousTrack(
        times=order_map.times[frames],
        speeds=speeds,
        orders=orders,
        order_sigma=sigma,
        forward=np.array([found[index].forward[frame] for frame, index in links]),
        backward=np.array([found[index].backward[frame] for frame, index in links]),
        sigma=np.hypot(noise_floor_sigma(order_map.noise), order_map.clipping_sigma.max(axis=0))[frames] / np.sqrt(2.0),
        **_behaviour(speeds, orders, part),
    )


def _behaviour(speeds: FloatArray, orders: FloatArray, independent: float) -> dict[str, Any]:
    """Return the fields of a track that classify it.

    Two laws of two parameters are fitted to the logarithms: f proportional to speed^exponent, and f proportional to the
    speed up to a lock speed and constant from there on. The second is taken where its residual is less than half.
    ``independent`` is the number of independent frames over the number of frames, as frames share samples.
    """
    if float(speeds.max() / speeds.min()) < MIN_SPEED_RATIO:
        return {"behaviour": Behaviour.UNKNOWN}
    log_speed, log_frequency = np.log(speeds), np.log(orders * speeds)
    freedom = max(speeds.size * independent - 2.0, 1.0)
    away = log_speed - log_speed.mean()
    exponent = float(away @ log_frequency / (away @ away))
    residual = log_frequency - log_frequency.mean() - exponent * away
    straight = float(residual @ residual)
    law = {"exponent": exponent, "exponent_sigma": float(np.sqrt(straight / freedom / (away @ away)))}
    lock, lock_sigma, locked = _best_lock(log_speed, log_frequency, freedom)
    if log_speed.min() + MIN_PIECE < lock < log_speed.max() - MIN_PIECE and locked < MAX_LOCK_RESIDUAL * straight:
        speed = float(np.exp(lock))
        return law | {
            "behaviour": Behaviour.WHIRL_TO_WHIP,
            "lock_speed": speed,
            "lock_speed_sigma": speed * lock_sigma,
        }
    if abs(exponent - 1.0) < EXPONENT_TOLERANCE:
        return law | {"behaviour": Behaviour.WHIRL}
    return law | {"behaviour": Behaviour.WHIP if abs(exponent) < EXPONENT_TOLERANCE else Behaviour.NEITHER}


def _best_lock(log_speed: FloatArray, log_frequency: FloatArray, freedom: float) -> tuple[float, float, float]:
    """Return the log of the best lock speed, its standard deviation, and the residual sum of squares there.

    The slope of the residual with the lock is -1 in the frames above it and its mean elsewhere, whose sum of squares is
    the curvature of the sum.
    """

    def left(lock: float) -> FloatArray:
        rest = log_frequency - np.minimum(log_speed, lock)
        return np.asarray(rest - rest.mean())

    grid = np.linspace(log_speed.min(), log_speed.max(), LOCK_GRID)
    lock = float(min(grid, key=lambda lock: float(left(lock) @ left(lock))))
    step = float(grid[1] - grid[0])
    found = minimize_scalar(lambda lock: float(left(lock) @ left(lock)), bounds=(lock - step, lock + step))
    above = float(np.mean(log_speed > found.x))
    curvature = log_speed.size * max(above * (1.0 - above), 1.0 / log_speed.size**2)
    return float(found.x), float(np.sqrt(found.fun / freedom / curvature)), float(found.fun)
