"""Run-out compensation from rig.toml: given vectors, the run's own slow roll, or an earlier run's."""

from pathlib import Path

import numpy as np
import pytest

from analysis.signals.units import MICROMETRE
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.errors import ConfigError, UsageError
from daq.session.runout_reference import with_reference_runout
from recordings.mcap.reader import RunReader
from tests.daq.conftest import RigFactory, RigFiles
from tests.daq.support.recorded_bench import record_run

QUIET = {"run_out_um": 3.0, "speed_fluctuation": 0.0, "glitches_per_s": 0.0}


def profile(*points: tuple[float, float]) -> dict[str, object]:
    """Return [simulation] with a speed profile of points (s, r/min)."""
    return QUIET | {"profile": [{"time_s": time_s, "speed_rpm": speed_rpm} for time_s, speed_rpm in points]}


SLOW_THEN_FAST = profile((0, 600), (4, 600), (7, 6000), (8, 6000))
FAST = profile((0, 6000), (2, 6000))
VECTOR = {"x_um": 2.0, "x_lag_deg": 90.0, "y_um": 1.0, "y_lag_deg": 0.0}


def test_given_run_out_is_in_si_units_with_its_source(rig: RigFactory) -> None:
    settings = rig(runout={"vector": [VECTOR | {"sigma_um": 0.1}], "correct_orbit": True}).settings.runout
    ((order, x, y),) = settings.vectors
    assert (order, settings.from_orbit, settings.source) == (1, True, "rig.toml")
    assert x == pytest.approx(-2e-6j)
    assert y == pytest.approx(1e-6)
    assert settings.sigma == pytest.approx((1e-7, 0.0))
    assert not rig().settings.runout.is_enabled


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        ({"runout": {"vector": [VECTOR], "slow_roll_rpm": 600.0}}, "runout.vector: expected none with slow_roll_rpm"),
        ({"runout": {"from_run": "earlier"}}, 'runout.from_run = "earlier": expected slow_roll_rpm too'),
        ({"runout": {"vector": [VECTOR, VECTOR]}}, "runout.vector[1].order = 1: expected each order once"),
        ({"runout": {"vector": [VECTOR | {"order": 9}]}}, "expected at most analysis.highest_order = 8"),
        (
            {"runout": {"slow_roll_rpm": 600.0}, "tacho": {"pulses_per_revolution": 2}, "limits": {"speed_rpm": 9e3}},
            "tacho.pulses_per_revolution = 2: expected 1 with [runout]",
        ),
    ],
)
def test_contradictory_run_out_settings_are_refused(
    rig_file: RigFiles, tables: dict[str, object], expected: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(rig_file(**tables))
    assert any(expected in fault for fault in caught.value.faults)


def test_run_out_is_estimated_from_the_slow_roll_of_the_run(rig: RigFactory, tmp_path: Path) -> None:
    path = record_run(rig(simulation=SLOW_THEN_FAST, runout={"slow_roll_rpm": 700.0}), tmp_path)
    with RunReader(path) as reader:
        frames = [snapshot.frame for snapshot in reader.snapshots() if snapshot.frame is not None]
    last = frames[-1]
    assert frames[0].runout is None
    assert last.runout is not None
    assert np.abs(last.runout.vectors[0]) == pytest.approx(np.full(2, 3.0 * MICROMETRE), rel=0.1)
    assert last.compensated is not None
    assert np.abs(last.compensated[0] - last.vectors[0]) == pytest.approx(np.abs(last.runout.vectors[0]))


def test_run_out_is_taken_from_the_slow_roll_of_an_earlier_run(rig: RigFactory, tmp_path: Path) -> None:
    earlier = rig(simulation=SLOW_THEN_FAST)
    record_run(earlier, tmp_path, "earlier")
    configured = rig(simulation=FAST, runout={"slow_roll_rpm": 700.0, "from_run": "earlier", "correct_orbit": True})
    later = with_reference_runout(configured, tmp_path)
    runout = later.settings.runout
    assert runout.source == "slow roll of earlier up to 700 r/min"
    assert runout.slow_roll_speed == 0.0
    assert [order for order, _, _ in runout.vectors] == list(range(1, 9))
    assert abs(runout.vectors[0][1]) == pytest.approx(3.0 * MICROMETRE, rel=0.1)
    assert "[[runout.vector]]" in later.toml
    with RunReader(record_run(later, tmp_path, "later")) as reader:
        assert reader.header.settings.runout == runout
        frames = [snapshot.frame for snapshot in reader.snapshots() if snapshot.frame is not None]
    assert all(frame.compensated is not None and frame.compensated_orbit is not None for frame in frames)
    assert with_reference_runout(earlier, tmp_path) is earlier


def test_earlier_run_that_is_missing_or_has_no_slow_roll_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    record_run(rig(simulation=FAST), tmp_path, "fast")
    missing = rig(runout={"slow_roll_rpm": 700.0, "from_run": "missing"})
    with pytest.raises(UsageError, match=r"runout\.from_run: .*missing"):
        with_reference_runout(missing, tmp_path)
    never_slow = rig(runout={"slow_roll_rpm": 700.0, "from_run": "fast"})
    with pytest.raises(UsageError, match="fast holds no order spectrum up to 700 r/min"):
        with_reference_runout(never_slow, tmp_path)


def test_earlier_run_with_other_probe_angles_or_tacho_is_refused(rig: RigFactory, tmp_path: Path) -> None:
    record_run(rig(simulation=SLOW_THEN_FAST), tmp_path, "earlier")
    section = {"slow_roll_rpm": 700.0, "from_run": "earlier"}
    falling = rig(runout=section, tacho={"edge": "falling"})
    with pytest.raises(UsageError, match="times the rising edge of 1 marks, expected falling of 1"):
        with_reference_runout(falling, tmp_path)
    turned = rig(runout=section)
    channels = tuple(c.model_copy(update={"angle_deg": c.angle_deg + 10.0}) for c in turned.config.channel)
    turned = Rig(turned.path, turned.config.model_copy(update={"channel": channels}), turned.calibrations, turned.toml)
    with pytest.raises(UsageError, match="probe x is at 45 degrees, expected 55"):
        with_reference_runout(turned, tmp_path)
