"""The folder's own database is a convenience: a folder that cannot take it is no fault."""

from collections.abc import Callable
from pathlib import Path

from analysis.run import RunHeader
from analysis.samples import SampleBlock
from recordings.catalogue import Catalogue
from recordings.writer import RunWriter


def test_a_folder_that_takes_no_catalogue_is_no_fault(
    tmp_path: Path, header: RunHeader, make_block: Callable[..., SampleBlock]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.block(make_block(0, 0, 2000))
    writer.close()
    (tmp_path / ".rig").write_text("a file in its place")
    catalogue = Catalogue(tmp_path)
    assert [entry.id for entry in catalogue.runs()] == ["run"]
    catalogue.store_document("run", "summary", {"a": 1})
    assert catalogue.load_document("run", "summary") == {"a": 1}
    assert Catalogue(tmp_path).load_document("run", "summary") is None
