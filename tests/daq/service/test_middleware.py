"""Middleware: host names, bearer token, other sites, and security headers."""

import http.client
from collections.abc import Iterator
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from daq.errors import ServiceError
from daq.reports.run_summaries import Summaries
from daq.schemas.summary import SummarySchema
from daq.service.app import create_app
from daq.service.middleware import PUBLIC_PAGES, host_without_port, is_loopback
from daq.service.problems import ProblemSchema
from daq.service.server import ServiceServer
from daq.session.predictor import Predictors
from recordings.catalogue.catalogue import Catalogue
from tests.daq.support.service_bench import API, Bench, fake_state, open_bench, service_state
from tests.daq.support.service_fakes import FakeLive

WORD = "correct-horse"
EVERYWHERE = str(IPv4Address(0))


@pytest.fixture(scope="module")
def loopback_bench() -> Iterator[Bench]:
    bench = open_bench()
    yield bench
    bench.close()


@pytest.fixture(scope="module")
def public_bench() -> Iterator[Bench]:
    bench = open_bench(host=EVERYWHERE, token=WORD)
    yield bench
    bench.close()


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]", "LOCALHOST"])
@pytest.mark.parametrize("port", ["", ":8080"])
def test_loopback_service_accepts_loopback_host_names(loopback_bench: Bench, name: str, port: str) -> None:
    assert loopback_bench.raw(f"{API}/runs", {"Host": name + port})[0] == 200


@pytest.mark.parametrize(
    "name",
    [
        "evil.example",
        "127.0.0.1.evil.example",
        "localhost.evil.example:8080",
        "evil.example:127.0.0.1",
        "[::1",
        "[::2]",
        "",
    ],
)
@pytest.mark.parametrize("path", [f"{API}/live", "/", "/openapi.json"])
def test_loopback_service_rejects_other_host_names(loopback_bench: Bench, name: str, path: str) -> None:
    status, headers, content = loopback_bench.raw(path, {"Host": name})
    assert status == 421
    assert headers["content-type"] == "application/problem+json"
    assert ProblemSchema.model_validate_json(content).type == "/docs#host-not-allowed"


@pytest.mark.parametrize("scheme", ["Bearer", "bearer", "BEARER "])
def test_public_service_accepts_any_host_name_with_the_token(public_bench: Bench, scheme: str) -> None:
    headers = {"Host": "bench.lab.example:8000", "Authorization": f"{scheme} {WORD}"}
    assert public_bench.raw(f"{API}/runs", headers)[0] == 200


@pytest.mark.parametrize(
    "authorization",
    [None, "", "Bearer", "Bearer ", f"Bearer {WORD}x", f"Bearer {WORD[:-1]}", WORD, f"Basic {WORD}", "Bearer é"],
)
@pytest.mark.parametrize("path", ["/runs", "/live", "/health", "/nothing", "/runs/x/summary"])
def test_request_without_the_token_is_rejected(public_bench: Bench, authorization: str | None, path: str) -> None:
    headers = {} if authorization is None else {"Authorization": authorization}
    status, answered, content = public_bench.raw(API + path, headers)
    assert status == 401
    assert answered["www-authenticate"].startswith("Bearer")
    assert ProblemSchema.model_validate_json(content).type == "/docs#token-required"
    assert WORD.encode() not in content


@pytest.mark.parametrize(
    "target",
    [
        "//api/v1/runs",
        "/API/v1/runs",
        "/api/v1/../../console/page.css",
        "/console",
        "/%61pi/v1/runs",
        "/docs/",
        f"/api/v1/runs?token={WORD}",
        f"/api/v1/runs?access_token={WORD}",
        f"/api/v1/live/socket?token={WORD}",
    ],
)
def test_no_spelling_of_a_path_bypasses_the_token(public_bench: Bench, target: str) -> None:
    assert public_bench.raw(target)[0] == 401


@pytest.mark.parametrize("tail", ["../api/v1/runs", "..%2fapi%2fv1%2fruns", "%2e%2e/service/app.py", "%2fetc%2fpasswd"])
def test_no_spelling_leads_out_of_the_folder_of_the_page(public_bench: Bench, tail: str) -> None:
    assert public_bench.raw(f"/console/{tail}")[0] == 404


@pytest.mark.parametrize("path", [*sorted(PUBLIC_PAGES), "/console/page.js"])
def test_page_needs_no_token_and_contains_no_data(public_bench: Bench, path: str) -> None:
    status, _, content = public_bench.raw(path)
    assert status == 200
    assert WORD.encode() not in content


def test_openapi_schema_declares_the_token_if_required(loopback_bench: Bench, public_bench: Bench) -> None:
    needed, free = (bench.client.get("/openapi.json").json() for bench in (public_bench, loopback_bench))
    assert needed["security"] == [{"token": []}]
    assert needed["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    assert "401" in needed["paths"][f"{API}/runs"]["get"]["responses"]
    assert "security" not in free
    assert "401" not in free["paths"][f"{API}/runs"]["get"]["responses"]


@pytest.mark.parametrize("host", [EVERYWHERE, "", "192.168.1.7", "bench.lab.example", "::"])
def test_public_service_without_a_token_is_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(ServiceError, match="token"):
        create_app(fake_state(tmp_path), host=host)


@pytest.mark.parametrize("token", ["", " ", " x", "a\nb", "tökèn"])
def test_token_that_no_header_can_carry_is_refused(tmp_path: Path, token: str) -> None:
    with pytest.raises(ServiceError, match="printable"):
        create_app(fake_state(tmp_path), token=token)


def test_responses_have_security_headers(loopback_bench: Bench) -> None:
    for path in (f"{API}/runs", f"{API}/live", "/openapi.json", f"{API}/none"):
        headers = loopback_bench.client.get(path).headers
        assert headers["content-security-policy"] == "default-src 'none'; frame-ancestors 'none'"
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"
        assert "access-control-allow-origin" not in headers
        assert "server" not in headers


@pytest.mark.parametrize("tail", ["", "/summary"])
@pytest.mark.parametrize(
    "run_id", ["..%2fsecret", "%2e%2e%2fsecret", "..%5csecret", "../secret", "data/../../secret", "%2e%2e", "."]
)
def test_no_run_id_leads_out_of_the_data_folder(tmp_path: Path, run_id: str, tail: str) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (tmp_path / "secret.mcap").write_bytes(b"secret")
    catalogue = Catalogue(folder)

    class FromFile(Summaries):
        def summary(self, run_id: str) -> SummarySchema:
            raise AssertionError(catalogue.path(run_id).read_bytes())

    server = ServiceServer(create_app(service_state(catalogue, FakeLive(), FromFile(catalogue, Predictors()))))
    server.start()
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    connection.request("GET", f"{API}/runs/{run_id}{tail}")
    answer = connection.getresponse()
    assert answer.status == 404
    assert b"secret.mcap" not in answer.read()
    connection.close()
    server.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.1.1", "localhost", "Localhost", "::1", "[::1]"])
def test_loopback_addresses_are_recognised(host: str) -> None:
    assert is_loopback(host)


@pytest.mark.parametrize("host", [EVERYWHERE, "10.0.0.1", "::", "127.evil.example", "127", ""])
def test_public_addresses_are_not_taken_for_loopback(host: str) -> None:
    assert not is_loopback(host)


@pytest.mark.parametrize(
    ("header", "name"),
    [("LocalHost:80", "localhost"), ("[::1]:80", "[::1]"), ("[::1", ""), ("", ""), ("10.0.0.1", "10.0.0.1")],
)
def test_host_header_is_read_without_its_port(header: str, name: str) -> None:
    assert host_without_port(header) == name
