"""Asking the service of a run that goes on in another terminal."""

import argparse
import json
import urllib.error
import urllib.request
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from daq.errors import UsageError

DEADLINE = 5.0  # s for the answer


def order(chosen: argparse.Namespace, path: str, content: Mapping[str, str]) -> dict[str, Any]:
    """Send an order and return the service's answer.

    Parameters
    ----------
    chosen : argparse.Namespace
        The command's options: host, port, token.
    path : str
        Under /api/v1/live.
    content : mapping of str to str
        What is sent.

    Raises
    ------
    UsageError
        There is no service there, or it says no.
    """
    where = f"http://{chosen.host}:{chosen.port}"
    headers = {"Content-Type": "application/json"}
    if chosen.token:
        headers["Authorization"] = f"Bearer {chosen.token}"
    address, body = f"{where}/api/v1/live/{path}", json.dumps(content).encode()
    request = urllib.request.Request(address, body, headers, method="POST")  # noqa: S310 - http
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the bench is no matter for a proxy
    try:
        with opener.open(request, timeout=DEADLINE) as answer:
            made: dict[str, Any] = json.load(answer)
            return made
    except urllib.error.HTTPError as error:
        raise UsageError(f"{where}: {_problem(error)}") from error
    except (OSError, ValueError) as error:
        why = error.reason if isinstance(error, urllib.error.URLError) else error
        raise UsageError(f"{where} does not answer ({why}): is rig record running there, with its page?") from error


def _problem(error: urllib.error.HTTPError) -> str:
    """Return what a service says is wrong."""
    try:
        return str(json.load(error)["detail"])
    except (OSError, ValueError, KeyError, TypeError):
        return f"HTTP {error.code} {HTTPStatus(error.code).phrase}"
