"""Uploads over REST and import jobs, compared with the import command."""

import asyncio
import http.client
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import Request
from scipy.io import wavfile

from daq.cli.main import main
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.service.jobs.schemas import JobSchema
from daq.service.problems import ProblemError
from daq.service.uploads import UploadReceiver, UploadStore
from recordings.exchange.formats import write_table
from recordings.exchange.table import Column, Table
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.reader import RunReader
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.recorded_bench import API, RUN, RecordedBench, open_recorded_bench, record_run

RATE, ROWS = 5000.0, 5000
OCTETS = {"Content-Type": "application/octet-stream"}
SHORT = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 0.2, "speed_rpm": 3000.0}]
OF_RUN = {"source": "run", "run": RUN}
VOLTS = {name: {"source": name} for name in ("x", "y", "tacho")}


def shaft_table() -> Table:
    """Return the signals of a shaft at 6000 r/min, V."""
    time = np.arange(ROWS) / RATE
    turn = 2 * np.pi * 100.0 * time
    x, y = 5 + 0.3 * np.cos(turn), 5 + 0.3 * np.sin(turn)
    tacho = np.where(np.cos(turn) > 0.9, 4.5, 0.2)
    columns = tuple(Column(name, "V", values) for name, values in (("x", x), ("y", y), ("tacho", tacho)))
    return Table(columns, RATE, 1_795_511_527_000_000_000, {"note": "cold oil"})


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecordedBench]:
    folder = tmp_path_factory.mktemp("imports") / "data"
    folder.mkdir()
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder.parent / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    tables = merged(TABLES, {"simulation": {"profile": SHORT}})
    (folder.parent / "rig.toml").write_text(to_toml(tables), encoding="utf-8")
    record_run(load_rig(folder.parent / "rig.toml"), folder)
    opened = open_recorded_bench(folder)
    yield opened
    opened.close()


@pytest.fixture
def bench(served: RecordedBench) -> Iterator[RecordedBench]:
    """Return the bench; delete all uploads before and after."""
    yield served
    for upload in served.client.get(f"{API}/uploads").json()["uploads"]:
        served.client.delete(f"{API}/uploads/{upload['upload']}")


def post_upload(bench: RecordedBench, name: str, content: bytes) -> httpx.Response:
    return bench.client.post(f"{API}/uploads", params={"name": name}, content=content, headers=OCTETS)


def upload_file(bench: RecordedBench, name: str, content: bytes) -> str:
    """Upload a file; return its id."""
    response = post_upload(bench, name, content)
    assert response.status_code == 201, response.text
    upload: str = response.json()["upload"]
    return upload


def request_import(bench: RecordedBench, upload: str, rig: object = OF_RUN, **mapping: Any) -> httpx.Response:
    order = {"kind": "import", "upload": upload, "rig": rig, "mapping": {"channel": VOLTS, **mapping}}
    return bench.client.post(f"{API}/jobs", json=order)


def wait_for_job(bench: RecordedBench, response: httpx.Response) -> JobSchema:
    """Wait for the end of a job."""
    assert response.status_code == 202, response.text
    with bench.client.stream("GET", response.json()["events"]) as stream:
        events = [line.removeprefix("data: ") for line in stream.iter_lines() if line.startswith("data: ")]
    return JobSchema.model_validate_json(events[-1])


def imported_run(bench: RecordedBench, response: httpx.Response) -> dict[str, Any]:
    """Return the run that an import job created."""
    job = wait_for_job(bench, response)
    assert job.state == "done", job.detail
    assert job.result is not None
    run: dict[str, Any] = bench.client.get(job.result).json()
    return run


@pytest.fixture
def shaft_file(tmp_path: Path) -> Callable[[str], bytes]:
    """Return a function that writes the shaft's signals in the format of a file name."""

    def content(name: str) -> bytes:
        path = tmp_path / name
        write_table(path, shaft_table())
        return path.read_bytes()

    return content


def test_tdms_file_is_imported_as_by_the_command(
    bench: RecordedBench, shaft_file: Callable[[str], bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    upload = upload_file(bench, "Läufer 1.TDMS", shaft_file("run.tdms"))
    seen = bench.client.get(f"{API}/uploads/{upload}/columns").json()
    assert (seen["name"], seen["rows"], seen["rate_hz"]) == ("Läufer 1.TDMS", ROWS, RATE)
    assert [column["name"] for column in seen["columns"]] == ["run/x", "run/y", "run/tacho"]
    assert seen["columns"][0] == {"name": "run/x", "unit": "V", "lowest": pytest.approx(4.7), "highest": 5.3}
    channel = {name: {"source": f"run/{name}"} for name in VOLTS}
    run = imported_run(bench, request_import(bench, upload, channel=channel, note="over REST"))
    assert (run["rig"], run["note"], run["is_complete"], run["samples"]) == ("test-rig", "over REST", True, ROWS)
    assert bench.client.get(f"{API}/runs/{run['run']}").json() == run
    assert verify(bench.folder / f"{run['run']}.mcap").verdict is Verdict.INTACT

    mapping = bench.folder.parent / "mapping.toml"
    mapping.write_text(to_toml({"rig": "rig.toml", "note": "over REST", "channel": channel}), encoding="utf-8")
    there = tmp_path / "other"
    assert main(["import", str(tmp_path / "run.tdms"), "--mapping", str(mapping), "--folder", str(there)]) == 0
    capsys.readouterr()
    with RunReader(bench.folder / f"{run['run']}.mcap") as rest, RunReader(next(there.glob("*.mcap"))) as command:
        np.testing.assert_array_equal(rest.samples(0, 0, ROWS), command.samples(0, 0, ROWS))
        assert rest.header.acquisition == command.header.acquisition
        assert rest.header.started_ns == command.header.started_ns


def lvm(table: Table) -> str:
    """Return a table as a LabVIEW measurement file."""
    heads = ("LabVIEW Measurement", "Separator\tComma", "X_Columns\tNo", "***End_of_Header***", "")
    about = ("Channels,3", f"Samples,{ROWS},{ROWS},{ROWS}", *(f"Delta_X{f',{1 / RATE!r}' * 3}",), "***End_of_Header***")
    rows = zip(*(column.values.tolist() for column in table.columns), strict=True)
    lines = (*heads, *about, "X_Value,x,y,tacho", *(",".join(("", *map(repr, row))) for row in rows))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "suffix", [".lvm", *(pytest.param(name, marks=pytest.mark.campaign) for name in (".csv", ".mat", ".uff", ".wav"))]
)
def test_other_formats_are_imported(bench: RecordedBench, tmp_path: Path, suffix: str) -> None:
    path, table, channel = tmp_path / f"run{suffix}", shaft_table(), VOLTS
    if suffix == ".lvm":
        path.write_text(lvm(table), encoding="utf-8")
    elif suffix == ".wav":
        codes = np.stack([column.values * 1000 for column in table.columns], axis=1).astype(np.int16)
        wavfile.write(path, int(RATE), codes)
        channel = {name: {"source": str(k), "unit": "mV"} for k, name in enumerate(VOLTS, 1)}
    else:
        write_table(path, table)
    run = imported_run(bench, request_import(bench, upload_file(bench, path.name, path.read_bytes()), channel=channel))
    assert (run["samples"], run["sample_rate_hz"]) == (ROWS, RATE)
    rows = bench.client.get(f"{API}/runs/{run['run']}/summary").json()["by_speed"]
    assert rows[0]["speed_rpm"] == pytest.approx(6000.0, rel=1e-3)


def test_import_accepts_a_rig_as_toml_with_calibrations(
    bench: RecordedBench, shaft_file: Callable[[str], bytes]
) -> None:
    record = {"calibration": CALIBRATION}
    text = (bench.folder.parent / "rig.toml").read_text(encoding="utf-8")
    upload = upload_file(bench, "run.csv", shaft_file("run.csv"))
    rig = {"source": "toml", "toml": text, "calibrations": {"x": record, "y": record}}
    by_text, by_run = (imported_run(bench, request_import(bench, upload, one)) for one in (rig, OF_RUN))
    headers = []
    for run in (by_text, by_run):
        with RunReader(bench.folder / f"{run['run']}.mcap") as reader:
            headers.append(reader.header)
    assert headers[0].acquisition == headers[1].acquisition
    assert headers[0].config_toml == headers[1].config_toml
    refused = request_import(bench, upload, {**rig, "calibrations": {"x": record}})
    assert refused.status_code == 422
    assert "expected the calibration of 'y'" in refused.json()["detail"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"model": {"rotor": "/etc/passwd"}}, "no file is read here"),
        ({"runout": {"from_run": "../../secret.mcap", "slow_roll_rpm": 500.0}}, "expected the id of a run, not a file"),
        ({"runout": {"from_run": "../secret", "slow_roll_rpm": 500.0}}, "there is no such run"),
        ({"rig": "../../tmp"}, "small letters, digits and hyphens"),
    ],
)
def test_paths_in_a_rig_s_toml_do_not_reach_the_disk(
    bench: RecordedBench, shaft_file: Callable[[str], bytes], changes: dict[str, object], named: str
) -> None:
    record = {"calibration": CALIBRATION}
    text = to_toml(merged(TABLES, changes))
    rig = {"source": "toml", "toml": text, "calibrations": {"x": record, "y": record}}
    answer = request_import(bench, upload_file(bench, "run.csv", shaft_file("run.csv")), rig)
    detail = wait_for_job(bench, answer).detail if answer.status_code == 202 else answer.json()["detail"]
    assert named in detail


@pytest.mark.parametrize(
    "name",
    ["../run.csv", "a/run.csv", "C:\\run.csv", "c:run.csv", "run.exe", ".csv", "run", "", "r\x00n.csv", "a\nb.csv"],
)
def test_invalid_upload_name_is_refused(bench: RecordedBench, name: str) -> None:
    before = sorted(bench.folder.parent.rglob("*"))
    assert post_upload(bench, name, b"x\n1\n").status_code == 422
    assert sorted(bench.folder.parent.rglob("*")) == before


def test_upload_name_does_not_reach_the_disk(bench: RecordedBench) -> None:
    upload_file(bench, "-rf; $(reboot) ..csv.csv", b"x\n1\n")
    held = [path.name for path in (bench.folder / ".rig" / "uploads").rglob("*") if path.is_file()]
    assert held == ["upload.csv"]


def test_mapping_that_does_not_fit_is_refused_at_once(bench: RecordedBench, shaft_file: Callable[[str], bytes]) -> None:
    upload = upload_file(bench, "run.csv", shaft_file("run.csv"))
    for mapping, named in (
        ({"channel": {"x": {"source": "x"}}}, "channel.y: is missing"),
        ({"channel": VOLTS | {"z": {"source": "x"}}}, "channel.z: the rig has no such channel"),
        ({"channel": VOLTS | {"tacho": {"source": "tacho", "unit": "um"}}}, 'expected "V"'),
        ({"channel": VOLTS | {"x": {"source": "x", "factor": "2"}}}, "valid number"),
        ({"channel": VOLTS | {"x": {"source": "x", "factor": 1e300}}}, "less than or equal to"),
        ({"started": "9999-12-31T23:59:59"}, "expected a timestamp"),
        ({"rate_hz": 1e308}, "less than or equal to"),
        ({"path": "/etc/passwd"}, "Extra inputs"),
    ):
        refused = request_import(bench, upload, **mapping)
        assert refused.status_code == 422, mapping
        assert named in refused.json()["detail"]


def test_import_error_does_not_reveal_the_path_on_disk(
    bench: RecordedBench, shaft_file: Callable[[str], bytes]
) -> None:
    whole = shaft_file("run.csv")
    runs = bench.client.get(f"{API}/runs").json()["total"]
    for content, mapping, named in (
        (whole[:-3], {}, "run.csv: line 5004, the last one, has no line end"),
        (b"nonsense", {}, "run.csv: "),
        (whole, {"channel": VOLTS | {"x": {"source": "z"}}}, "no column 'z'; there are 'x', 'y', 'tacho'"),
        (whole, {"rate_hz": 1000.0}, "run.csv says 5000"),
    ):
        upload = upload_file(bench, "run.csv", content)
        job = wait_for_job(bench, request_import(bench, upload, **mapping))
        assert (job.state, job.detail.count(str(bench.folder))) == ("failed", 0)
        assert named in job.detail
    assert bench.client.get(f"{API}/runs").json()["total"] == runs
    refused = bench.client.get(f"{API}/uploads/{upload_file(bench, 'run.mat', whole)}/columns")
    assert (refused.status_code, refused.json()["type"]) == (409, "/docs#unreadable-upload")
    assert refused.json()["detail"].startswith("run.mat: ")


def test_imported_run_cannot_provide_the_rig(bench: RecordedBench, shaft_file: Callable[[str], bytes]) -> None:
    upload = upload_file(bench, "run.csv", shaft_file("run.csv"))
    run = imported_run(bench, request_import(bench, upload))["run"]
    refused = request_import(bench, upload, {"source": "run", "run": run})
    assert refused.status_code == 422
    assert "was imported" in refused.json()["detail"]


def test_uploads_are_listed_and_deleted(bench: RecordedBench) -> None:
    first, second = (upload_file(bench, name, b"x\n1\n2\n") for name in ("one.csv", "two.csv"))
    listed = bench.client.get(f"{API}/uploads").json()["uploads"]
    assert [(one["upload"], one["name"], one["size_bytes"]) for one in listed] == [
        (second, "two.csv", 6), (first, "one.csv", 6),
    ]  # fmt: skip
    assert bench.client.get(f"{API}/uploads/{first}").json() == listed[1]
    assert bench.client.delete(f"{API}/uploads/{first}").json() == listed[1]
    for gone in (
        bench.client.get(f"{API}/uploads/{first}"),
        bench.client.get(f"{API}/uploads/{first}/columns"),
        bench.client.delete(f"{API}/uploads/{first}"),
        request_import(bench, first),
    ):
        assert (gone.status_code, gone.json()["type"]) == (404, "/docs#upload-not-found")
    assert not (bench.folder / ".rig" / "uploads" / first).exists()


def test_upload_with_wrong_size_type_or_site_is_refused(bench: RecordedBench) -> None:
    address = f"{API}/uploads?name=run.csv"
    connection = http.client.HTTPConnection(bench.client.base_url.host, bench.client.base_url.port, timeout=60)
    connection.putrequest("POST", address)
    for name, value in {**OCTETS, "Content-Length": str(3 * 1024**3)}.items():
        connection.putheader(name, value)
    connection.endheaders()
    large = connection.getresponse()
    connection.close()
    assert large.status == 413
    answers = {
        415: bench.client.post(address, content=b"x\n1\n", headers={"Content-Type": "text/plain"}),
        403: bench.client.post(address, content=b"x\n1\n", headers={**OCTETS, "Origin": "http://elsewhere.example"}),
    }
    assert {status: answer.status_code for status, answer in answers.items()} == {415: 415, 403: 403}
    assert bench.client.get(f"{API}/uploads").json() == {"uploads": []}


def test_upload_requires_the_token(tmp_path: Path) -> None:
    opened = open_recorded_bench(tmp_path, host="0.0.0.0", token="secret")  # noqa: S104, S106 - as if
    try:
        assert post_upload(opened, "run.csv", b"x\n1\n").status_code == 401
        opened.client.headers["Authorization"] = "Bearer secret"
        assert post_upload(opened, "run.csv", b"x\n1\n").status_code == 201
    finally:
        opened.close()
    assert not list((tmp_path / ".rig" / "uploads").iterdir()), "nothing is left when the service ends"


def test_uploads_expire_and_are_limited_in_number(tmp_path: Path) -> None:
    def add_upload(uploads: UploadStore, name: str) -> str:
        place = uploads.new_path(name)
        place.parent.mkdir(parents=True)
        place.write_bytes(b"x")
        return uploads.add(name, place, 1).upload

    passing, lasting = UploadStore(tmp_path / "a", retention_time=0.0), UploadStore(tmp_path / "b")
    add_upload(passing, "run.csv")
    assert passing.list_uploads() == ()
    assert not list((tmp_path / "a/.rig/uploads").iterdir())
    for _ in range(16):
        add_upload(lasting, "run.csv")
    with pytest.raises(ProblemError, match="16 uploads are stored"):
        lasting.new_path("run.csv")


def test_upload_that_stalls_times_out(tmp_path: Path) -> None:
    async def receive() -> None:
        first = iter([{"type": "http.request", "body": b"some", "more_body": True}])

        async def receive() -> dict[str, Any]:
            for message in first:
                return message
            await asyncio.Event().wait()
            raise AssertionError("nothing more comes")

        request = Request({"type": "http", "method": "POST", "headers": []}, receive)
        incoming = UploadReceiver(1000, chunk_timeout=0.05)
        await incoming.receive(request, tmp_path / "new" / "file")

    with pytest.raises(ProblemError, match=r"4 bytes in 0\.05 s after 0"):
        asyncio.run(receive())
    assert not list((tmp_path / "new").iterdir())
