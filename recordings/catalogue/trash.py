"""The trash: a folder inside the data folder to which runs are moved; nothing is deleted, and runs can be restored."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from recordings.catalogue.entry import annotations_path
from recordings.errors import NotFoundError
from recordings.file_operations import move_without_overwriting, replace_with_retry, storage_errors

FOLDER = "trash"


@dataclass(frozen=True, slots=True)
class TrashedRun:
    """A run in the trash.

    Parameters
    ----------
    name : str
        Name of its file in the trash without suffix: the run's id, with a number appended if that name was taken.
    size : int
        Bytes.
    """

    name: str
    size: int


def move_to_trash(run: Path) -> Path:
    """Move a run's file and its annotations to the trash beside it; return the new path.

    Raises NotFoundError if the file is gone, StorageError if it cannot be moved.
    """
    folder = run.parent / FOLDER
    with storage_errors(run, f"cannot be moved to {folder}"):
        folder.mkdir(exist_ok=True)
        target = _reserved_path(folder, run)
        try:
            replace_with_retry(run, target)
        except OSError as error:
            target.unlink()
            if isinstance(error, FileNotFoundError):
                raise NotFoundError(f"run {run.stem!r}: its file is gone") from error
            raise
        _move_annotations(run, target)
    return target


def list_trash(data_folder: Path, suffix: str) -> Iterator[TrashedRun]:
    """Yield the files with this suffix in the trash, sorted by name; StorageError if the trash cannot be read."""
    with storage_errors(data_folder / FOLDER, "cannot be read"):
        for path in sorted((data_folder / FOLDER).glob(f"*{suffix}")):
            if path.is_file():
                yield TrashedRun(path.stem, path.stat().st_size)


def restore(data_folder: Path, name: str, target: Path) -> None:
    """Move a run from the trash back into the data folder, never over another file.

    Parameters
    ----------
    data_folder : Path
        The data folder.
    name : str
        Name in the trash, as in `TrashedRun`.
    target : Path
        New path of the run.

    Raises
    ------
    NotFoundError
        If the trash has no run of this name.
    RunExistsError, StorageError
        If there is a file at the target, or the run cannot be moved.
    """
    file = data_folder / FOLDER / f"{name}{target.suffix}"
    if name not in {run.name for run in list_trash(data_folder, target.suffix)}:
        raise NotFoundError(f"{name[:120]!r}: no run of this name in {file.parent}")
    move_without_overwriting(file, target)
    with storage_errors(target, f"its annotations stay in {file.parent}"):
        _move_annotations(file, target)


def _reserved_path(folder: Path, run: Path) -> Path:
    """Return the path of a new, empty file in the trash; creating it reserves the name among processes."""
    for number in count(1):
        path = folder / (run.name if number == 1 else f"{run.stem} ({number}){run.suffix}")
        with suppress(FileExistsError):
            path.open("xb").close()
            return path
    raise AssertionError("unreachable")


def _move_annotations(run: Path, target: Path) -> None:
    annotations = annotations_path(run)
    if annotations.exists():
        annotations.replace(annotations_path(target))
