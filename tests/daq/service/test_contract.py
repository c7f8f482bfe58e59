"""The service against its OpenAPI schema: schemathesis with all checks over a real socket."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from daq.config.rig import Rig
from tests.daq.support.live_updates import run_up
from tests.daq.support.recorded_bench import RecordedBench, open_recorded_bench, record_run

RigFactory = Callable[..., Rig]
CONFIG = Path(__file__).with_name("schemathesis.toml")
SHORT = {"profile": [{"time_s": 0.0, "speed_rpm": 10_000.0}, {"time_s": 1.0, "speed_rpm": 12_000.0}]}
KNOWN = "2026-11-24T09-12-07-gj90c"  # the id in the schema's examples
CASCADE = "analyses/cascade?source=recorded"
MIN_CAMPAIGN_CASES = 20_000
DELETE_RUN = "delete_run"  # excluded: it would move the tested run to the trash
ANALYSES = r"/analyses/(?!(orbit|cascade|envelopes)$)"  # excluded: they take the same parameters as these three


@pytest.fixture
def bench(tmp_path: Path, rig: RigFactory) -> Iterator[RecordedBench]:
    folder = tmp_path / "data"
    folder.mkdir()
    file = record_run(rig(simulation=SHORT), folder, KNOWN)
    (folder / "trash").mkdir()
    shutil.copy(file, folder / "trash")
    served = open_recorded_bench(folder, job_limit=2.0)  # this test does not check the results of jobs
    served.live.update = list(run_up(3, "under-way"))[2]
    served.client.get(
        f"/api/v1/runs/{KNOWN}/analyses/cascade?source=recorded"
    )  # lets the worker process load its modules
    yield served
    served.close()


def run_schemathesis(bench: RecordedBench, *options: str, timeout: float) -> int:
    """Run schemathesis; return the number of cases, and assert that none failed."""
    done = subprocess.run(
        [
            str(Path(sys.executable).with_name("schemathesis")),
            f"--config-file={CONFIG}",
            "run",
            str(bench.client.base_url.join("/openapi.json")),
            "--checks=all",
            "--exclude-path=/api/v1/live/events",  # endless stream
            "--exclude-path=/api/v1/live/curves/events",  # endless stream
            "--request-timeout=60",
            "--max-response-time=30",  # the service's own time limit
            "--no-color",
            *options,
        ],
        capture_output=True,
        text=True,
        timeout=timeout,
        cwd=bench.folder.parent,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    generated = re.search(r"(\d+) generated", done.stdout)
    assert generated is not None, done.stdout[-2000:]
    print(done.stdout[-600:])
    return int(generated.group(1))


def test_service_conforms_to_its_schema_in_a_short_run(bench: RecordedBench) -> None:
    quick = ("--phases=examples,fuzzing", "--max-examples=4", "--seed=1", f"--exclude-path-regex={ANALYSES}")
    assert run_schemathesis(bench, *quick, f"--exclude-operation-id={DELETE_RUN}", timeout=400.0) > 90
    assert run_schemathesis(bench, *quick, f"--include-operation-id={DELETE_RUN}", timeout=200.0) > 0


@pytest.mark.campaign
def test_service_conforms_to_its_schema_in_twenty_thousand_cases(bench: RecordedBench) -> None:
    phases = "--phases=examples,coverage,fuzzing,stateful"
    exclusions = (f"--exclude-operation-id={DELETE_RUN}", "--workers=2")
    total = run_schemathesis(bench, phases, "--max-examples=700", *exclusions, timeout=7200.0)
    assert bench.client.get(f"/api/v1/runs/{KNOWN}/{CASCADE}").status_code == 200, "the tested run still exists"
    total += run_schemathesis(
        bench, phases, "--max-examples=500", f"--include-operation-id={DELETE_RUN}", timeout=3600.0
    )
    print(f"{total:,} cases")
    assert total >= MIN_CAMPAIGN_CASES
