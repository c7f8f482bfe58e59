"""Cache of compiled code: nothing is compiled at the second start, also for an installed program."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COUNTED = """
from numba.core import event
with event.install_recorder("numba:compile") as compiled:
    {act}
print(len(compiled.buffer))
"""
ONE_FORCE = "from model.films.film_kernels import capone_force; capone_force(1e-6, 0j, 20e-6, 100.0, 1.0)"
FORCES = """
    import numpy as np
    from model.dynamics.condensed import film_derivatives
    from model.rotor.gj90c import gj90c
    from model.dynamics.modal_system import ModalSystem
    from model.films.film_kernels import FORCE_LAWS
    films = ModalSystem.from_parameters(gj90c()).films
    slopes, bodies = np.zeros((4, 4, 2), complex), np.full((2, 4), 1e-6 + 0j)
    for law in FORCE_LAWS.values():
        film_derivatives(films._replace(law=law), 2, 1000.0, 1j, bodies, slopes)
"""
WHOLE_START = """
    import numpy as np
    from analysis.signals.header import AnalysisSettings
    from model.rotor.gj90c import gj90c
    from model.prediction.prediction_map import refine
    from model.prediction.prediction_map import compute_prediction_map
    from model.dynamics.synchronous import synchronous_response
    synchronous_response(gj90c(), 1000.0)
    settings = AnalysisSettings(revolutions=4)
    known = compute_prediction_map(gj90c(), np.array([500.0, 520.0]), settings, lambda _done, _total: None)
    assert len(list(refine(gj90c(), 511.0, known, settings))) > 1
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """The installed packages in a folder that is not writable, not even for root."""
    for package in ("model", "analysis"):
        folder = tmp_path / "site-packages" / package
        shutil.copytree(ROOT / package, folder, ignore=shutil.ignore_patterns("__pycache__"))
        for place in {source.parent for source in folder.rglob("*.py")}:
            (place / "__pycache__").write_text("a file, where the folder for compiled code would be", encoding="utf-8")
    return tmp_path / "site-packages"


def compilations(act: str, site: Path, home: Path, work: Path) -> int:
    """Number of compilations in a new process of that user."""
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(site), "HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    environment |= {"LOCALAPPDATA": str(home / "cache")}
    program = [sys.executable, "-c", COUNTED.format(act=act)]
    ended = subprocess.run(program, cwd=work, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 0, ended.stderr
    return int(ended.stdout)


def test_second_start_of_an_installed_program_compiles_nothing(site: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    assert compilations(WHOLE_START, site, home, tmp_path) > 0
    assert any(home.rglob("*.nbi"))
    assert compilations(WHOLE_START, site, home, tmp_path) == 0


def test_change_of_an_imported_file_invalidates_the_cache(site: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    assert compilations(FORCES, site, home, tmp_path) > 0
    assert compilations(FORCES, site, home, tmp_path) == 0
    changed = site / "model" / "films" / "film_kernels.py"
    text = changed.read_text(encoding="utf-8")
    changed.write_text(text.replace("scale = -factor * s / u", "scale = -2 * factor * s / u"), encoding="utf-8")
    assert compilations(FORCES, site, home, tmp_path) > 0


def test_program_runs_without_a_writable_cache(site: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.write_text("no folder", encoding="utf-8")
    assert compilations(ONE_FORCE, site, home, tmp_path) > 0
    assert compilations(ONE_FORCE, site, home, tmp_path) > 0
