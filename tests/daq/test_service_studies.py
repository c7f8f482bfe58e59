"""Studies of the model as jobs: the very numbers of `rig model … --json`, and what is refused."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from daq.cli.main import main
from daq.config.load import load_rig
from daq.config.write import to_toml
from daq.service.documents.job import JobDocument
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.recorded_bench import API, RUN, RecordedBench, open_recorded_bench, record_run

Captured = pytest.CaptureFixture[str]
Table = dict[str, Any]
SLOW = {"from_rad_s": 200.0, "to_rad_s": 600.0, "count": 3}
SHORT = [{"time_s": 0.0, "speed_rpm": 3000.0}, {"time_s": 0.2, "speed_rpm": 3000.0}]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecordedBench]:
    """A bench with one run of a rig whose oil is thicker than the thesis's."""
    folder = tmp_path_factory.mktemp("studies")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    tables = merged(TABLES, {"simulation": {"profile": SHORT}, "model": {"viscosity_pa_s": 0.03}})
    (folder / "rig.toml").write_text(to_toml(tables), encoding="utf-8")
    record_run(load_rig(folder / "rig.toml"), folder)
    opened = open_recorded_bench(folder)
    yield opened
    opened.close()


@pytest.fixture
def study(bench: RecordedBench) -> Callable[..., Table]:
    """Does a study and returns its result."""

    def done(**order: object) -> Table:
        begun = bench.client.post(f"{API}/jobs", json=order)
        assert begun.status_code == 202, begun.text
        place = begun.headers["location"]
        with bench.client.stream("GET", f"{place}/events") as stream:
            told = [line.removeprefix("data: ") for line in stream.iter_lines() if line.startswith("data: ")]
        job = JobDocument.model_validate_json(told[-1])
        assert job.state == "done", job.detail
        table: Table = bench.client.get(f"{place}/result").json()
        return table

    return done


@pytest.mark.parametrize(
    ("order", "command"),
    [
        ({"kind": "modes"}, ["modes"]),
        ({"kind": "modes", "stiffness_n_m": 1e7, "speed_rad_s": 500.0, "count": 6},
         ["modes", "--stiffness-n-m", "1e7", "--speed", "500", "--count", "6"]),
        ({"kind": "campbell"}, ["campbell"]),
        ({"kind": "critical", "stiffnesses": {"from_n_m": 1e5, "to_n_m": 1e7, "count": 5}},
         ["critical", "--stiffness-n-m", "1e5:1e7:5:log"]),
        ({"kind": "response", "speeds": SLOW, "station": 2}, ["response", "--speeds", "200:600:3", "--station", "2"]),
        ({"kind": "onset", "speeds": SLOW}, ["onset", "--speeds", "200:600:3"]),
    ],
)  # fmt: skip
def test_study_gives_the_numbers_of_the_command(
    study: Callable[..., Table], capsys: Captured, order: dict[str, object], command: list[str]
) -> None:
    made = study(**order)
    assert main(["model", *command, "--json"]) == 0
    assert made == json.loads(capsys.readouterr().out)


def test_study_is_of_the_rotor_of_a_run_s_rig(
    study: Callable[..., Table], bench: RecordedBench, capsys: Captured
) -> None:
    of_run, of_thesis = study(kind="onset", run=RUN, speeds=SLOW), study(kind="onset", speeds=SLOW)
    assert main(["model", "onset", str(bench.folder / "rig.toml"), "--speeds", "200:600:3", "--json"]) == 0
    assert of_run == json.loads(capsys.readouterr().out)
    assert of_run["rows"] != of_thesis["rows"], "the oil is another"


@pytest.mark.parametrize(
    ("order", "named"),
    [
        ({"kind": "onset", "speeds": {**SLOW, "to_rad_s": 100.0}}, "expected more than from_rad_s 200"),
        ({"kind": "onset", "speeds": {**SLOW, "from_rad_s": 0.0}}, "greater than 0"),
        ({"kind": "response", "speeds": {**SLOW, "count": 100_000}}, "less than or equal to 2000"),
        ({"kind": "modes", "stiffness_n_m": -1.0}, "greater than 0"),
        ({"kind": "critical", "stiffnesses": {"from_n_m": 2.0, "to_n_m": 1.0, "count": 2}}, "expected more than"),
        ({"kind": "campbell", "station": 1}, "extra inputs"),
    ],
)
def test_study_that_cannot_be_is_refused_with_what_is_expected(
    bench: RecordedBench, order: dict[str, object], named: str
) -> None:
    refused = bench.client.post(f"{API}/jobs", json=order)
    assert refused.status_code == 422
    assert named in refused.json()["detail"]


def test_study_that_the_model_refuses_fails_with_its_words(bench: RecordedBench) -> None:
    place = bench.client.post(f"{API}/jobs", json={"kind": "response", "speeds": SLOW, "station": 999}).headers[
        "location"
    ]
    with bench.client.stream("GET", f"{place}/events") as stream:
        last = [line.removeprefix("data: ") for line in stream.iter_lines() if line.startswith("data: ")][-1]
    job = JobDocument.model_validate_json(last)
    assert (job.state, job.run) == ("failed", None)
    assert "999" in job.detail


def test_study_of_a_run_that_is_not_there_is_refused(bench: RecordedBench) -> None:
    assert bench.client.post(f"{API}/jobs", json={"kind": "modes", "run": "no-such"}).status_code == 404
