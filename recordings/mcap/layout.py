"""Where things stand in a run's file, format version 1; docs/format.md describes it for people.

The order that a run's blocks must have, and the honest end of a segment where a file breaks it.
"""

import json
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from recordings.errors import DamagedError, UnknownFormatError

FORMAT = 1
"""Version of the run format that is written; every one up to it is read."""

PROFILE = "rig"
"""Profile in the MCAP header."""

RUN_RECORD = "rig.run"
CALIBRATION_RECORD = "rig.calibration"
END_RECORD = "rig.end"
RECOVERED_RECORD = "rig.recovered"
IMPORTED_RECORD = "rig.imported"
"""Names of the metadata records."""

CONFIG_ATTACHMENT = "rig.toml"

SAMPLES, SEGMENT_END, FEATURES, ORDER_FRAME = "/samples", "/segment_end", "/features", "/order_frame"
MARK, PULSES = "/mark", "/pulses"

TOPICS = {
    SAMPLES: "SampleBlock",
    SEGMENT_END: "SegmentEnd",
    FEATURES: "Features",
    ORDER_FRAME: "OrderFrame",
    MARK: "Mark",
    PULSES: "Pulses",
}
"""Topics and their messages. The MCAP channel of each has its number in this order, from 1."""

CHANNEL_IDS = {topic: k for k, topic in enumerate(TOPICS, start=1)}

NANOSECONDS = 1_000_000_000


def sample_time_ns(sample: int, rate: float) -> int:
    """Return the time of a sample in its segment, ns, for a rate in Hz."""
    return round(sample * NANOSECONDS / rate)


def encode_metadata(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the entries of a metadata record that holds a document, its format version and its checksum."""
    text = json.dumps(document, allow_nan=False)
    return {"format": str(FORMAT), "document": text, "crc32": f"{zlib.crc32(text.encode()):08x}"}


def decode_metadata(path: Path, name: str, entries: Mapping[str, str]) -> dict[str, Any]:
    """Return the document of a metadata record made by `sealed`.

    Raises
    ------
    UnknownFormatError
        Where the format version is not known here.
    DamagedError
        Where the record is not what its checksum says.
    """
    version = entries.get("format", "none")
    if version != str(FORMAT):
        raise UnknownFormatError(f"{path}: run format version {version!r}, known here: {FORMAT}")
    text = entries.get("document", "")
    if f"{zlib.crc32(text.encode()):08x}" != entries.get("crc32"):
        raise DamagedError(f"{path}: the record {name} does not match its checksum")
    document = json.loads(text)
    if not isinstance(document, dict):
        raise DamagedError(f"{path}: the record {name} holds no document")
    return document


BREAKS_OFF = "the recording breaks off here"


class Sequence:
    """Lets through what follows without a gap; the rest of a segment after damage is left out and counted as lost.

    Parameters
    ----------
    ends : mapping of int to SegmentEnd
        The end of each segment as far as it is known.
    """

    def __init__(self, ends: Mapping[int, SegmentEnd]) -> None:
        self._ends = ends
        self._segment = -1
        self._next_sample = 0
        self._is_open = False
        self._is_broken = False

    def block(self, block: SampleBlock) -> Iterator[SourceItem]:
        """Take the next block of the file and yield what can be passed on."""
        if block.segment < self._segment or (block.segment == self._segment and not self._is_open):
            return
        if block.segment > self._segment:
            yield from self.finish()
            self._segment, self._next_sample = block.segment, 0
            self._is_open, self._is_broken = True, False
        if self._is_broken or block.first_sample != self._next_sample:
            self._is_broken = True
            return
        self._next_sample = block.end
        yield block

    def segment_end(self, end: SegmentEnd) -> Iterator[SourceItem]:
        """Take the next end of a segment in the file and yield what can be passed on."""
        if end.segment < self._segment or (end.segment == self._segment and not self._is_open):
            return
        if end.segment > self._segment:
            yield from self.finish()
            self._segment, self._next_sample = end.segment, 0
        self._is_open = False
        yield self._end(end)

    def finish(self) -> Iterator[SourceItem]:
        """End the segment that is open, if one is: no more of it will come."""
        if self._is_open:
            self._is_open = False
            yield self._end(self._ends.get(self._segment))

    def _end(self, recorded: SegmentEnd | None) -> SegmentEnd:
        if recorded is None:
            return cut_end(self._segment, self._next_sample)
        missing = recorded.samples - self._next_sample
        if missing <= 0:
            return recorded
        return SegmentEnd(
            segment=self._segment,
            samples=self._next_sample,
            reason=EndReason.CUT,
            lost=missing + recorded.lost,
            lost_is_exact=recorded.lost_is_exact,
            detail=f"the recording is damaged after sample {self._next_sample} of {recorded.samples}",
        )


def cut_end(segment: int, samples: int) -> SegmentEnd:
    """Return the end of a segment whose recording breaks off: what came after is not known."""
    return SegmentEnd(segment, samples, EndReason.CUT, lost=0, lost_is_exact=False, detail=BREAKS_OFF)
