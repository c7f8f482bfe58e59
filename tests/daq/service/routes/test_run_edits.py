"""Editing runs over REST: annotations, trash, uploaded recordings, and starting runs."""

import http.client
import shutil
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from analysis.live.alarms import Alarm
from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.errors import DeviceError, DeviceFault
from daq.session.live_update import LiveUpdate
from daq.session.run import RunManager, RunOutcome
from tests.daq.support.live_updates import make_live_updates
from tests.daq.support.recorded_bench import API, RUN, RecordedBench, open_recorded_bench, record_run

RigFactory = Callable[..., Rig]
SHORT = {"profile": [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 0.5, "speed_rpm": 6000.0}]}


class FakeRun:
    """Run that ends when it is stopped."""

    def __init__(self, note: str) -> None:
        self.frame = make_live_updates(1)[0]
        self.header: RunHeader = replace(self.frame.header, note=note)
        self.ended = threading.Event()
        self.closed = False

    def latest(self) -> LiveUpdate:
        return self.frame

    def acknowledge(self) -> tuple[Alarm, ...]:
        return ()

    def stop(self) -> None:
        self.ended.set()

    def wait(self, timeout: float) -> bool:
        return self.ended.wait(timeout)

    def close(self) -> RunOutcome:
        self.ended.set()
        self.closed = True
        return RunOutcome(())


@pytest.fixture
def bench(tmp_path: Path, rig: RigFactory) -> Iterator[RecordedBench]:
    folder = tmp_path / "data"
    folder.mkdir()
    record_run(rig(simulation=SHORT), folder)
    served = open_recorded_bench(folder)
    yield served
    served.close()


def listed(bench: RecordedBench) -> list[str]:
    return [run["run"] for run in bench.client.get(f"{API}/runs").json()["runs"]]


def problem(response: httpx.Response) -> tuple[int, str]:
    return response.status_code, response.json()["type"].removeprefix("/docs#")


def test_remark_and_tags_are_stored_beside_the_unchanged_recording(bench: RecordedBench) -> None:
    path = bench.folder / f"{RUN}.mcap"
    before = path.read_bytes()
    first = bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "bearing changed", "tags": ["reference", "cold"]})
    assert first.status_code == 200
    second = bench.client.patch(f"{API}/runs/{RUN}", json={"tags": []})
    assert (second.json()["remark"], second.json()["tags"]) == ("bearing changed", [])
    assert first.json()["tags"] == ["cold", "reference"]
    assert path.read_bytes() == before


@pytest.mark.parametrize("annotation", [{"tags": [" x"]}, {"tags": ["a\nb"]}, {"remark": 3}, {"other": 1}, []])
def test_invalid_annotation_is_refused(bench: RecordedBench, annotation: object) -> None:
    assert problem(bench.client.patch(f"{API}/runs/{RUN}", json=annotation)) == (422, "invalid-parameter")


def test_deleted_run_is_in_the_trash_unchanged(bench: RecordedBench) -> None:
    content = (bench.folder / f"{RUN}.mcap").read_bytes()
    bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "to go"})
    response = bench.client.delete(f"{API}/runs/{RUN}")
    assert response.json() == {"run": RUN, "trash": f"trash/{RUN}.mcap", "name": RUN}
    assert listed(bench) == []
    assert (bench.folder / "trash" / f"{RUN}.mcap").read_bytes() == content
    assert bench.client.delete(f"{API}/runs/{RUN}").status_code == 404
    shutil.copy(bench.folder / "trash" / f"{RUN}.mcap", bench.folder)
    assert bench.client.delete(f"{API}/runs/{RUN}").json()["trash"] == f"trash/{RUN} (2).mcap"


def test_run_is_restored_with_its_annotations_and_never_over_another(bench: RecordedBench) -> None:
    content = (bench.folder / f"{RUN}.mcap").read_bytes()
    bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "to go"})
    bench.client.delete(f"{API}/runs/{RUN}")
    shutil.copy(bench.folder / "trash" / f"{RUN}.mcap", bench.folder)
    bench.client.delete(f"{API}/runs/{RUN}")
    in_trash = bench.client.get(f"{API}/trash").json()["runs"]
    assert in_trash == [{"name": f"{RUN} (2)", "size_bytes": len(content)}, {"name": RUN, "size_bytes": len(content)}]
    back = bench.client.post(f"{API}/trash/{RUN}/restore", json={})
    assert (back.status_code, back.headers["location"]) == (201, f"{API}/runs/{RUN}")
    assert (back.json()["run"], back.json()["remark"]) == (RUN, "to go")
    assert bench.client.get(f"{API}/runs/{RUN}").json() == back.json()
    again = bench.client.post(f"{API}/trash/{RUN} (2)/restore", json={"run": RUN})
    assert problem(again) == (409, "run-exists")
    other = bench.client.post(f"{API}/trash/{RUN} (2)/restore", json={"run": "other"})
    assert (other.json()["run"], other.json()["remark"]) == ("other", "")
    assert (bench.folder / "other.mcap").read_bytes() == (bench.folder / f"{RUN}.mcap").read_bytes() == content
    assert bench.client.get(f"{API}/trash").json() == {"runs": []}
    assert problem(bench.client.post(f"{API}/trash/{RUN}/restore", json={})) == (404, "not-in-trash")


@pytest.mark.parametrize(("name", "run"), [("..%2f..%2fsecret", None), ("%2e%2e", None), (RUN, "../out"), (RUN, "a/b")])
def test_restore_stays_within_the_data_folder(bench: RecordedBench, name: str, run: str | None) -> None:
    bench.client.delete(f"{API}/runs/{RUN}")
    (bench.folder.parent / "secret.mcap").write_bytes(b"secret")
    assert bench.client.post(f"{API}/trash/{name}/restore", json={"run": run}).status_code in {404, 405}
    assert [path.name for path in bench.folder.parent.glob("*.mcap")] == ["secret.mcap"]
    assert listed(bench) == []


def test_change_with_an_outdated_etag_is_refused(bench: RecordedBench) -> None:
    seen = bench.client.get(f"{API}/runs/{RUN}")
    tag = seen.headers["etag"]
    assert bench.client.get(f"{API}/runs/{RUN}", headers={"If-None-Match": tag}).status_code == 304
    first = bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "mine"}, headers={"If-Match": tag})
    assert (first.status_code, first.json()["remark"]) == (200, "mine")
    late = bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "theirs"}, headers={"If-Match": tag})
    assert problem(late) == problem(bench.client.delete(f"{API}/runs/{RUN}", headers={"If-Match": tag})) == (
        412, "precondition-failed",
    )  # fmt: skip
    now = bench.client.get(f"{API}/runs/{RUN}")
    assert (now.json()["remark"], now.headers["etag"]) == ("mine", first.headers["etag"])
    either = {"If-Match": f'"other", {now.headers["etag"]}'}
    assert bench.client.patch(f"{API}/runs/{RUN}", json={"remark": "ours"}, headers=either).status_code == 200
    assert bench.client.delete(f"{API}/runs/{RUN}", headers={"If-Match": "*"}).status_code == 200


def test_only_one_of_many_concurrent_changes_with_the_same_etag_succeeds(bench: RecordedBench) -> None:
    tag = {"If-Match": bench.client.get(f"{API}/runs/{RUN}").headers["etag"]}

    def change(number: int) -> int:
        return bench.client.patch(f"{API}/runs/{RUN}", json={"remark": f"number {number}"}, headers=tag).status_code

    with ThreadPoolExecutor(8) as threads:
        answers = sorted(threads.map(change, range(8)))
    assert answers == [200, *[412] * 7]


def test_chunked_json_with_a_content_length_is_refused(bench: RecordedBench) -> None:
    head = (
        f"PATCH {API}/runs/{RUN} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nConnection: close\r\n"
    )
    body = "Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n"
    with socket.create_connection(("127.0.0.1", bench.client.base_url.port or 0), timeout=60.0) as client:
        client.sendall((head + body).encode())
        assert client.recv(65_536).startswith(b"HTTP/1.1 413 ")


def test_run_in_progress_cannot_be_deleted(bench: RecordedBench) -> None:
    update = make_live_updates(1)[0]
    bench.live.update = replace(update, header=replace(update.header, run=RUN))
    assert problem(bench.client.delete(f"{API}/runs/{RUN}")) == (409, "run-under-way")
    assert (bench.folder / f"{RUN}.mcap").exists()


@pytest.mark.parametrize("run", ["..%2fx", "no-such-run", "%2e%2e"])
def test_delete_and_upload_stay_within_the_data_folder(bench: RecordedBench, run: str) -> None:
    (bench.folder.parent / "x.mcap").write_bytes(b"secret")
    assert bench.client.delete(f"{API}/runs/{run}").status_code in {404, 405}
    assert bench.client.put(f"{API}/runs/{run}/file", content=b"x").status_code in {404, 405, 422}
    assert (bench.folder.parent / "x.mcap").read_bytes() == b"secret"


def test_uploaded_recording_is_stored_unchanged_and_never_overwritten(bench: RecordedBench) -> None:
    content = (bench.folder / f"{RUN}.mcap").read_bytes()
    response = bench.client.put(f"{API}/runs/sent-in/file", content=content)
    assert response.status_code == 201
    assert response.headers["location"] == f"{API}/runs/sent-in"
    assert bench.client.get(f"{API}/runs/sent-in/file").content == content
    assert problem(bench.client.put(f"{API}/runs/sent-in/file", content=content)) == (409, "run-exists")
    assert sorted(listed(bench)) == sorted([RUN, "sent-in"])


def test_rejected_recording_leaves_no_file(bench: RecordedBench) -> None:
    content = (bench.folder / f"{RUN}.mcap").read_bytes()
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 1
    for sent in (b"", b"no recording", content[: len(content) // 2], bytes(flipped)):
        assert problem(bench.client.put(f"{API}/runs/sent-in/file", content=sent)) == (422, "invalid-recording")
    with closing(http.client.HTTPConnection("127.0.0.1", bench.client.base_url.port, timeout=60)) as connection:
        connection.putrequest("PUT", f"{API}/runs/sent-in/file")
        connection.putheader("Content-Length", str(10**15))
        connection.endheaders()
        assert connection.getresponse().status == 413
    assert [path.name for path in bench.folder.iterdir() if "sent-in" in path.name] == []


def test_page_of_another_site_cannot_change_runs(bench: RecordedBench) -> None:
    evil = {"Origin": "http://evil.example"}
    assert bench.client.delete(f"{API}/runs/{RUN}", headers=evil).status_code == 403
    assert bench.client.put(f"{API}/runs/x/file", content=b"", headers=evil).status_code == 403
    assert bench.client.patch(f"{API}/runs/{RUN}", json={}, headers=evil).status_code == 403
    assert bench.client.post(f"{API}/runs", json={}, headers=evil).status_code in {403, 405}
    assert listed(bench) == [RUN]


def test_only_one_run_starts_at_a_time(tmp_path: Path, rig: RigFactory) -> None:
    made: list[FakeRun] = []

    def begin(_rig: Rig, note: str, duration: float | None) -> FakeRun:
        if note == "unplugged":
            raise DeviceError(DeviceFault.MISSING, "there is no device Dev1")
        assert duration in {None, 5.0}
        made.append(FakeRun(note))
        return made[-1]

    with closing(RunManager(rig(), begin)) as manager:
        bench = open_recorded_bench(tmp_path, run_manager=manager)
        first = bench.client.post(f"{API}/runs", json={"note": "warm", "duration_s": 5.0})
        assert (first.status_code, first.json()["run"]) == (201, made[0].header.run)
        assert first.headers["location"] == f"{API}/runs/{made[0].header.run}"
        assert problem(bench.client.post(f"{API}/runs", json={})) == (409, "run-cannot-start")
        made[0].stop()
        refused = bench.client.post(f"{API}/runs", json={"note": "unplugged"})
        assert "there is no device Dev1" in refused.json()["detail"]
        assert bench.client.post(f"{API}/runs", json={"rig": "other"}).status_code == 409
        assert bench.client.post(f"{API}/runs", json={"rig": "test-rig"}).status_code == 201
        bench.close()
    assert [run.closed for run in made] == [True, True]
