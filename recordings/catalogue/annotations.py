"""Remark and tags added to a run after recording, in a JSON file beside it; the recording itself never changes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from recordings.atomic_file import atomic_write
from recordings.errors import AnnotationError, StorageError

SUFFIX = ".notes.json"
FORMAT = 1
MAX_TAG_LENGTH = 64
MAX_REMARK_LENGTH = 10_000


@dataclass(frozen=True, slots=True)
class Annotations:
    """Remark and tags of a run.

    Parameters
    ----------
    remark : str
        Free text.
    tags : tuple of str
        Labels, sorted, without duplicates.
    """

    remark: str = ""
    tags: tuple[str, ...] = ()


def validated(remark: str, tags: tuple[str, ...]) -> Annotations:
    """Return annotations with stripped remark and sorted tags; AnnotationError if one is too long or malformed."""
    if len(remark) > MAX_REMARK_LENGTH:
        raise AnnotationError(f"remark: {len(remark)} characters, expected at most {MAX_REMARK_LENGTH}")
    for tag in tags:
        if not tag.strip() or tag != tag.strip() or len(tag) > MAX_TAG_LENGTH or not tag.isprintable():
            raise AnnotationError(
                f"tag: {tag[:80]!r}, expected 1 to {MAX_TAG_LENGTH} printable characters, no blanks at either end"
            )
    return Annotations(remark.strip(), tuple(sorted(set(tags))))


def annotations_path(run: Path) -> Path:
    """Return the path of the annotations file beside a run's file."""
    return run.with_name(f"{run.stem}{SUFFIX}")


def load(run: Path) -> Annotations:
    """Return the annotations of a run; empty if they are missing or cannot be read."""
    try:
        content = json.loads(annotations_path(run).read_text(encoding="utf-8"))
    except (OSError, ValueError):  # no such file, or neither UTF-8 nor JSON
        return Annotations()
    remark, tags = (content.get("remark"), content.get("tags")) if isinstance(content, Mapping) else (None, None)
    if not (isinstance(remark, str) and isinstance(tags, list) and all(isinstance(tag, str) for tag in tags)):
        return Annotations()
    try:
        return validated(remark, tuple(tags))
    except AnnotationError:
        return Annotations()


def store(run: Path, annotations: Annotations) -> None:
    """Replace the annotations of a run, atomically; StorageError if that fails."""
    path = annotations_path(run)
    content = {"format": FORMAT, "remark": annotations.remark, "tags": list(annotations.tags)}
    try:
        with atomic_write(path) as temporary:
            temporary.write_text(json.dumps(content, ensure_ascii=False, indent=1), encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror or error}") from error
