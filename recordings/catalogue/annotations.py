"""What people say of a run afterwards: a remark and tags, in a small file beside it; the recording never changes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from recordings.atomic_file import atomic_write
from recordings.errors import StorageError

SUFFIX = ".notes.json"
FORMAT = 1
LONGEST_TAG = 64
LONGEST_REMARK = 10_000


@dataclass(frozen=True, slots=True)
class Annotations:
    """Words on a run.

    Parameters
    ----------
    remark : str
        Free words.
    tags : tuple of str
        Labels, sorted, each once.
    """

    remark: str = ""
    tags: tuple[str, ...] = ()


def checked(remark: str, tags: tuple[str, ...]) -> Annotations:
    """Return annotations in their proper form; ValueError for a tag or a remark that cannot be one."""
    if len(remark) > LONGEST_REMARK:
        raise ValueError(f"remark: {len(remark)} characters, expected at most {LONGEST_REMARK}")
    for tag in tags:
        if not tag.strip() or tag != tag.strip() or len(tag) > LONGEST_TAG or not tag.isprintable():
            raise ValueError(
                f"tag: {tag[:80]!r}, expected 1 to {LONGEST_TAG} printable characters, no blanks at either end"
            )
    return Annotations(remark.strip(), tuple(sorted(set(tags))))


def place_of(run: Path) -> Path:
    """Return the file with the annotations of a run's file."""
    return run.with_name(f"{run.stem}{SUFFIX}")


def load(run: Path) -> Annotations:
    """Return the annotations of a run; none where they cannot be read."""
    try:
        kept = json.loads(place_of(run).read_text(encoding="utf-8"))
        return checked(kept["remark"], tuple(kept["tags"])) if isinstance(kept, Mapping) else Annotations()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return Annotations()


def store(run: Path, annotations: Annotations) -> None:
    """Keep the annotations of a run in place of those before, whole or not at all; StorageError where that fails."""
    place = place_of(run)
    document = {"format": FORMAT, "remark": annotations.remark, "tags": list(annotations.tags)}
    try:
        with atomic_write(place) as temporary:
            temporary.write_text(json.dumps(document, ensure_ascii=False, indent=1), encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{place}: cannot be written: {error.strerror or error}") from error
