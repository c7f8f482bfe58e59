"""Runs that are put away: moved into a folder inside the data folder, never deleted, and moved back."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from recordings.atomic_file import replace_with_retry
from recordings.catalogue import annotations
from recordings.catalogue.incoming_run import move_without_overwriting
from recordings.errors import NotFoundError, StorageError

FOLDER = "trash"


@dataclass(frozen=True, slots=True)
class TrashedRun:
    """A run in the trash.

    Parameters
    ----------
    name : str
        Its file's name there, without suffix: the run's id, with a number behind where there was one already.
    size : int
        Bytes.
    """

    name: str
    size: int


def move_to_trash(run: Path) -> Path:
    """Move a run's file and what was said of it into the trash beside it; return where the file is now.

    NotFoundError where it has gone, StorageError where it cannot be moved.
    """
    folder = run.parent / FOLDER
    try:
        folder.mkdir(exist_ok=True)
        place = _free(folder, run)
        try:
            replace_with_retry(run, place)
        except OSError:
            place.unlink()
            raise
        _move_words(run, place)
    except FileNotFoundError as error:
        raise NotFoundError(f"run {run.stem!r}: its file has gone") from error
    except OSError as error:
        raise StorageError(f"{run}: cannot be moved to {folder}: {error.strerror or error}") from error
    return place


def listed(data: Path, suffix: str) -> Iterator[TrashedRun]:
    """Yield the files with a suffix in the trash of a data folder, by name; StorageError where it cannot be read."""
    try:
        for path in sorted((data / FOLDER).glob(f"*{suffix}")):
            if path.is_file():
                yield TrashedRun(path.stem, path.stat().st_size)
    except OSError as error:
        raise StorageError(f"{data / FOLDER}: cannot be read: {error.strerror or error}") from error


def restore(data: Path, name: str, place: Path) -> None:
    """Move a run out of the trash of a data folder to its place in it, never in place of another.

    Parameters
    ----------
    data : Path
        The folder.
    name : str
        As `listed` gives it.
    place : Path
        Where the run is to lie.

    Raises
    ------
    NotFoundError
        There is none of this name.
    RunExistsError, StorageError
        There is a run already, or it cannot be moved.
    """
    file = data / FOLDER / f"{name}{place.suffix}"
    if name not in {each.name for each in listed(data, place.suffix)}:
        raise NotFoundError(f"{name[:120]!r}: there is none of this name in {file.parent}")
    move_without_overwriting(file, place)
    try:
        _move_words(file, place)
    except OSError as error:
        raise StorageError(f"{place}: what was said of it stays in {file.parent}: {error.strerror or error}") from error


def _free(folder: Path, run: Path) -> Path:
    """Return a file of the trash that nobody else can take."""
    for number in count(1):
        place = folder / (run.name if number == 1 else f"{run.stem} ({number}){run.suffix}")
        try:
            place.open("xb").close()
        except FileExistsError:
            continue
        return place
    raise AssertionError("numbers have no end")


def _move_words(run: Path, place: Path) -> None:
    words = annotations.place_of(run)
    if words.exists():
        words.replace(annotations.place_of(place))
