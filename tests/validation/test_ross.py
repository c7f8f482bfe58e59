"""Lateral frequencies, growth rates and linear response of three rotors as ROSS 2.3.0 computes them.

The numbers in ross/ross.json were written by ross/golden.py; `make oracle` recomputes them with ROSS.
"""

import json
import subprocess
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from model.linear.linear_system import LinearSystem, linear_system, whirl_modes
from model.linear.response import imbalance_response
from model.rotor.parameters import ModelParameters
from model.rotor.rotor import Beam, ShaftMass
from model.rotor.rotor_file import parse_rotor
from model.rotor.supports import Support, SupportCoefficients

HERE = Path(__file__).parent / "ross"
PYTHON = Path(__file__).parents[2] / ".venv-oracle" / "bin" / "python"
TOLERANCE = 0.1  # Hz
SPRING = 1e4  # N/m
ROTORS = ("gj90c", "pump", "turbo")


def parameters_of(name: str) -> ModelParameters:
    folder = files("model.rotor") if name == "gj90c" else HERE
    return parse_rotor(tomllib.loads(folder.joinpath(f"{name}.toml").read_text(encoding="utf-8")))


def system_of(parameters: ModelParameters) -> LinearSystem:
    springs = [Support(station, SupportCoefficients.isotropic(SPRING)) for station in parameters.rotor.bearing_stations]
    return linear_system(parameters.rotor, parameters.supports or springs)


@pytest.fixture(scope="module")
def golden() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((HERE / "ross.json").read_text(encoding="utf-8"))
    assert found["ross"] == "2.3.0"
    return found


def require_frequencies(golden: dict[str, Any], name: str) -> None:
    theirs = golden["rotors"][name]
    for number, modes in enumerate(whirl_modes(system_of(parameters_of(name)), golden["speeds_rad_s"])):
        frequencies = np.array(theirs["frequencies_hz"][number])
        assert np.abs(modes.frequencies) / (2 * np.pi) == pytest.approx(frequencies, abs=TOLERANCE, rel=0)
        growth_rates = np.array(theirs["growth_rates_per_s"][number])
        assert modes.growth_rates == pytest.approx(growth_rates, abs=0.01, rel=0)


@pytest.mark.parametrize("name", ROTORS)
def test_all_lateral_frequencies_are_those_of_ross(golden: dict[str, Any], name: str) -> None:
    assert golden["speeds_rad_s"] == [0, 4000, 8000]
    require_frequencies(golden, name)


def test_other_rotors_have_many_stations_shear_and_anisotropic_supports() -> None:
    for name in ("pump", "turbo"):
        parameters = parameters_of(name)
        assert parameters.rotor.stations >= 20
        assert parameters.rotor.beam is Beam.TIMOSHENKO
        assert parameters.rotor.shaft_mass is ShaftMass.CONSISTENT
        assert not any(support.is_undamped_isotropic for support in parameters.supports)


@pytest.mark.parametrize("name", ROTORS)
def test_imbalance_response_of_all_stations_equals_ross(golden: dict[str, Any], name: str) -> None:
    parameters = parameters_of(name)
    pairs: NDArray[np.float64] = np.array(golden["rotors"][name]["response_m"])
    theirs = pairs[..., 0] + 1j * pairs[..., 1]
    ours = imbalance_response(system_of(parameters), parameters.imbalances, golden["speeds_rad_s"][1:])
    assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()


@pytest.mark.oracle
def test_ross_reproduces_the_stored_numbers(golden: dict[str, Any], tmp_path: Path) -> None:
    recomputed = tmp_path / "ross.json"
    subprocess.run([PYTHON, HERE / "golden.py", recomputed], check=True, cwd=tmp_path, capture_output=True, timeout=300)
    found: dict[str, Any] = json.loads(recomputed.read_text(encoding="utf-8"))
    for name in ROTORS:
        for kind, tolerance in (("frequencies_hz", 0.001), ("growth_rates_per_s", 0.01), ("response_m", 1e-12)):
            old, new = (np.array(one["rotors"][name][kind][-1]) for one in (golden, found))
            assert new == pytest.approx(old, abs=tolerance, rel=1e-6)
        require_frequencies(found, name)
