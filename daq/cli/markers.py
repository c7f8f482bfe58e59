"""`rig mark` and `rig acknowledge`: requests to the REST service of a run that records in another terminal."""

import argparse
import json
import urllib.error
import urllib.request
from collections.abc import Mapping
from http.client import HTTPException
from typing import Any

from daq.cli.arguments import AddCommand, add_client_address, add_json
from daq.cli.terminal import TerminalOutput, print_json
from daq.errors import UsageError

RESPONSE_TIMEOUT = 5.0  # s
_NO_SERVICE = (OSError, HTTPException, json.JSONDecodeError, UnicodeDecodeError)
"""Errors of a request: no connection, or a response of a server that is not the service's: not HTTP, not JSON."""


def add_commands(add: AddCommand) -> None:
    """Add `rig mark` and `rig acknowledge` to the command line."""
    command = add("mark", run_mark, add_json, add_client_address, examples=["rig mark knocking begins"])
    command.add_argument("text", metavar="TEXT", nargs="*", help="text of the marker (default: marker)")
    add("acknowledge", run_acknowledge, add_json, add_client_address)


def post_to_live(args: argparse.Namespace, path: str, content: Mapping[str, str]) -> dict[str, Any]:
    """Send a POST request to the live run's service and return its response.

    Parameters
    ----------
    args : argparse.Namespace
        The command's options: host, port, token.
    path : str
        Under /api/v1/live.
    content : mapping of str to str
        JSON body.

    Raises
    ------
    UsageError
        No service responds there, or it refuses the request.
    """
    service = f"http://{args.host}:{args.port}"
    headers = {"Content-Type": "application/json"}
    if args.token:
        headers["Authorization"] = f"Bearer {args.token}"
    address, body = f"{service}/api/v1/live/{path}", json.dumps(content).encode()
    request = urllib.request.Request(address, body, headers, method="POST")  # noqa: S310 - http
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the service is local: use no proxy
    try:
        with opener.open(request, timeout=RESPONSE_TIMEOUT) as response:
            result: dict[str, Any] = json.load(response)
            return result
    except urllib.error.HTTPError as error:
        raise UsageError(f"{service}: {_problem_detail(error)}") from error
    except _NO_SERVICE as error:
        reason = str(error.reason if isinstance(error, urllib.error.URLError) else error).strip()
        raise UsageError(f"{service} does not respond ({reason}): is rig record running there, with REST?") from error


def _problem_detail(error: urllib.error.HTTPError) -> str:
    """Return the detail of a problem response (RFC 9457), or its status line."""
    try:
        problem = json.load(error)
    except _NO_SERVICE:
        problem = None
    if isinstance(problem, dict) and "detail" in problem:
        return str(problem["detail"])
    return f"HTTP {error.code} {error.reason}"  # another server answers there


def run_acknowledge(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Acknowledge the alarms of the live run; return the exit code."""
    response = post_to_live(args, "acknowledge", {})
    if args.json:
        print_json(response)
        return 0
    for alarm in response["alarms"]:
        print(f"acknowledged {alarm['name']}: {alarm['message']}")
    if not response["alarms"]:
        print("no new alarm")
    return 0


def run_mark(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Add a marker to the run that is recording; return the exit code."""
    response = post_to_live(args, "markers", {"text": " ".join(args.text)})
    if args.json:
        print_json(response)
        return 0
    print(f"marked “{response['text']}” at {response['time_s']:.1f} s of segment {response['segment']}")
    return 0
