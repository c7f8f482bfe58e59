"""The folder's own database is a convenience: a folder that cannot take it is no fault."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from analysis.run import RunHeader
from analysis.samples import SampleBlock
from recordings.catalogue import Catalogue
from recordings.database import Database
from recordings.errors import StorageError
from recordings.tables import VERSION
from recordings.writer import RunWriter


def test_a_folder_that_takes_no_catalogue_is_no_fault(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.block(make_block(0, 0, 2000))
    writer.close()
    (tmp_path / ".rig").write_text("a file in its place")
    catalogue = Catalogue(tmp_path)
    assert [entry.id for entry in catalogue.runs()] == ["run"]
    catalogue.store_document("run", "summary", {"a": 1})
    assert catalogue.load_document("run", "summary") == {"a": 1}
    assert Catalogue(tmp_path).load_document("run", "summary") is None


def test_a_catalogue_that_another_process_holds_is_left_alone(tmp_path: Path) -> None:
    with Database(tmp_path).reading():
        pass
    file = tmp_path / ".rig" / "catalogue.sqlite"
    before = file.stat().st_ino
    with closing(sqlite3.connect(file, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with (
            pytest.raises(StorageError, match=r"catalogue\.sqlite: database is locked"),
            Database(tmp_path, patience=0.1).writing(),
        ):
            pass
    assert file.stat().st_ino == before
    with Database(tmp_path).reading():
        pass


def test_a_spoilt_catalogue_is_made_anew(tmp_path: Path) -> None:
    (tmp_path / ".rig").mkdir()
    (tmp_path / ".rig" / "catalogue.sqlite").write_bytes(b"SQLite format 3\0" + bytes(range(256)) * 40)
    with Database(tmp_path).reading() as connection:
        assert connection.dialect.name == "sqlite"
    with closing(sqlite3.connect(tmp_path / ".rig" / "catalogue.sqlite")) as read:
        assert read.execute("SELECT version FROM rig_schema").fetchall() == [(VERSION,)]
