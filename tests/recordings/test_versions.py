"""Files of every format version, kept as they were written then, stay readable."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.run import RunHeader
from analysis.samples import EndReason, SegmentEnd
from recordings.reader import RunReader
from recordings.recover import recover
from recordings.verify import verify

FILES = Path(__file__).parent / "files"
KEPT = sorted(FILES.glob("version-*.mcap"))


def test_a_file_of_every_version_is_kept() -> None:
    assert "version-1-first.mcap" in [path.name for path in KEPT]


@pytest.mark.parametrize("path", KEPT, ids=[path.stem for path in KEPT])
def test_a_file_of_an_earlier_program_is_read_verified_and_recovered(
    path: Path, tmp_path: Path, header: RunHeader, codes_of: Callable[..., NDArray[np.int16]]
) -> None:
    ends = (SegmentEnd(0, 2000, EndReason.OVERRUN, 55), SegmentEnd(1, 2000, EndReason.STOPPED))
    assert verify(path).is_sound
    copy = tmp_path / "copy.mcap"
    assert recover(path, copy).missing == ()
    for each in (path, copy):
        with RunReader(each) as reader:
            assert reader.header == header
            assert reader.segment_ends == ends
            assert reader.is_complete
            for segment in range(2):
                np.testing.assert_array_equal(reader.samples(segment, 0, 2000), codes_of(segment, 0, 2000))
    with RunReader(path) as reader:
        assert [(snapshot.segment, snapshot.sample) for snapshot in reader.snapshots()] == [(0, 2000)]
