"""A PostgreSQL server for tests: on loopback, at a free port, in a temporary folder."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

SYSTEM_USER = "postgres"  # what Debian's package makes; the server refuses to run as root
TIMEOUT = 60.0


def programs() -> Path | None:
    """Return the folder of the server's programs; None if it is not installed."""
    for folder in sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True):
        if (folder / "initdb").exists() and (folder / "postgres").exists():
            return folder
    found = shutil.which("initdb")
    return Path(found).parent if found and shutil.which("postgres", path=str(Path(found).parent)) else None


@contextmanager
def server(port: int | None = None) -> Iterator[str]:
    """Run a server, by default at a free port; yield its address, to which a database name is appended."""
    folder = programs()
    if folder is None:
        reason = "PostgreSQL's server is not installed (Debian package postgresql)"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    home = Path(tempfile.mkdtemp(prefix="rig-postgresql-"))
    user = None
    if sys.platform != "win32" and os.geteuid() == 0:
        user = SYSTEM_USER
        shutil.chown(home, user)
    try:
        data = str(home / "data")
        subprocess.run(
            [folder / "initdb", "-D", data, "-U", "rig", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"],
            check=True, capture_output=True, user=user, cwd=home,
        )  # fmt: skip
        port = free_port() if port is None else port
        settings = {"listen_addresses": "127.0.0.1", "port": port, "unix_socket_directories": "", "fsync": "off"}
        options = [word for name, value in settings.items() for word in ("-c", f"{name}={value}")]
        with (
            (home / "log").open("wb") as log,
            subprocess.Popen(
                [folder / "postgres", "-D", data, *options], stdout=log, stderr=log, user=user, cwd=home
            ) as running,
        ):
            try:
                wait_for(port, running, home / "log")
                yield f"postgresql+psycopg://rig@127.0.0.1:{port}/"
            finally:
                running.send_signal(signal.SIGQUIT)  # immediate shutdown: the data are not needed any more
                running.wait(TIMEOUT)
    finally:
        shutil.rmtree(home, ignore_errors=True)


def wait_for(port: int, running: "subprocess.Popen[bytes]", log: Path) -> None:
    """Wait until the server answers."""
    import psycopg  # noqa: PLC0415  # only where there is a server

    deadline = time.monotonic() + TIMEOUT
    while True:
        try:
            psycopg.connect(host="127.0.0.1", port=port, user="rig", dbname="postgres", connect_timeout=2).close()
        except psycopg.OperationalError:
            if running.poll() is not None or time.monotonic() > deadline:
                pytest.fail(f"PostgreSQL does not start: {log.read_text()}")
            time.sleep(0.05)
        else:
            return


def new_schema(address: str, name: str) -> str:
    """Create an empty schema, which is faster than a database, and return the address of its tables."""
    import psycopg  # noqa: PLC0415  # only where there is a server

    with psycopg.connect(address.replace("+psycopg", "") + "postgres", autocommit=True) as connection:
        connection.execute(f"CREATE SCHEMA {name}".encode())
    return f"{address}postgres?options=-csearch_path%3D{name}"


def free_port() -> int:
    """Return an unused loopback port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
