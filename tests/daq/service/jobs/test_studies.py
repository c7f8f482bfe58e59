"""Study jobs return the same numbers as `rig model … --json`."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from daq.cli.main import main
from daq.schemas.study import StudyRequest
from daq.service.jobs.queue import perform
from daq.service.jobs.tasks import study_task
from model.errors import ModelError
from recordings.catalogue.catalogue import Catalogue

Captured = pytest.CaptureFixture[str]
SLOW = {"from_rad_s": 200.0, "to_rad_s": 600.0, "count": 3}


def run_study_job(request: dict[str, object], folder: Path) -> Any:
    """Run a study job and return its result."""
    steps: list[str] = []
    parsed: StudyRequest = TypeAdapter(StudyRequest).validate_python(request)
    task = study_task(parsed)
    target = folder / task.file
    perform(lambda step, _fraction: steps.append(step), task, target, Catalogue(folder))
    assert steps == ["computing"]
    return json.loads(target.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("study_request", "command"),
    [
        ({"kind": "modes"}, ["modes"]),
        ({"kind": "modes", "stiffness_n_m": 1e7, "speed_rad_s": 500.0, "count": 6},
         ["modes", "--stiffness-n-m", "1e7", "--speed-rad-s", "500", "--count", "6"]),
        ({"kind": "campbell"}, ["campbell"]),
        ({"kind": "critical", "stiffnesses": {"from_n_m": 1e5, "to_n_m": 1e7, "count": 5}},
         ["critical", "--stiffness-n-m", "1e5:1e7:5:log"]),
        ({"kind": "response", "speeds": SLOW, "station": 2},
         ["response", "--speeds-rad-s", "200:600:3", "--station", "2"]),
        ({"kind": "response", "speeds": SLOW, "stiffness_n_m": 1e7},
         ["response", "--speeds-rad-s", "200:600:3", "--stiffness-n-m", "1e7"]),
        ({"kind": "onset", "speeds": SLOW}, ["onset", "--speeds-rad-s", "200:600:3"]),
    ],
)  # fmt: skip
def test_study_job_returns_the_numbers_of_the_command(
    tmp_path: Path, capsys: Captured, study_request: dict[str, object], command: list[str]
) -> None:
    result = run_study_job(study_request, tmp_path)
    assert main(["model", *command, "--json"]) == 0
    assert result == json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("kind", ["campbell", "critical", "response", "onset"])
def test_study_request_has_the_defaults_of_the_command(kind: str) -> None:
    request: StudyRequest = TypeAdapter(StudyRequest).validate_python({"kind": kind})
    ranges = {name: value for name, value in request.model_dump().items() if isinstance(value, dict)}
    assert list(ranges.values()) == {
        "campbell": [{"from_rad_s": 0.0, "to_rad_s": 8000.0, "count": 81}],
        "critical": [{"from_n_m": 1e3, "to_n_m": 1e10, "count": 71}],
    }.get(kind, [{"from_rad_s": 100.0, "to_rad_s": 4000.0, "count": 79}])


def test_study_job_reports_why_the_model_rejects_a_request(tmp_path: Path) -> None:
    with pytest.raises((ValueError, ModelError), match="999"):
        run_study_job({"kind": "response", "speeds": SLOW, "station": 999}, tmp_path)
