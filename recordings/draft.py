"""Files that are there whole or not at all, whatever ends their writing."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def draft_of(place: Path) -> Iterator[Path]:
    """Give a name beside a file under which it is written; at the end the draft takes its place.

    Nothing is left of a draft whose writing fails or is interrupted; what was there before then stays.
    """
    draft = place.with_name(f".{place.name}.{secrets.token_hex(4)}.part")
    try:
        yield draft
        draft.replace(place)
    finally:
        draft.unlink(missing_ok=True)
