"""Where things stand in a run's file, format version 1; docs/format.md describes it for people."""

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

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


def sealed(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the entries of a metadata record that holds a document, its format version and its checksum."""
    text = json.dumps(document, allow_nan=False)
    return {"format": str(FORMAT), "document": text, "crc32": f"{zlib.crc32(text.encode()):08x}"}


def unsealed(path: Path, name: str, entries: Mapping[str, str]) -> dict[str, Any]:
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
