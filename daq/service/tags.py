"""Entity tags: a client that holds an answer already is told so instead of being sent it again."""

import hashlib
from typing import Any

from recordings.catalogue import RunEntry

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "Not changed since the answer whose `ETag` was sent as `If-None-Match`"}
}


def entity_tag(run: RunEntry, *parts: str) -> str:
    """Return a weak tag that changes with a run's file and with ``parts``."""
    text = "\n".join((run.id, str(run.size), str(run.changed_ns), *parts))
    return f'W/"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def file_tag(run: RunEntry) -> str:
    """Return the strong tag of a run's file, by which ranges of it are told to belong together."""
    return f'"{run.size:x}-{run.changed_ns:x}"'


def is_known(sent: str | None, tag: str) -> bool:
    """Return whether the header If-None-Match names a tag; weak and strong count alike."""
    if sent is None:
        return False
    names = {name.strip().removeprefix("W/") for name in sent.split(",")}
    return tag.removeprefix("W/") in names
