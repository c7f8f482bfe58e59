"""Markers of a run: notes at a time, added by the operator or by alarms and their acknowledgement."""

from dataclasses import dataclass
from enum import StrEnum

from analysis.signals.header import RunHeader
from recordings.mcap.layout import MARKER, sample_time_ns
from recordings.mcap.messages import message_errors, parse_message
from recordings.mcap.results import EncodedResult
from recordings.mcap.schema import rig_pb2

MAX_MARKER_LENGTH = 200
"""Characters; longer texts are cut off."""
DEFAULT_TEXT = "marker"
"""Text of a marker that is added without one."""


class MarkerKind(StrEnum):
    """Origin of a marker."""

    NOTE = "word"  # a note by the operator
    ALARM = "alarm"  # a limit was exceeded for the alarm's hold time
    ACKNOWLEDGED = "acknowledged"  # the operator acknowledged the alarms up to here


@dataclass(frozen=True, slots=True)
class Marker:
    """A note at a sample of a run.

    Parameters
    ----------
    segment : int
        Segment of the run.
    sample : int
        Samples per channel of the segment that had been recorded when the marker was added: accurate to one block and
        the card's backlog.
    text : str
        The note.
    host_time_ns : int
        The host's wall clock when the marker was added, ns since 1970.
    kind : MarkerKind
        Origin.
    """

    segment: int
    sample: int
    text: str
    host_time_ns: int
    kind: MarkerKind = MarkerKind.NOTE


def encode_marker(marker: Marker, header: RunHeader) -> EncodedResult:
    """Return a marker as a message for the run's file."""
    rate = header.acquisition.rate
    message = rig_pb2.Mark(
        segment=marker.segment,
        sample=marker.sample,
        time_s=marker.sample / rate,
        text=marker.text[:MAX_MARKER_LENGTH],
        host_time_ns=marker.host_time_ns,
        kind=marker.kind.value,
    )
    log_time_ns = header.started_ns + sample_time_ns(marker.sample, rate)
    return EncodedResult(MARKER, log_time_ns, message.SerializeToString(), marker.segment)


@message_errors()
def decode_marker(data: bytes) -> Marker:
    """Return the marker of a serialised message; MessageError."""
    message = parse_message(rig_pb2.Mark(), data)
    kind = MarkerKind(message.kind or MarkerKind.NOTE)
    return Marker(message.segment, message.sample, message.text, message.host_time_ns, kind)
