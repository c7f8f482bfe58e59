"""A running service over fake data, a client for it, and a checker of JSON against OpenAPI schemas."""

import http.client
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from daq.reports.run_summaries import Summaries
from daq.service.app import create_app
from daq.service.jobs.queue import JobQueue
from daq.service.results_reader import ResultsReader
from daq.service.server import ServiceServer
from daq.service.state import ServiceState
from daq.session.live_update import LiveUpdate
from daq.session.predictor import Predictors
from recordings.catalogue.catalogue import Catalogue
from tests.daq.support.service_fakes import FakeCatalogue, FakeLive, FakeSummaries, make_entries

API = "/api/v1"


@dataclass
class Bench:
    """A service on loopback with its fakes and a client."""

    catalogue: FakeCatalogue
    live: FakeLive
    summaries: FakeSummaries
    server: ServiceServer
    client: httpx.Client
    folder: tempfile.TemporaryDirectory[str]

    def get(self, path: str, **parameters: str | int) -> httpx.Response:
        """Send a GET request for a path below /api/v1."""
        return self.client.get(API + path, params=parameters)

    def raw(self, target: str, headers: Mapping[str, str] | None = None) -> tuple[int, dict[str, str], bytes]:
        """Send a GET request for an unnormalised target; return status, headers and content."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=60)
        try:
            connection.request("GET", target, headers=dict(headers or {}))
            answer = connection.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def reset(self) -> None:
        """Reset the fakes to their initial state."""
        self.catalogue.trouble = self.summaries.trouble = self.live.update = None
        self.summaries.gate.set()

    def close(self) -> None:
        """Close client and server."""
        self.client.close()
        self.server.close()
        self.folder.cleanup()


def service_state(catalogue: Catalogue, live: FakeLive, summaries: Summaries) -> ServiceState:
    """Return the state of a service whose worker processes are never started."""
    return ServiceState(catalogue, live, summaries, ResultsReader(Predictors()), JobQueue(Catalogue(catalogue.folder)))


def fake_state(folder: Path, update: LiveUpdate | None = None) -> ServiceState:
    """Return the state of a service with four runs and a live run, by default none."""
    catalogue, live = FakeCatalogue(make_entries(), folder), FakeLive()
    live.update = update
    return service_state(catalogue, live, FakeSummaries(catalogue))


def open_bench(viewer_url: str = "", *, host: str = "127.0.0.1", token: str | None = None) -> Bench:
    """Start a service with four runs and no live run at a free local port, as if bound to ``host``."""
    folder = tempfile.TemporaryDirectory()
    catalogue, live = FakeCatalogue(make_entries(), Path(folder.name)), FakeLive()
    summaries = FakeSummaries(catalogue)
    state = service_state(catalogue, live, summaries)
    server = ServiceServer(create_app(state, viewer_url, host=host, token=token), closing=state.closing)
    server.start()
    return Bench(catalogue, live, summaries, server, httpx.Client(base_url=server.url, timeout=60.0), folder)


def schema_errors(value: object, schema: Mapping[str, Any], schemas: Mapping[str, Any], at: str = "$") -> list[str]:
    """Return the mismatches of a JSON value with an OpenAPI schema; covers the keywords that the service uses."""
    if "$ref" in schema:
        return schema_errors(value, schemas[schema["$ref"].rpartition("/")[2]], schemas, at)
    if "anyOf" in schema:
        found = [schema_errors(value, option, schemas, at) for option in schema["anyOf"]]
        return [] if any(not one for one in found) else min(found, key=len)
    kinds: dict[str, tuple[type, ...]] = {
        "object": (dict,), "array": (list,), "string": (str,), "boolean": (bool,), "null": (type(None),),
        "integer": (int,), "number": (int, float),
    }  # fmt: skip
    kind = schema.get("type")
    if kind in kinds and (not isinstance(value, kinds[kind]) or (isinstance(value, bool) and kind != "boolean")):
        return [f"{at}: {value!r} is no {kind}"]
    if "enum" in schema and value not in schema["enum"]:
        return [f"{at}: {value!r} is none of {schema['enum']}"]
    if "minimum" in schema and isinstance(value, int | float) and value < schema["minimum"]:
        return [f"{at}: {value!r} is below {schema['minimum']}"]
    if isinstance(value, list) and "items" in schema:
        return [
            fault
            for k, item in enumerate(value)
            for fault in schema_errors(item, schema["items"], schemas, f"{at}[{k}]")
        ]
    return _object_schema_errors(value, schema, schemas, at) if isinstance(value, dict) else []


def _object_schema_errors(
    value: dict[str, object], schema: Mapping[str, Any], schemas: Mapping[str, Any], at: str
) -> list[str]:
    fields = schema.get("properties", {})
    others = schema.get("additionalProperties", True)
    found = [f"{at}.{name} is missing" for name in schema.get("required", []) if name not in value]
    for name, item in value.items():
        if name in fields:
            found += schema_errors(item, fields[name], schemas, f"{at}.{name}")
        elif others is False:
            found.append(f"{at}.{name} is not in the schema")
        elif isinstance(others, dict):
            found += schema_errors(item, others, schemas, f"{at}.{name}")
    return found
