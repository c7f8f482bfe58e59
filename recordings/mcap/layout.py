"""Layout of a run file, format version 1: topics, metadata names, log times, metadata records (see docs/format.md)."""

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recordings.errors import DamagedError, UnknownFormatError

FORMAT = 1
"""Version of the run format that is written; all versions up to it are read."""

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
MARKER, PULSES = "/mark", "/pulses"

TOPICS = {
    SAMPLES: "SampleBlock",
    SEGMENT_END: "SegmentEnd",
    FEATURES: "Features",
    ORDER_FRAME: "OrderFrame",
    MARKER: "Mark",
    PULSES: "Pulses",
}
"""Topics and their message types. MCAP channel ids count in this order, from 1."""

CHANNEL_IDS = {topic: k for k, topic in enumerate(TOPICS, start=1)}

NANOSECONDS = 1_000_000_000


def sample_time_ns(sample: int, rate: float) -> int:
    """Return the time of a sample in its segment, ns, for a rate in Hz."""
    return round(sample * NANOSECONDS / rate)


def encode_metadata(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the entries of a metadata record: the JSON document, its format version and its checksum."""
    text = json.dumps(document, allow_nan=False)
    return {"format": str(FORMAT), "document": text, "crc32": f"{zlib.crc32(text.encode()):08x}"}


def decode_metadata(path: Path, name: str, entries: Mapping[str, str]) -> dict[str, Any]:
    """Return the JSON document of a metadata record made by `encode_metadata`.

    Raises
    ------
    UnknownFormatError
        If this program does not read the format version.
    DamagedError
        If the checksum does not match.
    """
    version = entries.get("format", "none")
    if version != str(FORMAT):
        raise UnknownFormatError(f"{path}: run format version {version!r}, expected {FORMAT}")
    text = entries.get("document", "")
    if f"{zlib.crc32(text.encode()):08x}" != entries.get("crc32"):
        raise DamagedError(f"{path}: the record {name} does not match its checksum")
    document = json.loads(text)
    if not isinstance(document, dict):
        raise DamagedError(f"{path}: the record {name} is not a JSON object")
    return document
