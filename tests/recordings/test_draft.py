"""A file that is written aside is there whole or not at all."""

from pathlib import Path

import pytest

from recordings.draft import draft_of


def test_draft_takes_the_place_of_the_file_at_the_end(tmp_path: Path) -> None:
    place = tmp_path / "report.html"
    place.write_text("before")
    with draft_of(place) as draft:
        draft.write_text("after")
        assert place.read_text() == "before"
    assert place.read_text() == "after"
    assert list(tmp_path.iterdir()) == [place]


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, SystemExit, OSError])
def test_nothing_is_left_of_a_draft_that_is_interrupted(interruption: type[BaseException], tmp_path: Path) -> None:
    def write() -> None:
        with draft_of(tmp_path / "report.html") as draft:
            draft.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        write()
    assert not list(tmp_path.iterdir())
