"""Errors of a command: messages of our own error trees with their exit codes; tracebacks of all others."""

import argparse
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from analysis.signals.errors import AnalysisError
from daq.cli import runs
from daq.cli.main import main
from daq.cli.terminal import TerminalOutput
from daq.errors import DeviceError, DeviceFault, RigError, ServiceError, StoppedError, UsageError
from model.errors import ModelError, ParameterError
from recordings.errors import NotFoundError

PROGRAM = """\
import sys
import daq.cli.runs

def fail(args, console):
    console.progress("working", 0.5)
    raise ValueError("of our own making")

daq.cli.runs.run_runs = fail
from daq.cli.main import main
sys.exit(main(["runs"]))
"""


@pytest.fixture
def failing_command(request: pytest.FixtureRequest) -> Iterator[Exception]:
    """Return the error that `rig runs` raises."""
    before, error = runs.run_runs, request.param

    def fail(_args: argparse.Namespace, _console: TerminalOutput) -> int:
        raise error

    runs.run_runs = fail  # type: ignore[assignment]  # only the name of a parameter differs
    yield error
    runs.run_runs = before


def test_unexpected_exception_exits_with_1_and_a_traceback() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Traceback (most recent call last)" in done.stderr
    assert done.stderr.splitlines()[-1] == "ValueError: of our own making"
    assert "rig: " not in done.stderr


@pytest.mark.parametrize("failing_command", [ValueError("x"), KeyError("x"), PermissionError(13, "x")], indirect=True)
def test_unexpected_exception_becomes_no_message(failing_command: Exception) -> None:
    with pytest.raises(type(failing_command)) as caught:
        main(["runs"])
    assert caught.value is failing_command


@pytest.mark.parametrize(
    ("failing_command", "expected_code"),
    [
        (RigError("text"), 1),
        (UsageError("text"), 2),
        (ServiceError("text"), 2),
        (DeviceError(DeviceFault.BUSY, "text"), 3),
        (StoppedError("text"), 130),
        (NotFoundError("text"), 2),
        (ParameterError("text"), 2),
        (ModelError("text"), 1),
        (AnalysisError("text"), 1),
    ],
    indirect=["failing_command"],
)
def test_error_of_our_own_is_one_message(
    failing_command: Exception, expected_code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["runs"]) == expected_code
    assert capsys.readouterr().err == f"rig: {failing_command}\n"


@pytest.fixture(params=[b"SSH-2.0-OpenSSH_9.2\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{\xff", b""])
def other_server(request: pytest.FixtureRequest) -> Iterator[int]:
    """Return the port of a server that answers something else than the service."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(request.param)

        threading.Thread(target=answer, daemon=True).start()
        yield server.getsockname()[1]


def test_marker_sent_to_another_server_is_one_message(other_server: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mark", "knocking", "--port", str(other_server)]) == 2
    stderr = capsys.readouterr().err
    assert stderr.startswith(f"rig: http://127.0.0.1:{other_server} does not respond (")
    assert len(stderr.splitlines()) == 1
