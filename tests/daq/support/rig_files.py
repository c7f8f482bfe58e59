"""The channels of test rigs, and the errors that the loader finds in their files."""

from pathlib import Path

import pytest

from daq.config.loader import load_rig
from daq.errors import ConfigError


def channels(x: dict[str, object], y: dict[str, object], tacho: dict[str, object]) -> list[dict[str, object]]:
    """Return the three channels of a rig with changes to each."""
    return [
        {"name": "x", "role": "probe_x", "physical": "ai0", "angle_deg": 45.0, "calibration": "probe-x.toml"} | x,
        {"name": "y", "role": "probe_y", "physical": "ai1", "angle_deg": 135.0, "calibration": "probe-y.toml"} | y,
        {"name": "tacho", "role": "tacho", "physical": "ai2"} | tacho,
    ]


def faults_of(path: Path) -> list[str]:
    """Return the errors in a rig file that the loader refuses."""
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    assert caught.value.file == str(path)
    assert caught.value.exit_code == 2
    return caught.value.faults
