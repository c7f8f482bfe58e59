"""Sub-synchronous findings: the whirls of successive frames merged into components with a beginning and an end."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Moment:
    """A place in a run.

    Parameters
    ----------
    segment : int
        Segment of the run.
    time : float
        Time in that segment, s.
    speed : float
        Shaft speed there, rad/s; NaN where unknown.
    """

    segment: int
    time: float
    speed: float


@dataclass(frozen=True, slots=True)
class WhirlFinding:
    """A sub-synchronous component from its beginning to its end.

    Parameters
    ----------
    order : float
        Its frequency over the shaft's, mean weighted with amplitude.
    order_at_begin : float
        The same over its first frames.
    begin, end : Moment
        First and last frame that showed it.
    amplitude : float
        Its largest amplitude, half the major axis of its ellipse, m peak.
    largest : Moment
        Where that was.
    is_forward : bool
        Whether it went round with the shaft, by the sum of its amplitudes.
    frames : int
        Number of frames that showed it.
    """

    order: float
    order_at_begin: float
    begin: Moment
    end: Moment
    amplitude: float
    largest: Moment
    is_forward: bool
    frames: int
