"""Health of a recording: state and operator messages, derived from the recorder's statistics."""

from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import Acquisition
from daq.config.schema import TimingSection
from daq.drivers.factory import RECONNECT_REASONS
from daq.session.live_update import Clipping, RunState
from daq.session.recording.statistics import RecorderStatistics

MAX_BLOCK_DELAY = 1.0
"""Delay of a due block, s, above which a recording counts as interrupted."""
MAX_BUFFER_FILL = 0.5
"""Fill of the card's buffer, as a fraction, above which a recording counts as degraded."""


def loss_message(end: SegmentEnd) -> str:
    """Return a description of a segment end with lost samples or a device fault; empty for a normal end."""
    if end.is_gap_free and end.reason not in RECONNECT_REASONS:
        return ""
    lost = f"{'' if end.lost_is_exact else 'at least '}{end.lost:,} samples lost"
    return f"segment {end.segment} ended after {end.samples:,} samples: {end.reason.value}, {lost}; {end.detail}"


def reconnect_message(end: SegmentEnd, reconnect_s: float) -> str:
    """Return how long a disconnected device may take to return, s; empty where the run does not wait for it."""
    if end.reason not in RECONNECT_REASONS or reconnect_s <= 0:
        return ""
    return f"; reconnecting for {reconnect_s:g} s at most (session.reconnect_s)"


def recording_health(statistics: RecorderStatistics, rate: float, timing: TimingSection) -> tuple[RunState, str]:
    """Return the state of a recording and a message for the operator, empty where all is well.

    Parameters
    ----------
    statistics : RecorderStatistics
        The recorder's counts.
    rate : float
        Sample rate, Hz.
    timing : TimingSection
        Duration of a block and of the card's buffer.
    """
    if statistics.time_since_block > timing.block_s + MAX_BLOCK_DELAY:
        return RunState.INTERRUPTED, f"no samples for {statistics.time_since_block:.0f} s"
    if event := statistics.armed_event:
        recorded = f", {event - 1} recorded" if event > 1 else ""
        return RunState.ARMED, f"armed{recorded}: waiting for the start condition, {statistics.speed_rpm:,} r/min now"
    backlog = statistics.backlog / rate
    if backlog > MAX_BUFFER_FILL * timing.buffer_s:
        return RunState.DEGRADED, (
            f"the card's buffer of {timing.buffer_s:g} s holds {backlog:.1f} s: samples are about to be lost; "
            "close other programs or lower timing.rate_hz"
        )
    return RunState.RECORDING, ""


def clipped_channels(statistics: RecorderStatistics, acquisition: Acquisition) -> tuple[Clipping, ...]:
    """Return the channels that have been clipped, as counted by the recorder."""
    names = [channel.name for channel in acquisition.channels]
    counts = [(name, *statistics.clipped(row)) for row, name in enumerate(names)]
    return tuple(
        Clipping(name, samples, blocks, end / acquisition.rate) for name, samples, blocks, end in counts if samples
    )
