"""Sub-synchronous findings of a run: whirl components of successive frames merged, from onset to end."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from analysis.signals.blocks import RampDirection, TimeInRun
from analysis.signals.snapshot import OrderFrame, Whirl, WhirlDirection
from analysis.signals.units import NUMBER, PEAK, SPEED

MAX_ORDER_CHANGE = 0.05  # orders, of a component from frame to frame
MAX_ABSENCE = 0.5  # s without a component before it ends
MIN_FRAMES = 3
MAX_FINDINGS = 256  # of a run; beyond it the weakest is dropped
_SMOOTHING = 0.3  # exponential smoothing factor of the expected order


@dataclass(frozen=True, slots=True)
class WhirlFinding:
    """A sub-synchronous component from onset to end.

    Parameters
    ----------
    is_forward : bool
        Whether it precesses with the rotation, by the sum of its amplitudes.
    """

    order: Annotated[float, NUMBER.of("Frequency over shaft frequency, amplitude-weighted mean")]
    order_at_onset: Annotated[float, NUMBER.of("Frequency over shaft frequency in the first results", "order_at_begin")]
    onset: Annotated[TimeInRun, NUMBER.of("First result with the component", "begin")]
    end: Annotated[TimeInRun, NUMBER.of("Last result with the component")]
    amplitude: Annotated[float, PEAK.of("Largest amplitude, half the major axis of the ellipse", "largest_peak")]
    largest_at: Annotated[TimeInRun, NUMBER.of("Time of the largest amplitude")]
    is_forward: bool
    frames: Annotated[int, NUMBER.of("Number of order spectra with the component")]
    onset_direction: Annotated[RampDirection, NUMBER.of("Ramp direction at the onset", "begin_ramp_direction")] = (
        RampDirection.RUN_UP
    )
    end_direction: Annotated[RampDirection, NUMBER.of("Ramp direction at the end", "end_ramp_direction")] = (
        RampDirection.RUN_UP
    )

    @property
    def direction(self) -> Annotated[WhirlDirection, NUMBER.of("Sense of the whirl relative to the rotation")]:
        """Sense of the whirl."""
        return WhirlDirection.of(is_forward=self.is_forward)


@dataclass(frozen=True, slots=True)
class WhirlHysteresis:
    """Speed hysteresis of a component between run-up and run-down."""

    order: Annotated[float, NUMBER.of("Frequency over shaft frequency at the onset")]
    onset: Annotated[float, SPEED.of("Lowest onset speed on a run-up")]
    end: Annotated[float, SPEED.of("Lowest end speed on a run-down")]

    @property
    def width(self) -> Annotated[float, SPEED.of("Onset speed minus end speed; negative where the end was above")]:
        """Onset speed minus end speed, rad/s; negative where it ended at a higher speed."""
        return self.onset - self.end


def whirl_hysteresis(findings: Sequence[WhirlFinding]) -> tuple[WhirlHysteresis, ...]:
    """Return onset on the run-up and end on the run-down of each component that occurs in both directions."""
    found = []
    onsets = [one for one in findings if one.onset_direction is RampDirection.RUN_UP and math.isfinite(one.onset.speed)]
    ended = [one for one in findings if one.end_direction is RampDirection.RUN_DOWN and math.isfinite(one.end.speed)]
    orders: list[float] = []
    for first in sorted(onsets, key=lambda one: one.onset.speed):
        ends = [one.end.speed for one in ended if abs(one.order - first.order) <= 2.0 * MAX_ORDER_CHANGE]
        if ends and all(abs(first.order - order) > 2.0 * MAX_ORDER_CHANGE for order in orders):
            orders.append(first.order)
            found.append(WhirlHysteresis(first.order_at_onset, first.onset.speed, min(ends)))
    return tuple(found)


@dataclass(slots=True)
class _Track:
    """Running sums over the frames of a component."""

    recent_order: float
    onset: TimeInRun
    end: TimeInRun
    largest_at: TimeInRun
    amplitude: float = 0.0
    weight: float = 0.0
    weighted_order: float = 0.0
    onset_order: float = 0.0
    forward: float = 0.0
    backward: float = 0.0
    frames: int = 0
    frame_time: float = 0.0
    onset_direction: RampDirection = RampDirection.RUN_UP
    end_direction: RampDirection = RampDirection.RUN_UP

    def add(self, whirl: Whirl, at: TimeInRun, frame_time: float, direction: RampDirection) -> None:
        amplitude = whirl.amplitude
        self.recent_order += _SMOOTHING * (whirl.order - self.recent_order)
        self.end, self.end_direction = at, direction
        if self.frames == 0:
            self.onset_direction = direction
        if amplitude > self.amplitude:
            self.amplitude, self.largest_at = amplitude, at
        self.weight += amplitude
        self.weighted_order += amplitude * whirl.order
        self.forward += whirl.forward
        self.backward += whirl.backward
        self.frames += 1
        self.frame_time = max(self.frame_time, frame_time) if self.frames <= MIN_FRAMES else self.frame_time
        if self.frames <= MIN_FRAMES:
            self.onset_order = self.weighted_order / self.weight

    @property
    def is_confirmed(self) -> bool:
        """Whether frames without common samples contain it, so that no single disturbance explains it."""
        return self.frames >= MIN_FRAMES and self.end.time - self.onset.time >= self.frame_time

    def finding(self) -> WhirlFinding:
        return WhirlFinding(
            order=self.weighted_order / self.weight,
            order_at_onset=self.onset_order,
            onset=self.onset,
            end=self.end,
            amplitude=self.amplitude,
            largest_at=self.largest_at,
            is_forward=self.forward >= self.backward,
            frames=self.frames,
            onset_direction=self.onset_direction,
            end_direction=self.end_direction,
        )


class WhirlTracker:
    """Merges the whirl components of successive frames into findings.

    A whirl continues the component whose order is within 0.05 (or half a line of the spectrum, if that is more). A
    component becomes a finding when three frames contain it, two of them without common samples. It ends when no
    frame contains it for half a second or the length of a frame, whichever is longer. Simultaneous components are
    tracked in parallel; one that replaces another is a separate finding.
    """

    def __init__(self) -> None:
        self._open: list[_Track] = []
        self._closed: list[_Track] = []

    def add_frame(
        self, segment: int, time: float, frame: OrderFrame, direction: RampDirection = RampDirection.RUN_UP
    ) -> None:
        """Add a frame.

        Parameters
        ----------
        segment : int
            Segment of the run.
        time : float
            Time in the segment at the end of the frame, s.
        frame : OrderFrame
            Frame with its whirl components.
        direction : RampDirection
            Present ramp direction.
        """
        resolution = float(frame.orders[1])
        frame_time = 2.0 * math.pi / (frame.speed * resolution)
        at = TimeInRun(segment, time - 0.5 * frame_time, frame.speed)
        self._close(at.time - max(MAX_ABSENCE, frame_time))
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
        """End all components at the end of a segment."""
        self._close(math.inf)

    def _close(self, before: float) -> None:
        for track in [track for track in self._open if track.end.time < before]:
            self._open.remove(track)
            if track.is_confirmed:
                self._closed.append(track)
        if len(self._closed) > MAX_FINDINGS:
            self._closed.remove(min(self._closed, key=lambda track: track.weight))

    def findings(self) -> tuple[WhirlFinding, ...]:
        """Return the findings, including those that have not ended, in the order of their onset."""
        tracks = self._closed + [track for track in self._open if track.is_confirmed]
        tracks.sort(key=lambda track: (track.onset.segment, track.onset.time))
        return tuple(track.finding() for track in tracks)
