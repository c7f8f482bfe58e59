"""The catalogue lists all runs, damaged or not, and no id leads out of its folder."""

import os
import re
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.errors import NotFoundError, StorageError
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
SECOND = 1_000_000_000

pytestmark = pytest.mark.usefixtures("database")


@pytest.fixture
def record(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> Callable[[str, int], Path]:
    """Return a function that writes a short run into the data folder."""

    def write(run_id: str, started_ns: int) -> Path:
        writer = RunWriter(tmp_path / f"{run_id}.mcap", replace(header, run=run_id, started_ns=started_ns))
        for k in range(5):
            writer.write_block(make_block(0, 2000 * k, 2000))
        writer.write_segment_end(SegmentEnd(0, 10_000, EndReason.STOPPED))
        writer.close()
        return writer.path

    return write


def test_runs_are_listed_newest_first(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    for run_id, started in (("b", 2), ("a", 3), ("c", 1)):
        record(run_id, started * SECOND)
    entries = Catalogue(tmp_path).runs()
    assert [entry.id for entry in entries] == ["a", "b", "c"]
    entry = entries[0]
    assert (entry.samples, entry.duration, entry.is_complete, entry.is_gap_free) == (10_000, 0.5, True, True)
    assert entry.size == entry.path.stat().st_size
    assert entry.fault == ""
    assert entry.header is not None
    assert entry.header.run == "a"


def test_missing_data_folder_has_no_runs(tmp_path: Path) -> None:
    assert Catalogue(tmp_path / "data").runs() == []


def test_file_instead_of_the_data_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("")
    with pytest.raises(StorageError, match="data"):
        Catalogue(tmp_path / "data").new_run("rig", 0)
    with pytest.raises(StorageError, match="the data folder cannot be read"):
        Catalogue(tmp_path / "data").runs()


def test_damaged_files_are_listed_with_their_fault(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    record("good", SECOND)
    cut = record("cut", 2 * SECOND)
    cut.write_bytes(cut.read_bytes()[:-50])
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "text.mcap").write_text("not a run at all")
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "umlaut-ä.mcap").write_text("")
    (tmp_path / ".hidden.mcap").write_text("")
    faults = {entry.id: entry.fault for entry in Catalogue(tmp_path).runs()}
    assert set(faults) == {"good", "cut", "empty", "text"}
    assert faults["good"] == ""
    assert faults["cut"].startswith("not finished")
    assert faults["empty"].endswith("empty.mcap: is empty")
    assert faults["text"].endswith("text.mcap: is not an MCAP file (its first bytes are not MCAP's)")


def test_copy_made_by_a_file_manager_is_a_run(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    path = record("2026-11-24T09-12-07-gj90c (copy 2)", SECOND)
    catalogue = Catalogue(tmp_path)
    assert [entry.id for entry in catalogue.runs()] == [path.stem]
    assert catalogue.path(path.stem) == path


def test_growth_and_completion_of_a_run_are_noticed_at_once(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock
) -> None:
    catalogue = Catalogue(tmp_path)
    writer = RunWriter(tmp_path / "run.mcap", header)
    for k in range(100):
        writer.write_block(make_block(0, 2000 * k, 2000))
        if k == 10:
            assert 0 < catalogue.run("run").samples <= 22_000
            assert catalogue.run("run").fault.startswith("not finished")
    deadline = time.monotonic() + 20
    while catalogue.run("run").samples < 195_000:  # a growing file is read again after an interval
        assert time.monotonic() < deadline
        time.sleep(0.01)
    writer.write_segment_end(SegmentEnd(0, 200_000, EndReason.STOPPED))
    writer.close()
    entry = catalogue.run("run")
    assert (entry.samples, entry.is_complete, entry.fault) == (200_000, True, "")


def test_changed_file_is_read_again(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    path = record("run", SECOND)
    catalogue = Catalogue(tmp_path)
    assert catalogue.run("run").is_complete
    assert catalogue.run("run") is catalogue.run("run")
    path.write_bytes(path.read_bytes()[:-50])
    assert not catalogue.run("run").is_complete
    path.unlink()
    with pytest.raises(NotFoundError, match="run 'run': there is no such run"):
        catalogue.run("run")
    assert catalogue.runs() == []


@pytest.mark.parametrize(
    "run_id",
    ["../secret", "..", ".", "", "/etc/passwd", "a/b", "a\\b", "..\\secret", "secret.mcap", "C:secret", "a\0b", "a\n",
     "%2e%2e%2fsecret", "x" * 200, "…", "-"],
)  # fmt: skip
def test_invalid_id_never_reaches_the_file_system(
    tmp_path: Path, record: Callable[[str, int], Path], run_id: str
) -> None:
    secret = record("secret", SECOND)
    folder = tmp_path / "data"
    folder.mkdir()
    catalogue = Catalogue(folder)
    for method in (catalogue.path, catalogue.run, lambda invalid: catalogue.load_cached(invalid, "summary")):
        with pytest.raises(NotFoundError, match="there is no such run"):
            method(run_id)
    assert secret.exists()


def test_id_of_a_new_run_has_start_and_rig(tmp_path: Path) -> None:
    started = datetime(2026, 11, 24, 9, 12, 7, 999_999, UTC)
    run_id, path = Catalogue(tmp_path / "data" / "deep").new_run("GJ90C: bench/µm", int(started.timestamp()) * SECOND)
    local = started.astimezone()
    assert run_id == f"{local:%Y-%m-%dT%H-%M-%S}-gj90c-bench-m"
    assert path == tmp_path / "data" / "deep" / f"{run_id}.mcap"
    assert path.parent.is_dir()
    assert re.fullmatch(r"[A-Za-z0-9-]+", run_id), "Windows forbids colons"


def test_used_id_gets_a_number(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    catalogue = Catalogue(tmp_path)
    first, _ = catalogue.new_run("rig", SECOND)
    record(first, SECOND)
    second, path = catalogue.new_run("rig", SECOND)
    assert second == f"{first}-2"
    path.touch()
    third, _ = catalogue.new_run("rig", SECOND)
    assert third == f"{first}-3"
    assert {entry.id for entry in catalogue.runs()} == {first, second}


def test_rig_without_a_usable_name_gets_an_id(tmp_path: Path) -> None:
    run_id, _ = Catalogue(tmp_path).new_run("…", 0)
    assert run_id.endswith("-rig")


def test_results_are_cached_until_the_file_changes(tmp_path: Path, record: Callable[[str, int], Path]) -> None:
    path = record("run", SECOND)
    catalogue = Catalogue(tmp_path)
    assert catalogue.load_cached("run", "summary") is None
    catalogue.store_cached("run", "summary", {"speed_rpm": [1.5, 2]})
    catalogue.store_cached("run", "summary", {"speed_rpm": [1.5, 3]})
    assert Catalogue(tmp_path).load_cached("run", "summary") == {"speed_rpm": [1.5, 3]}
    assert catalogue.load_cached("run", "other") is None
    status = path.stat()
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns + SECOND))
    assert catalogue.load_cached("run", "summary") is None
    assert [entry.id for entry in catalogue.runs()] == ["run"]


def test_data_folder_is_setting_then_environment_then_default(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    before = os.environ.pop("RIG_DATA", None)
    request.addfinalizer(lambda: os.environ.update({"RIG_DATA": before} if before is not None else {}))
    request.addfinalizer(lambda: os.environ.pop("RIG_DATA", None) and None)
    assert data_folder() == Path("data")
    os.environ["RIG_DATA"] = str(tmp_path)
    assert data_folder("") == tmp_path
    assert data_folder("/runs") == Path("/runs")
    if sys.platform != "win32":
        assert data_folder("~/runs") == Path.home() / "runs"
