"""Runs that are put away: moved into a folder inside the data folder, never deleted."""

from itertools import count
from pathlib import Path

from recordings import annotations
from recordings.errors import StorageError

FOLDER = "trash"


def put_away(run: Path) -> Path:
    """Move a run's file and what was said of it into the trash beside it; return where the file is now.

    Whoever wants it back moves it back by hand. StorageError where it cannot be moved.
    """
    folder = run.parent / FOLDER
    try:
        folder.mkdir(exist_ok=True)
        for number in count(1):
            name = run.name if number == 1 else f"{run.stem} ({number}){run.suffix}"
            place = folder / name
            if not place.exists():
                break
        words = annotations.place_of(run)
        run.rename(place)
        if words.exists():
            words.rename(annotations.place_of(place))
    except OSError as error:
        raise StorageError(f"{run}: cannot be moved to {folder}: {error.strerror or error}") from error
    return place
