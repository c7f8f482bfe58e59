"""The static page and the REST reference: complete and without external resources."""

import html
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

from daq.reports.registry import KINDS
from daq.service.app import create_app
from daq.service.pages import CONSOLE
from daq.service.problems import ProblemType
from tests.daq.support.service_bench import Bench, fake_state, open_bench

ASSETS = sorted(f"console/{file.name}" for file in Path(CONSOLE).iterdir() if file.suffix in {".js", ".css", ".svg"})
VIEWER = "http://127.0.0.1:9090/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9876%2Fproxy&theme=dark"


class Links(HTMLParser):
    """Collects a page's references, ids, and inline scripts and styles."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.ids: list[str] = []
        self.inline: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in {"href", "src", "action"}:
                self.targets.append(value or "")
            if name == "id":
                self.ids.append(value or "")
            if name == "style" or name.startswith("on"):
                self.inline.append(f"{tag} {name}")
        if tag == "style" or (tag == "script" and "src" not in dict(attrs)):
            self.inline.append(tag)


def read(text: str) -> Links:
    links = Links()
    links.feed(text)
    return links


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    served = open_bench(VIEWER)
    yield served
    served.close()


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_page_refers_only_to_the_service_itself(bench: Bench, path: str) -> None:
    response = bench.client.get(path)
    assert response.headers["content-type"] == "text/html; charset=utf-8"
    links = read(response.text)
    assert links.targets
    assert links.inline == []
    for target in links.targets:
        if target.startswith("#"):
            assert target[1:] in links.ids
        else:
            assert target.startswith("/")
            assert bench.client.get(target).status_code == 200, target


@pytest.mark.parametrize("name", [*ASSETS, "", "docs"])
def test_page_files_contain_no_external_url(bench: Bench, name: str) -> None:
    text = bench.client.get(f"/{name}").text.replace(VIEWER.replace("&", "&amp;"), "")
    addresses = set(re.findall(r"(?:https?:)?//[A-Za-z0-9.\-]+\.[a-z]{2,}[^\s\"']*", text))
    assert addresses <= {"http://www.w3.org/2000/svg"}  # an XML namespace, never fetched


@pytest.mark.parametrize("name", ASSETS)
def test_page_files_have_their_media_type(bench: Bench, name: str) -> None:
    kinds = {"js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8", "svg": "image/svg+xml"}
    assert bench.client.get(f"/{name}").headers["content-type"] == kinds[name.rpartition(".")[2]]


def test_scripts_import_served_files_and_use_existing_elements(bench: Bench) -> None:
    ids = set(read(bench.client.get("/").text).ids)
    scripts = {name: bench.client.get(f"/{name}").text for name in ASSETS if name.endswith(".js")}
    for name, text in scripts.items():
        assert {f"console/{each}" for each in re.findall(r'from "\./([^"]+)"', text)} <= set(scripts), name
        named = set(re.findall(r'(?:element|getElementById|write|mark|banner|fill)\("([a-z0-9-]+)"', text))
        assert named <= ids, name


def test_page_has_a_button_for_every_analysis_kind(bench: Bench) -> None:
    kinds = re.findall(
        r'^  \["[^"]+", "([a-z-]+)", \{.*\}\],$', bench.client.get("/console/plots.js").text, re.MULTILINE
    )
    assert set(kinds) == set(KINDS)


def test_page_embeds_the_viewer_and_allows_only_its_origin_in_frames(bench: Bench) -> None:
    response = bench.client.get("/")
    assert f'data-viewer="{VIEWER.replace("&", "&amp;")}"' in response.text
    policy = dict(part.strip().split(" ", 1) for part in response.headers["content-security-policy"].split(";"))
    assert policy["frame-src"] == "http://127.0.0.1:9090"
    assert policy["default-src"] == "'none'"
    assert {policy[name] for name in ("script-src", "style-src", "connect-src")} == {"'self'"}
    assert policy["img-src"] == "'self' blob:", "drawings are fetched with the token, then shown"
    assert policy["frame-ancestors"] == "'none'"
    assert response.headers["origin-agent-cluster"] == "?1"


def test_page_without_a_viewer_allows_no_frames() -> None:
    bench = open_bench()
    response = bench.client.get("/")
    assert 'data-viewer=""' in response.text
    assert "frame-src 'none'" in response.headers["content-security-policy"]
    bench.close()


@pytest.mark.parametrize(
    "url", ["javascript:alert(1)", "viewer", "http://", "http://a b/", "http://x; script-src *", 'http://x"><script>']
)
def test_invalid_viewer_url_is_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(ValueError, match="viewer_url"):
        create_app(fake_state(tmp_path), url)


def test_reference_describes_every_problem_field_and_route(bench: Bench) -> None:
    text = bench.client.get("/docs").text
    ids = read(text).ids
    schema = bench.client.get("/openapi.json").json()
    assert {kind.slug for kind in ProblemType} <= set(ids)
    assert len(ids) == len(set(ids))
    for path, methods in schema["paths"].items():
        assert path in text
        assert {operation["operationId"] for operation in methods.values()} <= set(ids)
    for name, document in schema["components"]["schemas"].items():
        for field in document.get("properties", {}):
            assert f"<code>{field}</code>" in text, f"{name}.{field}"


def test_reference_shows_examples_composed_of_the_fields(bench: Bench) -> None:
    text = bench.client.get("/docs").text
    assert '"speed_rpm": 11042.1' in html.unescape(text)
    assert "<script" not in text
