"""Entity tags: a client that holds an answer already is told so instead of being sent it again."""

import hashlib
from typing import Any

from daq.schemas import Document
from recordings.catalogue.catalogue import RunEntry

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "Not changed since the answer whose `ETag` was sent as `If-None-Match`"}
}


def entity_tag(run: RunEntry, *parts: str) -> str:
    """Return a weak tag that changes with a run's file and with ``parts``."""
    text = "\n".join((run.id, str(run.size), str(run.changed_ns), *parts))
    return f'W/"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def is_known(sent: str | None, tag: str) -> bool:
    """Return whether the header If-None-Match names a tag; weak and strong count alike."""
    if sent is None:
        return False
    names = {name.strip().removeprefix("W/") for name in sent.split(",")}
    return "*" in names or tag.removeprefix("W/") in names


def is_meant(sent: str | None, tag: str) -> bool:
    """Return whether the header If-Match allows a change of what has a tag; it does where it is not sent."""
    return sent is None or not {"*", tag}.isdisjoint(name.strip() for name in sent.split(","))


def document_tag(document: Document) -> str:
    """Return the strong tag of a document, which changes with whatever it says."""
    return f'"{hashlib.sha256(document.model_dump_json().encode()).hexdigest()[:32]}"'
