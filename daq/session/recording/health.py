"""What is to be said of how the samples come, before any are lost."""

from analysis.signals.blocks import SegmentEnd
from daq.config.schema import TimingSection
from daq.drivers.reconnecting import RECONNECT_REASONS
from daq.session.live_update import RunState
from daq.session.recording.statistics import RecorderStatistics

SILENCE = 1.0
"""So much later, s, than a block is due its absence is told."""
FULL = 0.5
"""From this part of the card's buffer on the backlog is told."""


def loss_message(end: SegmentEnd) -> str:
    """Return what is to be said of the end of a segment with which something went wrong; nothing where all is well."""
    if end.is_gap_free and end.reason not in RECONNECT_REASONS:
        return ""
    lost = f"{'' if end.lost_is_exact else 'at least '}{end.lost:,} samples lost"
    return f"segment {end.segment} ended after {end.samples:,} samples: {end.reason.value}, {lost}; {end.detail}"


def recording_health(statistics: RecorderStatistics, rate: float, timing: TimingSection) -> tuple[RunState, str]:
    """Return how a recording goes, and what is to be said to the operator; nothing where all is well.

    Parameters
    ----------
    statistics : RecorderStatistics
        What the recorder keeps.
    rate : float
        Sample rate, Hz.
    timing : TimingSection
        How long a block is, and how much the card holds for a late reader.
    """
    if statistics.time_since_block > timing.block_s + SILENCE:
        return RunState.INTERRUPTED, f"no samples for {statistics.time_since_block:.0f} s"
    if event := statistics.armed_event:
        again = f" again, {event - 1} recorded" if event > 1 else ""
        return RunState.ARMED, f"armed{again}: the start is waited for, {statistics.speed_rpm:,} r/min now"
    backlog = statistics.backlog / rate
    if backlog > FULL * timing.buffer_s:
        return RunState.DEGRADED, (
            f"{backlog:.1f} s wait in the card's buffer of {timing.buffer_s:g} s: samples are about to be lost; "
            "close other programs or lower timing.rate_hz"
        )
    return RunState.RECORDING, ""
