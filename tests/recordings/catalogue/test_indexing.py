"""Indexing, search, annotations and sharing of a catalogue whose database can be deleted at any time."""

import math
import multiprocessing
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, TimeInRun
from analysis.signals.header import RunHeader
from analysis.signals.units import RPM
from analysis.whirl.findings import WhirlFinding
from recordings.catalogue.catalogue import Catalogue
from recordings.catalogue.entry import calibration_identity
from recordings.catalogue.run_store import Search
from recordings.errors import AnnotationError, NotFoundError, StorageError
from recordings.mcap.reader import RunReader
from recordings.mcap.results import Marker, encode_marker
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
Record = Callable[..., Path]
SECOND = 1_000_000_000

pytestmark = pytest.mark.usefixtures("database")


@pytest.fixture
def record(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> Record:
    """Return a function that writes a short run into the data folder."""

    def write(run_id: str, started_s: int = 1, note: str = "") -> Path:
        path = tmp_path / f"{run_id}.mcap"
        writer = RunWriter(path, replace(header, run=run_id, started_ns=started_s * SECOND, note=note))
        writer.write_block(make_block(0, 0, 2000))
        writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))
        writer.close()
        os.utime(path, (started_s + 100, started_s + 100))
        return path

    return write


def summarise(reader: RunReader) -> RunSummary:
    """Return a summary whose speeds and whirl follow from the start of the run: 1000 s is 1000 r/min."""
    speed = reader.header.started_ns / SECOND * RPM
    begin, end = TimeInRun(0, 1.0, 10 * speed), TimeInRun(0, 2.0, 11 * speed)
    whirl = WhirlFinding(0.48, 0.49, begin, end, 14e-6, end, is_forward=True, frames=5)
    summary = SummaryBuilder(reader.header).summary()
    return replace(summary, lowest_speed=speed, highest_speed=12 * speed, whirls=(whirl,))


def test_run_is_found_by_the_text_of_a_marker(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    writer.add_result(encode_marker(Marker(0, 1000, "oil valve opened", 7), header))
    writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))
    writer.close()
    catalogue = Catalogue(tmp_path)
    assert catalogue.search(Search(text="valve")) == []
    catalogue.index(summarise)
    assert ids([*catalogue.search(Search(text="VALVE oil"))]) == ["run"]
    assert catalogue.search(Search(text="closed")) == []


def ids(found: list[object]) -> list[str]:
    return [str(getattr(entry, "id", entry)) for entry in found]


def test_index_reports_new_changed_damaged_and_missing_files(tmp_path: Path, record: Record) -> None:
    catalogue = Catalogue(tmp_path)
    for name in ("a", "b", "c"):
        record(name)
    report = catalogue.index(summarise)
    assert (report.new, report.changed, report.missing, report.damaged) == (("a", "b", "c"), (), (), ())
    again = catalogue.index(summarise)
    assert (again.new, again.changed, again.missing, again.damaged, again.unchanged) == ((), (), (), (), 3)

    a = tmp_path / "a.mcap"
    a.write_bytes(a.read_bytes()[:-1000])
    os.utime(a, (200, 200))
    (tmp_path / "b.mcap").unlink()
    record("d")
    (tmp_path / "text.mcap").write_text("not a recording")
    os.utime(tmp_path / "text.mcap", (200, 200))
    for user in (Catalogue(tmp_path), catalogue):
        report = user.index(summarise)
        if user is not catalogue:  # the first to index updates the shared database
            assert (report.new, report.changed, report.missing) == (("d", "text"), ("a",), ("b",))
        else:
            assert (report.new, report.changed, report.missing, report.unchanged) == ((), (), (), 4)
        assert report.damaged == ("a", "text")


def test_summary_and_verdict_are_deleted_when_a_file_changes(tmp_path: Path, record: Record) -> None:
    catalogue = Catalogue(tmp_path)
    path = record("run", 1000)
    catalogue.index(summarise, verify_files=True)
    assert catalogue.run("run").verdict == "intact"
    with RunReader(path) as reader:
        assert catalogue.run("run").largest == pytest.approx(summarise(reader).largest, nan_ok=True)
    assert ids([*catalogue.search(Search(onset_below=10_001 * RPM))]) == ["run"]
    path.write_bytes(path.read_bytes()[:-1000])
    os.utime(path, (5000, 5000))
    assert catalogue.run("run").verdict == ""
    assert catalogue.run("run").largest is None
    assert catalogue.search(Search(onset_below=10_001 * RPM)) == []
    catalogue.index(summarise, verify_files=True)
    assert catalogue.run("run").verdict == "damaged"
    path.write_text("nothing")
    os.utime(path, (6000, 6000))
    catalogue.index(summarise, verify_files=True)
    assert catalogue.run("run").verdict == "unreadable"


def test_summary_of_a_file_that_changed_meanwhile_is_not_stored(tmp_path: Path, record: Record) -> None:
    path = record("run", 1000)

    def summarise_slowly(reader: RunReader) -> RunSummary:
        os.utime(path, (7000, 7000))
        assert ids([*Catalogue(tmp_path).runs()]) == ["run"], "another catalogue reads the changed file"
        return summarise(reader)

    catalogue = Catalogue(tmp_path)
    catalogue.index(summarise_slowly)
    assert catalogue.search(Search(onset_below=10_001 * RPM)) == []
    catalogue.index(summarise)
    assert ids([*catalogue.search(Search(onset_below=10_001 * RPM))]) == ["run"]


def test_interrupted_index_stores_the_summaries_so_far(tmp_path: Path, record: Record) -> None:
    for name, started_s in (("late", 2000), ("early", 1000)):
        record(name, started_s)

    def summarise_once(reader: RunReader) -> RunSummary:
        if reader.path.stem == "early":
            raise KeyboardInterrupt
        return summarise(reader)

    with pytest.raises(KeyboardInterrupt):
        Catalogue(tmp_path).index(summarise_once)
    assert ids([*Catalogue(tmp_path).search(Search(onset_below=30_000 * RPM))]) == ["late"]


def test_search_applies_every_criterion(tmp_path: Path, record: Record) -> None:
    catalogue = Catalogue(tmp_path)
    for name, started_s, note in (
        ("slow", 100, "Cold oil 20 %"),
        ("middle", 500, "warm oil"),
        ("fast", 1000, "WARM_oil"),
    ):
        record(name, started_s, note=note)
    catalogue.index(summarise)
    catalogue.annotate("slow", tags=["reference", "good"], remark="bearing new")
    catalogue.annotate("fast", tags=["good"])

    def found(search: Search) -> set[str]:
        listed = [entry.id for entry in catalogue.search(search)]
        assert len(listed) == len(set(listed))
        return set(listed)

    everything = {"slow", "middle", "fast"}
    assert found(Search()) == everything
    assert [entry.id for entry in catalogue.search(Search())] == ["fast", "middle", "slow"]
    assert found(Search(started_from_ns=500 * SECOND)) == {"middle", "fast"}
    assert found(Search(started_before_ns=500 * SECOND)) == {"slow"}
    assert found(Search(speed_low=5999 * RPM)) == {"middle", "fast"}
    assert found(Search(speed_high=999 * RPM)) == {"slow", "middle"}
    assert found(Search(speed_low=1100 * RPM, speed_high=1300 * RPM)) == {"slow", "middle", "fast"}
    assert found(Search(text="oil")) == everything
    assert found(Search(text="OIL warm")) == {"middle", "fast"}
    assert found(Search(text="20 %")) == {"slow"}
    assert found(Search(text="m_o")) == {"fast"}, "_ is no wildcard"
    assert found(Search(text="bearing")) == {"slow"}
    assert found(Search(tags=("good",))) == {"slow", "fast"}
    assert found(Search(tags=("good", "reference"))) == {"slow"}
    assert found(Search(onset_below=5001 * RPM)) == {"slow", "middle"}
    assert found(Search(is_complete=False)) == set()
    assert found(Search(text="'; DROP TABLE rig_run; --")) == set()
    assert found(Search(text="oil", tags=("good",), onset_below=9000 * RPM)) == {"slow"}


def test_annotations_are_stored_beside_the_run_and_seen_by_other_catalogues(tmp_path: Path, record: Record) -> None:
    before = record("run").read_bytes()
    one, other = Catalogue(tmp_path), Catalogue(tmp_path)
    assert other.run("run").tags == ()
    entry = one.annotate("run", remark="  oil changed ", tags=["b", "a", "b"])
    assert (entry.remark, entry.tags) == ("oil changed", ("a", "b"))
    assert one.annotate("run", tags=["c"]).remark == "oil changed"
    assert other.run("run").tags == ("c",)
    assert [entry.tags for entry in other.runs()] == [("c",)]
    assert (tmp_path / "run.mcap").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != ".rig") == ["run.mcap", "run.notes.json"]
    (tmp_path / "run.notes.json").unlink()
    assert one.run("run").tags == other.run("run").tags == ()


@pytest.mark.parametrize("tag", ["", " ", " a", "a\n", "x" * 65])
def test_invalid_tag_is_an_error(tmp_path: Path, record: Record, tag: str) -> None:
    record("run")
    with pytest.raises(AnnotationError, match="tag: "):
        Catalogue(tmp_path).annotate("run", tags=["good", tag])
    assert not (tmp_path / "run.notes.json").exists()


def test_annotating_an_unknown_run_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError):
        Catalogue(tmp_path).annotate("run", tags=["good"])
    with pytest.raises(NotFoundError):
        Catalogue(tmp_path).annotate("../run", tags=["good"])


@pytest.mark.parametrize("text", ["", "[]", "{", '{"tags": 3, "remark": ""}', '{"remark": ""}'])
def test_damaged_annotations_are_empty(tmp_path: Path, record: Record, text: str) -> None:
    record("run")
    (tmp_path / "run.notes.json").write_text(text)
    assert Catalogue(tmp_path).run("run").tags == ()


def test_deleted_database_is_built_again_from_the_files(tmp_path: Path, record: Record, database: str) -> None:
    catalogue = Catalogue(tmp_path)
    for k, name in enumerate(("a", "b", "c")):
        record(name, 100 * (k + 1))
    catalogue.annotate("b", tags=["good"], remark="a remark")
    catalogue.index(summarise, verify_files=True)
    before = catalogue.runs()
    wanted = Search(onset_below=2001 * RPM, tags=("good",))
    found = catalogue.search(wanted)
    assert ids([*found]) == ["b"]
    if database == "sqlite":
        (tmp_path / ".rig" / "catalogue.sqlite").unlink()
        (tmp_path / ".rig" / "catalogue.sqlite").write_bytes(b"not a database, but long enough to look like one" * 100)
    else:
        from sqlalchemy import create_engine  # noqa: PLC0415  # to change the database behind the catalogue

        from recordings.catalogue.database import METADATA  # noqa: PLC0415

        engine = create_engine(os.environ["RIG_CATALOGUE"])
        METADATA.drop_all(engine)
        engine.dispose()
    fresh = Catalogue(tmp_path)
    fresh.index(summarise, verify_files=True)
    assert fresh.runs() == before
    assert fresh.search(wanted) == found


def test_database_of_another_version_is_built_again(tmp_path: Path, record: Record) -> None:
    from sqlalchemy import create_engine, text  # noqa: PLC0415  # to change the database behind the catalogue

    record("run")
    Catalogue(tmp_path).index(summarise)
    url = os.environ.get("RIG_CATALOGUE") or f"sqlite:///{tmp_path / '.rig' / 'catalogue.sqlite'}"
    engine = create_engine(url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE rig_schema SET version = 0"))
        connection.execute(text("ALTER TABLE rig_run DROP COLUMN remark"))
    engine.dispose()
    assert Catalogue(tmp_path).index(summarise).new == ("run",)


def test_equal_calibrations_have_equal_identities(header: RunHeader) -> None:
    x, y, tacho = header.acquisition.channels
    assert x.calibration is not None
    other = replace(x, calibration=replace(x.calibration, date="2026-03-03"))
    same = calibration_identity(header.acquisition)
    assert same == calibration_identity(replace(header.acquisition, rate=1.0))
    assert same != calibration_identity(replace(header.acquisition, channels=(other, y, tacho)))


def use_catalogue(folder: Path, number: int) -> None:
    """List, annotate, index and cache results, five times."""
    catalogue = Catalogue(folder)
    for k in range(5):
        entries = catalogue.runs()
        catalogue.annotate(entries[k % len(entries)].id, tags=[*entries[k % len(entries)].tags, f"tag-{number}-{k}"])
        catalogue.store_cached(entries[0].id, f"result-{number}", {"k": k})
        catalogue.index(summarise)
        catalogue.search(Search(text="oil"))


def test_several_processes_share_a_catalogue(tmp_path: Path, record: Record) -> None:
    for k in range(5):
        record(f"run-{k}", k + 1)
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=use_catalogue, args=(tmp_path, number)) for number in range(2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [process.exitcode for process in processes] == [0, 0]
    catalogue = Catalogue(tmp_path)
    assert len(catalogue.runs()) == 5
    assert [catalogue.load_cached("run-4", f"result-{number}") for number in range(2)] == [{"k": 4}] * 2
    assert len(catalogue.search(Search(onset_below=math.inf))) == 5


def test_unreachable_database_is_reported_without_its_password(tmp_path: Path, record: Record) -> None:
    record("run")
    catalogue = Catalogue(tmp_path, "postgresql+psycopg://rig:secret@127.0.0.1:1/none")
    with pytest.raises(
        StorageError, match=r"catalogue postgresql\+psycopg://rig:\*\*\*@127\.0\.0\.1:1/none: "
    ) as caught:
        catalogue.runs()
    assert "secret" not in str(caught.value)
    catalogue.store_cached("run", "summary", {})
    assert catalogue.load_cached("run", "summary") is None
    assert catalogue.path("run").exists()
    with pytest.raises(StorageError, match="catalogue"):
        Catalogue(tmp_path, "nonsense").runs()
