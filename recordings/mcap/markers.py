"""Moments that somebody named while a run was recorded, alarms that came, and who took note of them."""

from dataclasses import dataclass
from enum import StrEnum

from analysis.signals.header import RunHeader
from recordings.mcap.layout import MARK, sample_time_ns
from recordings.mcap.messages import parsed
from recordings.mcap.results import EncodedResult
from recordings.mcap.schema import rig_pb2

MOST_LETTERS = 200
"""A mark's text is cut off after so many."""


class MarkKind(StrEnum):
    """Why a moment is marked."""

    WORD = "word"  # somebody named it
    ALARM = "alarm"  # a limit had been passed for long enough
    ACKNOWLEDGED = "acknowledged"  # somebody took note of the alarms up to then


@dataclass(frozen=True, slots=True)
class Mark:
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
    kind : MarkKind
        Why it is marked.
    """

    segment: int
    sample: int
    text: str
    host_time_ns: int
    kind: MarkKind = MarkKind.WORD


def encode_mark(mark: Mark, header: RunHeader) -> EncodedResult:
    """Return the message that keeps a mark."""
    rate = header.acquisition.rate
    message = rig_pb2.Mark(
        segment=mark.segment,
        sample=mark.sample,
        time_s=mark.sample / rate,
        text=mark.text[:MOST_LETTERS],
        host_time_ns=mark.host_time_ns,
        kind=mark.kind.value,
    )
    log_time_ns = header.started_ns + sample_time_ns(mark.sample, rate)
    return EncodedResult(MARK, log_time_ns, message.SerializeToString(), mark.segment)


def decode_mark(data: bytes) -> Mark:
    """Return the mark of a message; ValueError where the bytes are none."""
    message = parsed(rig_pb2.Mark(), data)
    kind = MarkKind(message.kind or MarkKind.WORD)
    return Mark(message.segment, message.sample, message.text, message.host_time_ns, kind)
