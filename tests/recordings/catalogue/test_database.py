"""The catalogue's database can be damaged, deleted, locked or full; runs are listed all the same."""

import shutil
import socket
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from uuid import uuid4

import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.catalogue.catalogue import Catalogue
from recordings.catalogue.database import VERSION, Database
from recordings.catalogue.entry import Annotations, store_annotations
from recordings.errors import StorageError
from recordings.mcap.writer import RunWriter
from tests.recordings.postgresql import free_port, new_schema, server


def test_folder_that_cannot_be_written_gets_a_temporary_database(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    writer.close()
    (tmp_path / ".rig").write_text("a file instead of a folder")
    catalogue = Catalogue(tmp_path)
    assert [entry.id for entry in catalogue.runs()] == ["run"]
    catalogue.store_cached("run", "summary", {"a": 1})
    assert catalogue.load_cached("run", "summary") == {"a": 1}
    assert Catalogue(tmp_path).load_cached("run", "summary") is None


def test_locked_database_is_not_deleted(tmp_path: Path) -> None:
    with Database(tmp_path).reading():
        pass
    file = tmp_path / ".rig" / "catalogue.sqlite"
    before = file.stat().st_ino
    with closing(sqlite3.connect(file, isolation_level=None)) as holder:
        holder.execute("BEGIN IMMEDIATE")
        with (
            pytest.raises(StorageError, match=r"catalogue\.sqlite: database is locked"),
            Database(tmp_path, lock_timeout=0.1).writing(),
        ):
            pass
    assert file.stat().st_ino == before
    with Database(tmp_path).reading():
        pass


def test_damaged_database_is_created_again(tmp_path: Path) -> None:
    (tmp_path / ".rig").mkdir()
    (tmp_path / ".rig" / "catalogue.sqlite").write_bytes(b"SQLite format 3\0" + bytes(range(256)) * 40)
    with Database(tmp_path).reading() as connection:
        assert connection.dialect.name == "sqlite"
    with closing(sqlite3.connect(tmp_path / ".rig" / "catalogue.sqlite")) as read:
        assert read.execute("SELECT version FROM rig_schema").fetchall() == [(VERSION,)]


def test_connection_to_a_silent_server_times_out() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"postgresql+psycopg://rig@127.0.0.1:{silent.getsockname()[1]}/runs?connect_timeout=2"
        with pytest.raises(StorageError, match="timeout"), Database(Path(), address).reading():
            pass


def test_writer_on_a_server_waits_until_the_lock_timeout(postgresql: str, tmp_path: Path) -> None:
    address = new_schema(postgresql, f"test_{uuid4().hex}")
    with Database(tmp_path, address).writing(), pytest.raises(StorageError, match="lock timeout"):  # noqa: SIM117
        with Database(tmp_path, address, lock_timeout=0.2).writing():
            pass
    with Database(tmp_path, address, lock_timeout=0.2).writing():
        pass


@pytest.mark.campaign
def test_catalogue_continues_when_its_server_returns(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    writer.close()
    port = free_port()
    catalogue = Catalogue(tmp_path, f"postgresql+psycopg://rig@127.0.0.1:{port}/postgres")
    with server(port):
        assert [entry.id for entry in catalogue.runs()] == ["run"]
        catalogue.annotate("run", remark="cold oil")
    with pytest.raises(StorageError, match="catalogue postgresql"):
        catalogue.runs()
    with server(port):  # a new, empty server: everything is read from the files
        assert [(entry.id, entry.remark) for entry in catalogue.runs()] == [("run", "cold oil")]


@pytest.mark.parametrize("deleted", [".rig", ".rig/catalogue.sqlite"])
def test_database_deleted_while_in_use_is_created_again(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock], deleted: str
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    writer.close()
    catalogue, other = Catalogue(tmp_path), Catalogue(tmp_path)
    assert [entry.id for entry in catalogue.runs()] == [entry.id for entry in other.runs()] == ["run"]
    path = tmp_path / deleted
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    for each in (catalogue, other):
        assert [entry.id for entry in each.runs()] == ["run"]
    assert path.exists()


def test_runs_are_listed_and_trashed_though_the_database_is_full(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock]
) -> None:
    catalogue = Catalogue(tmp_path)
    for name in ("first", "second"):
        writer = RunWriter(tmp_path / f"{name}.mcap", header)
        writer.write_block(make_block(0, 0, 2000))
        writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))
        writer.close()
        assert name in {entry.id for entry in catalogue.runs()}
        with closing(sqlite3.connect(tmp_path / ".rig" / "catalogue.sqlite")) as full:
            for number, change in enumerate(("INSERT", "UPDATE", "DELETE")):
                when = f"BEFORE {change} ON rig_run BEGIN SELECT RAISE(ABORT, 'disk is full'); END"
                full.execute(f"CREATE TRIGGER IF NOT EXISTS full_{number} {when}")
            full.commit()
    store_annotations(tmp_path / "first.mcap", Annotations("cold oil", ("good",)))
    for each in (catalogue, Catalogue(tmp_path)):
        found = {entry.id: (entry.remark, entry.tags, entry.is_complete) for entry in each.runs()}
        assert found == {"first": ("cold oil", ("good",), True), "second": ("", (), True)}
        assert each.run("second").id == "second"
    assert catalogue.move_to_trash("first").exists()
    assert [entry.id for entry in catalogue.runs()] == ["second"]
