"""Moments that somebody named while a run was recorded, alarms that came, and who took note of them."""

from dataclasses import dataclass
from enum import StrEnum

from analysis.signals.header import RunHeader
from recordings.mcap.layout import MARK, sample_time_ns
from recordings.mcap.messages import parse_message
from recordings.mcap.results import EncodedResult
from recordings.mcap.schema import rig_pb2

MAX_MARKER_LENGTH = 200
"""A marker's text is cut off after so many."""


class MarkerKind(StrEnum):
    """Why a moment is marked."""

    WORD = "word"  # somebody named it
    ALARM = "alarm"  # a limit had been passed for long enough
    ACKNOWLEDGED = "acknowledged"  # somebody took note of the alarms up to then


@dataclass(frozen=True, slots=True)
class Marker:
    """A moment and its name.

    Parameters
    ----------
    segment : int
        The segment in which it lies.
    sample : int
        Samples per channel that were recorded of the segment when it came: right within a block and the card's backlog.
    text : str
        Its name.
    host_time_ns : int
        Wall clock of the host when it came, ns since 1970.
    kind : MarkerKind
        Why it is marked.
    """

    segment: int
    sample: int
    text: str
    host_time_ns: int
    kind: MarkerKind = MarkerKind.WORD


def encode_marker(marker: Marker, header: RunHeader) -> EncodedResult:
    """Return the message that keeps a marker."""
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
    return EncodedResult(MARK, log_time_ns, message.SerializeToString(), marker.segment)


def decode_marker(data: bytes) -> Marker:
    """Return the marker of a message; ValueError where the bytes are none."""
    message = parse_message(rig_pb2.Mark(), data)
    kind = MarkerKind(message.kind or MarkerKind.WORD)
    return Marker(message.segment, message.sample, message.text, message.host_time_ns, kind)
