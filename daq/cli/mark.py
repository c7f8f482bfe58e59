"""`rig mark`: name the present moment of the run that is being recorded, from another terminal or a script."""

import argparse
import json
import urllib.error
import urllib.request
from http import HTTPStatus

from daq.errors import UsageError

DEADLINE = 5.0  # s for the answer


def run(chosen: argparse.Namespace) -> int:
    """Ask the recording's service to keep a word; return the exit code."""
    where = f"http://{chosen.host}:{chosen.port}"
    body = json.dumps({"text": " ".join(chosen.word) or "mark"}).encode()
    headers = {"Content-Type": "application/json"}
    if chosen.token:
        headers["Authorization"] = f"Bearer {chosen.token}"
    request = urllib.request.Request(f"{where}/api/v1/live/marks", body, headers, method="POST")  # noqa: S310 - http
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the bench is no matter for a proxy
    try:
        with opener.open(request, timeout=DEADLINE) as answer:
            made = json.load(answer)
    except urllib.error.HTTPError as error:
        raise UsageError(f"{where}: {_problem(error)}") from error
    except (OSError, ValueError) as error:
        why = error.reason if isinstance(error, urllib.error.URLError) else error
        raise UsageError(f"{where} does not answer ({why}): is rig record running there, with its page?") from error
    if chosen.json:
        print(json.dumps(made, ensure_ascii=False, indent=2))
        return 0
    print(f"marked “{made['text']}” at {made['time_s']:.1f} s of segment {made['segment']}")
    return 0


def _problem(error: urllib.error.HTTPError) -> str:
    """Return what a service says is wrong."""
    try:
        return str(json.load(error)["detail"])
    except (OSError, ValueError, KeyError, TypeError):
        return f"HTTP {error.code} {HTTPStatus(error.code).phrase}"
