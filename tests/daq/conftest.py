"""Fixtures for tests of daq: small rigs, written as TOML files and loaded by the program's own loader."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.toml_files import to_toml

CALIBRATION: dict[str, object] = {
    "coefficients_um": [12.0, 96.5, 0.55, -0.03],
    "volts_low": 0.2,
    "volts_high": 9.8,
    "residual_um": 1.2,
    "sensor": "1U1-4711",
    "conditioner": "KD2306-0815",
    "date": "2026-11-20",
}

TABLES: dict[str, object] = {
    "rig": "test-rig",
    "timing": {"rate_hz": 20_000.0, "block_s": 0.1, "buffer_s": 2.0},
    "tacho": {"threshold_v": 2.15, "hysteresis_v": 1.0},
    "simulation": {
        "pace": "flat out",
        "profile": [{"time_s": 0.0, "speed_rpm": 6000.0}, {"time_s": 2.0, "speed_rpm": 6000.0}],
    },
    "channel": [
        {"name": "x", "role": "probe_x", "physical": "ai0", "angle_deg": 45.0, "calibration": "probe-x.toml"},
        {"name": "y", "role": "probe_y", "physical": "ai1", "angle_deg": 135.0, "calibration": "probe-y.toml"},
        {"name": "tacho", "role": "tacho", "physical": "ai2"},
    ],
}

RigFiles = Callable[..., Path]
RigFactory = Callable[..., Rig]


def merged(base: Mapping[str, object], overrides: Mapping[str, object]) -> dict[str, object]:
    """Return nested tables with overrides applied; lists are replaced, None removes a key."""
    result = dict(base)
    for key, value in overrides.items():
        nested = result.get(key)
        if value is None:
            result.pop(key, None)
        elif isinstance(value, Mapping) and isinstance(nested, Mapping):
            result[key] = merged(nested, value)
        else:
            result[key] = value
    return result


@pytest.fixture
def rig_file(tmp_path: Path) -> RigFiles:
    """Write rig.toml and calibrations, return its path: ``rig_file(timing={"rate_hz": 1e4}, calibration={...})``."""

    def write(*, calibration: Mapping[str, object] | None = None, **overrides: object) -> Path:
        record = to_toml({"calibration": merged(CALIBRATION, calibration or {})})
        for name in ("probe-x.toml", "probe-y.toml"):
            (tmp_path / name).write_text(record, encoding="utf-8")
        path = tmp_path / "rig.toml"
        path.write_text(to_toml(merged(TABLES, overrides)), encoding="utf-8")
        return path

    return write


@pytest.fixture
def rig(rig_file: RigFiles) -> RigFactory:
    """Load a small simulated rig; keywords override sections of its rig.toml: ``rig(simulation={"seed": 1})``."""

    def load(*, calibration: Mapping[str, object] | None = None, **overrides: object) -> Rig:
        return load_rig(rig_file(calibration=calibration, **overrides))

    return load
