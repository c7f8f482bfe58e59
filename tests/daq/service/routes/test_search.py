"""The run list over REST: filters, sort order and pages, with a real catalogue."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from daq.config.rig import Rig
from daq.session.offline import summarise
from recordings.catalogue.catalogue import Catalogue
from tests.daq.support.recorded_bench import API, RecordedBench, open_recorded_bench, record_run

RigFactory = Callable[..., Rig]
QueryParameters = dict[str, str | int | list[str]]
SLOW, FAST = "2026-11-23T08-00-00-slow", "2026-11-24T09-12-07-fast"


def ramp(low: float, high: float, seconds: float) -> dict[str, Any]:
    """Return the configuration of a simulated ramp."""
    return {"profile": [{"time_s": 0.0, "speed_rpm": low}, {"time_s": seconds, "speed_rpm": high}]}


@pytest.fixture
def bench(tmp_path: Path, rig: RigFactory) -> Iterator[RecordedBench]:
    folder = tmp_path / "data"
    folder.mkdir()
    record_run(rig(simulation=ramp(3000.0, 4000.0, 2.0)), folder, SLOW)
    record_run(rig(simulation=ramp(8000.0, 9000.0, 1.0)), folder, FAST)
    catalogue = Catalogue(folder)
    catalogue.index(summarise)
    catalogue.annotate(FAST, remark="new bearing", tags=("good", "reference"))
    served = open_recorded_bench(folder)
    yield served
    served.close()


def listed(bench: RecordedBench, **query: str | int | list[str]) -> list[str]:
    """Return the ids of the runs that match a query."""
    response = bench.client.get(f"{API}/runs", params=query)
    assert response.status_code == 200, response.text
    return [run["run"] for run in response.json()["runs"]]


def test_run_list_filters_by_measurement_annotation_and_calibration(bench: RecordedBench) -> None:
    run = bench.client.get(f"{API}/runs/{FAST}").json()
    assert (run["remark"], run["tags"]) == ("new bearing", ["good", "reference"])
    both = [SLOW, FAST]
    assert sorted(listed(bench)) == both
    assert sorted(listed(bench, calibration=run["calibration"][:6], rig=run["rig"])) == both
    assert listed(bench, calibration="nobody") == listed(bench, rig="nobody") == listed(bench, device="nobody") == []
    assert listed(bench, speed_from_rpm=5000) == listed(bench, text="BEARING fast") == [FAST]
    assert listed(bench, speed_to_rpm=5000) == [SLOW]
    assert listed(bench, tag=["good", "reference"]) == [FAST]
    vibration = run["largest_peak_to_peak_um"]
    assert FAST in listed(bench, peak_to_peak_from_um=vibration - 0.01, peak_to_peak_to_um=vibration + 0.01)
    assert FAST not in listed(bench, peak_to_peak_from_um=vibration + 0.01)
    assert FAST not in listed(bench, peak_to_peak_to_um=vibration - 0.01)
    assert 0.0 < run["largest_rms_um"] < vibration / 2.0
    assert FAST in listed(bench, rms_from_um=run["largest_rms_um"] - 0.01, rms_to_um=run["largest_rms_um"] + 0.01)
    assert FAST not in listed(bench, rms_from_um=run["largest_rms_um"] + 0.01)
    assert listed(bench, rms_to_um=0) == []
    assert listed(bench, tag=["good", "odd"]) == []
    assert sorted(listed(bench, since="2026-11-01", before="2027-01-01T00:00:00Z")) == both
    assert listed(bench, since="9999-12-31T23:59:59Z") == listed(bench, before="0001-01-01T00:00:00Z") == []
    assert listed(bench, onset_below_rpm=9000) == []


def test_run_list_is_sorted_and_paged(bench: RecordedBench) -> None:
    assert listed(bench, sort="-duration") == listed(bench, sort="-size") == [SLOW, FAST]
    assert listed(bench, sort="duration") == listed(bench, sort="size") == [FAST, SLOW]
    assert listed(bench, sort="started") == listed(bench, sort="-started")[::-1]
    assert listed(bench, sort="duration", limit=1, offset=1) == [SLOW]
    assert bench.client.get(f"{API}/runs", params={"text": "fast", "limit": 1}).json()["total"] == 1


@pytest.mark.parametrize(
    "query",
    [{"sort": "colour"}, {"since": "yesterday"}, {"speed_from_rpm": -1}, {"text": "\x00"}, {"speed": 3}],
)  # fmt: skip
def test_invalid_query_is_refused(bench: RecordedBench, query: QueryParameters) -> None:
    response = bench.client.get(f"{API}/runs", params=query)
    assert response.status_code == 422, response.text
    assert response.json()["faults"]
