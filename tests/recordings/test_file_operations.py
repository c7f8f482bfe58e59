"""Atomic writes: a file is complete or absent."""

from pathlib import Path
from typing import Self

import pytest

from recordings.file_operations import atomic_write, free_bytes, replace_with_retry


def test_temporary_file_replaces_the_file_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text("before")
    with atomic_write(path) as temporary:
        temporary.write_text("after")
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, SystemExit, OSError])
def test_interrupted_write_leaves_no_file(interruption: type[BaseException], tmp_path: Path) -> None:
    def write() -> None:
        with atomic_write(tmp_path / "report.html") as temporary:
            temporary.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        write()
    assert not list(tmp_path.iterdir())


class FileInUse(type(Path())):  # type: ignore[misc]
    """A file that is in use during the first attempts, on a system that does not replace files in use."""

    attempts: int
    moved: list[Path]

    @classmethod
    def after(cls, attempts: int) -> Self:
        file = cls("temporary")
        file.attempts, file.moved = attempts, []
        return file

    def replace(self, target: Path) -> None:
        if self.attempts:
            self.attempts -= 1
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        self.moved.append(target)


def test_file_in_use_is_replaced_once_it_is_closed(tmp_path: Path) -> None:
    file = FileInUse.after(2)
    replace_with_retry(file, tmp_path / "map.npz")
    assert file.moved == [tmp_path / "map.npz"]


def test_file_that_stays_in_use_is_an_error(tmp_path: Path) -> None:
    file = FileInUse.after(100)
    with pytest.raises(PermissionError, match="used by another process"):
        replace_with_retry(file, tmp_path / "map.npz")
    assert file.moved == []


def test_free_space_is_known_before_the_folder_exists(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "a" / "b") > 0
