"""A file that is written aside is there whole or not at all."""

from pathlib import Path

import pytest

from recordings.atomic_file import atomic_write, replace_with_retry


def test_draft_takes_the_place_of_the_file_at_the_end(tmp_path: Path) -> None:
    place = tmp_path / "report.html"
    place.write_text("before")
    with atomic_write(place) as temporary:
        temporary.write_text("after")
        assert place.read_text() == "before"
    assert place.read_text() == "after"
    assert list(tmp_path.iterdir()) == [place]


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, SystemExit, OSError])
def test_nothing_is_left_of_a_draft_that_is_interrupted(interruption: type[BaseException], tmp_path: Path) -> None:
    def write() -> None:
        with atomic_write(tmp_path / "report.html") as temporary:
            temporary.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        write()
    assert not list(tmp_path.iterdir())


class Held:
    """A file that somebody reads for a few attempts, on a system that then moves nothing over it."""

    def __init__(self, attempts: int) -> None:
        self.attempts = attempts
        self.moved: list[Path] = []

    def replace(self, target: Path) -> None:
        if self.attempts:
            self.attempts -= 1
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        self.moved.append(target)


def test_file_that_is_being_read_is_replaced_as_soon_as_it_is_let_go(tmp_path: Path) -> None:
    held = Held(2)
    replace_with_retry(held, tmp_path / "map.npz")
    assert held.moved == [tmp_path / "map.npz"]


def test_file_that_is_read_on_and_on_is_told_of(tmp_path: Path) -> None:
    held = Held(100)
    with pytest.raises(PermissionError, match="used by another process"):
        replace_with_retry(held, tmp_path / "map.npz")
    assert held.moved == []
