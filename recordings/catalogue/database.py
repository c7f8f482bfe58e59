"""The catalogue's database: SQLite in the data folder, or whatever an address names."""

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any

from sqlalchemy import Connection, Engine, Table, create_engine, event, make_url, select, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from recordings.catalogue.tables import METADATA, SCHEMA, VERSION
from recordings.errors import StorageError

CATALOGUE_VARIABLE = "RIG_CATALOGUE"
FOLDER = ".rig"
FILE = "catalogue.sqlite"
PATIENCE = 30.0
"""Seconds to wait for another process that writes."""
CONNECTING = 5
"""Seconds to wait for a server that does not answer; PostgreSQL's own library knows whole ones, 2 or more."""
WRITERS_LOCK = 0x72696721
"""Number of the lock by which writers on PostgreSQL take turns."""


class Database:
    """The tables of a catalogue, made where they are missing; it may be used by several threads and processes.

    Nothing in it is the truth: that is in the data folder. The folder's own database is thrown away where it is
    spoilt or of another version, and where it cannot be written at all a temporary one serves this process.

    Parameters
    ----------
    folder : Path
        The data folder.
    url : str
        An address as SQLAlchemy takes it; empty for the environment's RIG_CATALOGUE, or else SQLite in the folder.
    patience : float
        How long SQLite waits for another process that writes, s.
    """

    def __init__(self, folder: Path, url: str = "", patience: float = PATIENCE) -> None:
        self._url = url or os.environ.get(CATALOGUE_VARIABLE, "")
        self._file = folder / FOLDER / FILE
        self._patience = patience
        self._lock = Lock()
        self._engine: Engine | None = None

    @property
    def name(self) -> str:
        """What to call it, without a password."""
        if not self._url:
            return str(self._file)
        with suppress(ArgumentError):
            return make_url(self._url).render_as_string(hide_password=True)
        return "catalogue"

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Give a connection that sees one state of the tables; StorageError where there is none."""
        with self._translated(), self._ready().connect().execution_options(reads_only=True) as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Give a connection in a transaction; writers take turns, across processes too."""
        with self._translated(), self._ready().begin() as connection:
            _take_turn(connection, self._patience)
            yield connection

    def put(self, connection: Connection, table: Table, rows: list[dict[str, Any]]) -> None:
        """Insert rows, or put them in the place of those with the same key."""
        if not rows:
            return
        make = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
        statement = make(table)
        keys = [column.name for column in table.primary_key]
        values = {name: statement.excluded[name] for name in rows[0] if name not in keys}
        if values:
            statement = statement.on_conflict_do_update(index_elements=keys, set_=values)
        else:
            statement = statement.on_conflict_do_nothing(index_elements=keys)
        connection.execute(statement, rows)

    def _ready(self) -> Engine:
        with self._lock:
            if self._engine is None or self._has_gone(self._engine):
                self._engine = self._prepared()
            return self._engine

    def _has_gone(self, engine: Engine) -> bool:
        """Return whether somebody has thrown the folder's own database away."""
        return engine.url.database == str(self._file) and not self._file.exists()

    def _prepared(self) -> Engine:
        if self._url:
            return _with_tables(_engine(self._url, self._patience), self._patience)
        for last in (False, True):
            try:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                return _with_tables(_engine(f"sqlite:///{self._file}", self._patience), self._patience)
            except OSError:
                break
            except OperationalError as error:
                if "locked" in str(error.orig):
                    raise
                break  # it cannot be written, or not even be opened
            except DatabaseError:
                if not last:
                    with suppress(OSError):  # spoilt: it can be built again
                        self._file.unlink()
        temporary = tempfile.mkdtemp(prefix="rig-catalogue-")
        weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)
        return _with_tables(_engine(f"sqlite:///{Path(temporary) / FILE}", self._patience), self._patience)

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, ImportError, UnicodeError) as error:
            with self._lock:
                self._engine = None  # the tables are looked for anew: the server may be another by then
            reason = str(getattr(error, "orig", None) or error).strip().splitlines()
            raise StorageError(f"catalogue {self.name}: {reason[0] if reason else type(error).__name__}") from error


def _engine(url: str, patience: float) -> Engine:
    """Return an engine; a connection lives as long as it is used, so that processes may fork and files be moved."""
    address = make_url(url)
    is_sqlite = address.get_backend_name() == "sqlite"
    waits: dict[str, float] = {"timeout": patience} if is_sqlite else {}
    if address.get_driver_name().startswith("psycopg") and "connect_timeout" not in address.query:
        waits["connect_timeout"] = CONNECTING
    engine = create_engine(url, poolclass=NullPool, connect_args=waits)
    if is_sqlite:
        event.listen(engine, "connect", _leave_transactions_to_us)
        event.listen(engine, "begin", _begin)
    return engine


def _leave_transactions_to_us(connection: Any, _record: object) -> None:
    """Keep sqlite3 from beginning transactions by its own rules, and let rows go with the run they belong to."""
    connection.isolation_level = None
    connection.execute("PRAGMA foreign_keys = ON")


def _begin(connection: Connection) -> None:
    """Begin a transaction: a writer's at once as such, for one that began as a reader's cannot wait for its turn."""
    is_reader = connection.get_execution_options().get("reads_only", False)
    connection.exec_driver_sql("BEGIN" if is_reader else "BEGIN IMMEDIATE")


def _take_turn(connection: Connection, patience: float) -> None:
    """Wait until no other writer is at work, as long as one may; on SQLite the transaction has waited already."""
    if connection.dialect.name == "postgresql":
        longest = f"{round(patience * 1000)}ms"
        connection.execute(text("SELECT set_config('lock_timeout', :longest, true)"), {"longest": longest})
        connection.execute(text("SELECT pg_advisory_xact_lock(:number)"), {"number": WRITERS_LOCK})


def _with_tables(engine: Engine, patience: float) -> Engine:
    """Make the tables where they are missing, and make them anew where they are of another version."""
    with engine.begin() as connection:
        _take_turn(connection, patience)
        SCHEMA.create(connection, checkfirst=True)
        versions: Mapping[Any, Any] = {version: True for (version,) in connection.execute(select(SCHEMA.c.version))}
        if VERSION not in versions:
            METADATA.drop_all(connection)
            METADATA.create_all(connection)
            connection.execute(SCHEMA.insert(), [{"version": VERSION}])
    return engine
