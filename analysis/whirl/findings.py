"""Sub-synchronous findings: the whirls of successive frames merged into components with a beginning and an end."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from analysis.signals.blocks import TimeInRun
from analysis.signals.ramp import RampDirection
from analysis.signals.snapshot import OrderFrame, Whirl

MAX_ORDER_CHANGE = 0.05  # orders: nearer whirls are one component
MAX_BREAK = 0.5  # s without the component before it has ended
MIN_FRAMES = 3
MAX_FINDINGS = 256  # the weakest is dropped
_SMOOTHING = 0.3  # how fast the order that is looked for follows


@dataclass(frozen=True, slots=True)
class WhirlFinding:
    """A sub-synchronous component from its beginning to its end.

    Parameters
    ----------
    order : float
        Its frequency over the shaft's, mean weighted with amplitude.
    order_at_begin : float
        The same over its first frames.
    begin, end : TimeInRun
        First and last frame that showed it.
    amplitude : float
        Its largest amplitude, half the major axis of its ellipse, m peak.
    largest : TimeInRun
        Where that was.
    is_forward : bool
        Whether it went round with the shaft, by the sum of its amplitudes.
    frames : int
        Number of frames that showed it.
    begin_direction, end_direction : RampDirection
        Whether the shaft was running up or down when it began, and when it ended.
    """

    order: float
    order_at_begin: float
    begin: TimeInRun
    end: TimeInRun
    amplitude: float
    largest: TimeInRun
    is_forward: bool
    frames: int
    begin_direction: RampDirection = RampDirection.RUN_UP
    end_direction: RampDirection = RampDirection.RUN_UP


@dataclass(frozen=True, slots=True)
class WhirlHysteresis:
    """How much longer a component stays on the run-down than the run-up took to bring it.

    Parameters
    ----------
    order : float
        Of the component when it came.
    onset : float
        Lowest speed at which it came on a run-up, rad/s.
    end : float
        Lowest speed at which it went on a run-down, rad/s.
    """

    order: float
    onset: float
    end: float

    @property
    def width(self) -> float:
        """By how much lower it went than it came, rad/s; negative where it went sooner."""
        return self.onset - self.end


def whirl_hysteresis(findings: Sequence[WhirlFinding]) -> tuple[WhirlHysteresis, ...]:
    """Return onset on the run-up and end on the run-down of every component that a run showed in both directions."""
    found = []
    came = [one for one in findings if one.begin_direction is RampDirection.RUN_UP and math.isfinite(one.begin.speed)]
    went = [one for one in findings if one.end_direction is RampDirection.RUN_DOWN and math.isfinite(one.end.speed)]
    orders: list[float] = []
    for first in sorted(came, key=lambda one: one.begin.speed):
        ends = [one.end.speed for one in went if abs(one.order - first.order) <= 2.0 * MAX_ORDER_CHANGE]
        if ends and all(abs(first.order - order) > 2.0 * MAX_ORDER_CHANGE for order in orders):
            orders.append(first.order)
            found.append(WhirlHysteresis(first.order_at_begin, first.begin.speed, min(ends)))
    return tuple(found)


@dataclass(slots=True)
class _Track:
    """A component that is being followed: sums over its frames."""

    recent_order: float
    begin: TimeInRun
    end: TimeInRun
    largest: TimeInRun
    amplitude: float = 0.0
    weight: float = 0.0
    weighted_order: float = 0.0
    begin_order: float = 0.0
    forward: float = 0.0
    backward: float = 0.0
    frames: int = 0
    frame_time: float = 0.0
    begin_direction: RampDirection = RampDirection.RUN_UP
    end_direction: RampDirection = RampDirection.RUN_UP

    def add(self, whirl: Whirl, at: TimeInRun, frame_time: float, direction: RampDirection) -> None:
        amplitude = whirl.amplitude
        self.recent_order += _SMOOTHING * (whirl.order - self.recent_order)
        self.end, self.end_direction = at, direction
        if self.frames == 0:
            self.begin_direction = direction
        if amplitude > self.amplitude:
            self.amplitude, self.largest = amplitude, at
        self.weight += amplitude
        self.weighted_order += amplitude * whirl.order
        self.forward += whirl.forward
        self.backward += whirl.backward
        self.frames += 1
        self.frame_time = max(self.frame_time, frame_time) if self.frames <= MIN_FRAMES else self.frame_time
        if self.frames <= MIN_FRAMES:
            self.begin_order = self.weighted_order / self.weight

    @property
    def is_sure(self) -> bool:
        """Whether frames that share no samples showed it, so that no single disturbance can be behind it."""
        return self.frames >= MIN_FRAMES and self.end.time - self.begin.time >= self.frame_time

    def finding(self) -> WhirlFinding:
        return WhirlFinding(
            order=self.weighted_order / self.weight,
            order_at_begin=self.begin_order,
            begin=self.begin,
            end=self.end,
            amplitude=self.amplitude,
            largest=self.largest,
            is_forward=self.forward >= self.backward,
            frames=self.frames,
            begin_direction=self.begin_direction,
            end_direction=self.end_direction,
        )


class WhirlTracker:
    """Merges the whirls of successive frames into components.

    A whirl belongs to the component whose order it continues within 0.05 (half a line of the spectrum, if that is
    more). A component is found when three frames showed it, of which two share no samples, and has ended when no
    frame has shown it for half a second or a frame's length, whichever is longer. Components that are there together
    are followed side by side; one that replaces another is a finding of its own.
    """

    def __init__(self) -> None:
        self._open: list[_Track] = []
        self._closed: list[_Track] = []

    def add_frame(
        self, segment: int, time: float, frame: OrderFrame, direction: RampDirection = RampDirection.RUN_UP
    ) -> None:
        """Take a frame.

        Parameters
        ----------
        segment : int
            Segment of the run.
        time : float
            Time of the frame's end in it, s.
        frame : OrderFrame
            With its whirls.
        direction : RampDirection
            Whether the shaft runs up or down.
        """
        resolution = float(frame.orders[1])
        frame_time = 2.0 * math.pi / (frame.speed * resolution)
        at = TimeInRun(segment, time - 0.5 * frame_time, frame.speed)
        self._close(at.time - max(MAX_BREAK, frame_time))
        near = max(MAX_ORDER_CHANGE, 0.5 * resolution)
        free = list(self._open)
        for whirl in frame.whirls:
            track = min(free, key=lambda track: abs(track.recent_order - whirl.order), default=None)
            if track is None or abs(track.recent_order - whirl.order) > near:
                track = _Track(whirl.order, at, at, at)
                self._open.append(track)
            else:
                free.remove(track)
            track.add(whirl, at, frame_time, direction)

    def end_segment(self) -> None:
        """End all components: time does not run on into the next segment."""
        self._close(math.inf)

    def _close(self, before: float) -> None:
        for track in [track for track in self._open if track.end.time < before]:
            self._open.remove(track)
            if track.is_sure:
                self._closed.append(track)
        if len(self._closed) > MAX_FINDINGS:
            self._closed.remove(min(self._closed, key=lambda track: track.weight))

    def findings(self) -> tuple[WhirlFinding, ...]:
        """Return the components found, those still there included, in the order in which they began."""
        tracks = self._closed + [track for track in self._open if track.is_sure]
        tracks.sort(key=lambda track: (track.begin.segment, track.begin.time))
        return tuple(track.finding() for track in tracks)
