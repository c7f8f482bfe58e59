"""Files of every format version, as written by earlier programs, stay readable."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.integrity.recover import recover
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader

FILES = Path(__file__).parent / "files"
OLD_FILES = sorted(FILES.glob("version-*.mcap"))


def test_there_is_a_file_of_every_version() -> None:
    assert "version-1-first.mcap" in [path.name for path in OLD_FILES]


def assert_same(read: RunHeader, header: RunHeader) -> None:
    """Check the header fields of the first files; later fields have their defaults."""
    now, then = header.acquisition, read.acquisition
    assert (read.run, read.rig, read.note, read.started_ns) == (header.run, header.rig, header.note, header.started_ns)
    assert (read.limits, read.settings, read.config_toml) == (header.limits, header.settings, header.config_toml)
    assert (then.device, then.rate, then.convert_rate, then.tacho) == (
        now.device,
        now.rate,
        now.convert_rate,
        now.tacho,
    )
    for old, new in zip(then.channels, now.channels, strict=True):
        assert (old.name, old.role, old.scaling, old.angle) == (new.name, new.role, new.scaling, new.angle)
        assert (old.range_low, old.range_high) == (new.range_low, new.range_high)
        assert (old.calibration is None) == (new.calibration is None)
        if old.calibration is not None and new.calibration is not None:
            assert old.calibration.coefficients == new.calibration.coefficients
            assert old.calibration.date == new.calibration.date


@pytest.mark.parametrize("path", OLD_FILES, ids=[path.stem for path in OLD_FILES])
def test_file_of_an_earlier_program_is_read_verified_and_recovered(
    path: Path, tmp_path: Path, header: RunHeader, codes_of: Callable[..., NDArray[np.int16]]
) -> None:
    ends = (SegmentEnd(0, 2000, EndReason.OVERRUN, 55), SegmentEnd(1, 2000, EndReason.STOPPED))
    assert verify(path).is_intact
    copy = tmp_path / "copy.mcap"
    assert recover(path, copy).missing == ()
    for each in (path, copy):
        with RunReader(each) as reader:
            assert_same(reader.header, header)
            assert reader.segment_ends == ends
            assert reader.is_complete
            for segment in range(2):
                np.testing.assert_array_equal(reader.samples(segment, 0, 2000), codes_of(segment, 0, 2000))
    with RunReader(path) as reader:
        (snapshot,) = reader.snapshots()
        assert (snapshot.segment, snapshot.sample) == (0, 2000)
        assert np.isfinite(snapshot.peak_to_peak).all()
        assert np.isnan(snapshot.overall[1]).all()  # files of the first programs have no RMS
