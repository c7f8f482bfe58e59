"""The catalogue's database, SQLite in the data folder or the server that a URL names, and its tables."""

import os
import shutil
import tempfile
import weakref
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Connection,
    Engine,
    Float,
    ForeignKeyConstraint,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    create_engine,
    event,
    make_url,
    select,
    text,
)
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from analysis.signals.snapshot import LARGEST_OVERALL
from recordings.errors import StorageError
from recordings.integrity.verify import Verdict

ID_LENGTH = 128
FOLDER_LENGTH = 512

METADATA = MetaData()

SCHEMA = Table("rig_schema", METADATA, Column("version", Integer, primary_key=True))

REVISION = Table(  # incremented with every change of a folder's rows: cached entries hold as long as it stays
    "rig_revision",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("number", BigInteger, nullable=False),
)

SETUP = Table(
    "rig_setup",
    METADATA,
    Column("id", String(64), primary_key=True),  # SHA-256 of the JSON document
    Column("document", Text, nullable=False),  # header as JSON, without the keys of a single run
)

RUN = Table(
    "rig_run",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("id", String(ID_LENGTH), primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("modified_ns", BigInteger, nullable=False),
    Column("started_ns", BigInteger, nullable=False),
    Column("setup", String(64)),  # null if the file cannot be read
    Column("run", Text, nullable=False, default=""),  # the id in the header: a renamed copy has another file name
    Column("rig", Text, nullable=False, default=""),
    Column("note", Text, nullable=False, default=""),  # the operator's note, stored in the recording
    Column("serial", Text, nullable=False, default=""),
    Column("calibration", String(64), nullable=False, default=""),  # `calibration_identity`
    Column("duration_s", Float, nullable=False),
    Column("samples", BigInteger, nullable=False),
    Column("is_complete", Boolean, nullable=False),
    Column("is_gap_free", Boolean, nullable=False),
    Column("fault", Text, nullable=False),
    Column("remark", Text, nullable=False, default=""),  # added after recording
    Column("annotations_modified_ns", BigInteger, nullable=False, default=0),
    Column("verdict", String(16), nullable=False, default=""),  # empty if not verified
    Column("is_summarised", Boolean, nullable=False, default=False),
    Column("lowest_speed_rpm", Float),
    Column("highest_speed_rpm", Float),
    *(Column(measure.full_name, Float) for measure in LARGEST_OVERALL.rows),
    Column("severity", String(16)),
)


def _run_table(table: str, *columns: Column[object]) -> Table:
    """Return a table whose rows belong to a run and are deleted with it."""
    return Table(
        table,
        METADATA,
        Column("folder", String(FOLDER_LENGTH), primary_key=True),
        Column("id", String(ID_LENGTH), primary_key=True),
        *columns,
        ForeignKeyConstraint(["folder", "id"], [RUN.c.folder, RUN.c.id], ondelete="CASCADE"),
    )


TAG = _run_table("rig_tag", Column[object]("tag", String(64), primary_key=True))

FINDING = _run_table(  # sub-synchronous components
    "rig_finding",
    Column[object]("number", Integer, primary_key=True),
    Column[object]("order", Float, nullable=False),
    Column[object]("is_forward", Boolean, nullable=False),
    Column[object]("onset_rpm", Float, nullable=False),
    Column[object]("end_rpm", Float, nullable=False),
    Column[object]("largest_peak_um", Float, nullable=False),
)

MARKER = _run_table(
    "rig_mark",
    Column[object]("number", Integer, primary_key=True),
    Column[object]("segment", Integer, nullable=False),
    Column[object]("sample", BigInteger, nullable=False),
    Column[object]("text", Text, nullable=False),
)

CACHED = Table(  # results computed from a run, valid for the file of this size and modification time
    "rig_document",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("id", String(ID_LENGTH), primary_key=True),
    Column("name", String(64), primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("modified_ns", BigInteger, nullable=False),
    Column("document", Text, nullable=False),
)

VERSION = zlib.crc32(repr([[(t.name, list(t.columns)) for t in METADATA.sorted_tables], list(Verdict)]).encode()) >> 1
"""Version of tables and verdicts, by definition; a catalogue of another version is built again from the files."""


CATALOGUE_VARIABLE = "RIG_CATALOGUE"
FOLDER = ".rig"
FILE = "catalogue.sqlite"
LOCK_TIMEOUT = 30.0  # s to wait for another writing process
CONNECT_TIMEOUT = 5  # s to wait for a server; libpq accepts whole seconds only, 2 or more
WRITER_LOCK = 0x72696721
"""Key of the PostgreSQL advisory lock that serialises writers."""


class Database:
    """Connections to the catalogue's tables, which are created if missing; safe for several threads and processes.

    The database is a cache of the data folder. A damaged SQLite file, or one of another table version, is deleted and
    created again. If the folder cannot be written, this process uses a temporary database.

    Parameters
    ----------
    folder : Path
        The data folder.
    url : str
        SQLAlchemy URL; empty for the environment's RIG_CATALOGUE, or else SQLite in the folder.
    lock_timeout : float
        Maximum wait for another writing process, s.
    """

    def __init__(self, folder: Path, url: str = "", lock_timeout: float = LOCK_TIMEOUT) -> None:
        self._url = url or os.environ.get(CATALOGUE_VARIABLE, "")
        self._file = folder / FOLDER / FILE
        self._lock_timeout = lock_timeout
        self._lock = Lock()
        self._engine: Engine | None = None

    @property
    def name(self) -> str:
        """Path or URL of the database, the password hidden."""
        if not self._url:
            return str(self._file)
        with suppress(ArgumentError):
            return make_url(self._url).render_as_string(hide_password=True)
        return "catalogue"

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Yield a connection with a consistent view of the tables; StorageError if the database fails."""
        with self._translated(), self._current_engine().connect().execution_options(reads_only=True) as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Yield a connection in a transaction; writers are serialised, across processes too. StorageError."""
        with self._translated(), self._current_engine().begin() as connection:
            _lock_writers(connection, self._lock_timeout)
            yield connection

    def _current_engine(self) -> Engine:
        with self._lock:
            engine = self._engine
            if engine is None or (engine.url.database == str(self._file) and not self._file.exists()):
                engine = self._engine = self._open()
            return engine

    def _open(self) -> Engine:
        if self._url:
            return _opened(self._url, self._lock_timeout)
        for is_last_attempt in (False, True):
            try:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                return _opened(f"sqlite:///{self._file}", self._lock_timeout)
            except OSError:
                break
            except OperationalError as error:
                if "locked" in str(error.orig):
                    raise
                break  # the file cannot be written, or not even opened
            except DatabaseError:
                if not is_last_attempt:
                    with suppress(OSError):  # damaged: create it again
                        self._file.unlink()
        temporary = tempfile.mkdtemp(prefix="rig-catalogue-")
        weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)
        return _opened(f"sqlite:///{Path(temporary) / FILE}", self._lock_timeout)

    @contextmanager
    def _translated(self) -> Iterator[None]:
        """Raise StorageError for the errors of SQLAlchemy and its drivers."""
        try:
            yield
        except (SQLAlchemyError, ImportError, UnicodeError) as error:
            with self._lock:
                self._engine = None  # check the tables again next time: the server may be another one by then
            reason = str(getattr(error, "orig", None) or error).strip().splitlines()
            raise StorageError(f"catalogue {self.name}: {reason[0] if reason else type(error).__name__}") from error


def _opened(url: str, lock_timeout: float) -> Engine:
    """Return an engine whose tables exist; without a connection pool, so that processes can fork and files be moved."""
    address = make_url(url)
    is_sqlite = address.get_backend_name() == "sqlite"
    arguments: dict[str, float] = {"timeout": lock_timeout} if is_sqlite else {}
    if address.get_driver_name().startswith("psycopg") and "connect_timeout" not in address.query:
        arguments["connect_timeout"] = CONNECT_TIMEOUT
    engine = create_engine(url, poolclass=NullPool, connect_args=arguments)
    if is_sqlite:
        event.listen(engine, "connect", _disable_implicit_transactions)
        event.listen(engine, "begin", _begin)
    with engine.begin() as connection:
        _lock_writers(connection, lock_timeout)
        SCHEMA.create(connection, checkfirst=True)
        if VERSION not in connection.execute(select(SCHEMA.c.version)).scalars().all():
            METADATA.drop_all(connection)  # missing, or of another version
            METADATA.create_all(connection)
            connection.execute(SCHEMA.insert(), [{"version": VERSION}])
    return engine


def _disable_implicit_transactions(connection: Any, _record: object) -> None:
    """Turn off sqlite3's own transaction handling, and turn on cascading deletes."""
    connection.isolation_level = None
    connection.execute("PRAGMA foreign_keys = ON")


def _begin(connection: Connection) -> None:
    """Begin a transaction; a writer takes the write lock at once, since SQLite cannot wait when upgrading a read."""
    is_reader = connection.get_execution_options().get("reads_only", False)
    connection.exec_driver_sql("BEGIN" if is_reader else "BEGIN IMMEDIATE")


def _lock_writers(connection: Connection, lock_timeout: float) -> None:
    """Wait until no other process writes; on SQLite BEGIN IMMEDIATE has waited already."""
    if connection.dialect.name == "postgresql":
        timeout = f"{round(lock_timeout * 1000)}ms"
        connection.execute(text("SELECT set_config('lock_timeout', :timeout, true)"), {"timeout": timeout})
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": WRITER_LOCK})
