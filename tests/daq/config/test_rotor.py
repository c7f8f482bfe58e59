"""The rotor that rig.toml names: reading, checking, and embedding in recordings."""

import math
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest

from daq.config.loader import load_rig, read_recorded_config
from daq.config.rig import Rig, default_rotor, model_parameters
from daq.errors import ConfigError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import Imbalance

RigFiles = Callable[..., Path]
RigFactory = Callable[..., Rig]

GJ90C = files("model.rotor").joinpath("gj90c.toml").read_text(encoding="utf-8")
PROBE_ANGLES = (math.pi / 4, 3 * math.pi / 4)  # of the test rig's probes


def beside(rig: Path, text: str) -> Path:
    rig.with_name("rotor.toml").write_text(text, encoding="utf-8")
    return rig


def faults_of(path: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_rig(path)
    return caught.value.faults


def test_rig_without_a_rotor_has_the_default_one(rig: RigFactory) -> None:
    assert model_parameters(rig().config) == gj90c(probe_angles=PROBE_ANGLES)


def test_rotor_file_is_relative_to_the_rig_and_embedded_in_the_recording(rig_file: RigFiles) -> None:
    path = beside(rig_file(model={"rotor": "rotor.toml"}), GJ90C.replace("mass_kg = 0.07", "mass_kg = 0.08"))
    loaded = load_rig(path)
    path.with_name("rotor.toml").unlink()
    for parameters in (
        model_parameters(loaded.config),
        model_parameters(read_recorded_config(loaded.toml, "a recording")),
    ):
        assert parameters.rotor.discs[4].mass == 0.08
        assert parameters.probe_angles == pytest.approx(PROBE_ANGLES)


def test_default_rotor_is_embedded_in_the_recording(rig: RigFactory) -> None:
    assert read_recorded_config(rig().toml, "a recording").rotor == default_rotor()


def test_recording_without_a_rotor_has_the_default_one(rig: RigFactory) -> None:
    old = rig().config.model_copy(update={"rotor": {}})
    assert model_parameters(old) == gj90c(probe_angles=PROBE_ANGLES)


def test_model_section_overrides_the_rotor_file(rig_file: RigFiles) -> None:
    more = GJ90C + "\n[[imbalance]]\nstation = 2\nmagnitude_g_mm = 0.1\nphase_deg = 90\n"
    changes = {"imbalance_kg_m": 2e-7, "inner_clearance_um": 25.0}
    parameters = model_parameters(load_rig(beside(rig_file(model={"rotor": "rotor.toml"} | changes), more)).config)
    assert parameters.imbalances == (Imbalance(5, 2e-7), Imbalance(2, 1e-7, math.pi / 2))
    assert parameters.floating_ring.inner_clearance == pytest.approx(25e-6)
    assert parameters.floating_ring.outer_clearance == 80e-6


def test_rotor_errors_name_the_file(rig_file: RigFiles) -> None:
    wrong = GJ90C.replace("mass_kg = 0.07", "mass_kg = -0.07").replace("radius_mm = 4", "radius_inch = 4")
    faults = faults_of(beside(rig_file(model={"rotor": "rotor.toml"}, storage={"reserve_gb": -1.0}), wrong))
    units = "radius_mm or radius_m or radius_um"
    assert faults == [
        "storage.reserve_gb = -1.0: expected at least 0",
        f'model.rotor = "rotor.toml": segment[2].radius_inch = 4: unknown unit inch, expected {units}',
        'model.rotor = "rotor.toml": disc[4].mass_kg = -0.07 kg: expected a finite value above 0',
    ]


def test_rotor_without_films_is_refused(rig_file: RigFiles) -> None:
    bare = GJ90C.split("[bearing]")[0] + "[[imbalance]]" + GJ90C.split("[[imbalance]]")[1]
    (fault,) = faults_of(beside(rig_file(model={"rotor": "rotor.toml"}), bare))
    assert fault.endswith("bearing: none, expected a rotor on oil films, with [bearing] in its file")


def test_unreadable_rotor_file_is_an_error_of_the_rig(rig_file: RigFiles) -> None:
    path = rig_file(model={"rotor": "rotor.toml"})
    assert faults_of(path) == ['model.rotor = "rotor.toml": no such file']
    assert faults_of(beside(path, "radius 5"))[0].startswith('model.rotor = "rotor.toml": not TOML: ')


def test_rotor_may_be_in_the_rig_file_but_not_twice(rig_file: RigFiles) -> None:
    assert model_parameters(load_rig(rig_file(rotor=default_rotor())).config) == gj90c(probe_angles=PROBE_ANGLES)
    (fault,) = faults_of(beside(rig_file(rotor=default_rotor(), model={"rotor": "rotor.toml"}), GJ90C))
    assert fault == 'model.rotor = "rotor.toml": expected none beside the file\'s own [rotor]'
