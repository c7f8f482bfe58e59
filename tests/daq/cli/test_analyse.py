"""`rig analyse`: the options of each kind, and runs without tacho pulses."""

import re
from pathlib import Path
from typing import Literal, get_origin

import pytest

from daq.cli.main import main
from daq.config.loader import load_rig
from daq.config.toml_files import to_toml
from daq.reports.registry import KINDS
from tests.daq.conftest import CALIBRATION, TABLES, merged
from tests.daq.support.recorded_bench import RUN, record_run

WITHOUT_TACHO = {"overall", "frequency-spectrum"}


@pytest.fixture(scope="module")
def silent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("silent")
    for name in ("probe-x.toml", "probe-y.toml"):
        (folder / name).write_text(to_toml({"calibration": CALIBRATION}), encoding="utf-8")
    profile = [{"time_s": time, "speed_rpm": 6000.0} for time in (0.0, 1.0)]
    simulation = {"miswiring": "tacho silent", "profile": profile}
    (folder / "rig.toml").write_text(to_toml(merged(TABLES, {"simulation": simulation})), encoding="utf-8")
    record_run(load_rig(folder / "rig.toml"), folder, RUN)
    return folder


def test_run_without_tacho_allows_analyses_that_need_none(silent: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for kind in KINDS:
        code = main(["analyse", kind, RUN, "--folder", str(silent)])
        output = capsys.readouterr()
        if kind in WITHOUT_TACHO:
            assert code == 0
            assert RUN in output.out
        else:
            assert code == 1, kind
            assert output.err.startswith("rig: ")
            assert re.search("tacho|speed is unknown", output.err)
            assert len(output.err.splitlines()) == 1


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_help_of_every_kind_lists_its_options(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["analyse", kind, "--help"])
    assert ended.value.code == 0
    output = " ".join(capsys.readouterr().out.split())
    for field, info in KINDS[kind].parameters.model_fields.items():
        has_choice = field != "format" and get_origin(info.annotation) is not Literal  # not a single source
        assert (f"--{field.replace('_', '-')}" in output) == has_choice
    assert "404" not in output
    assert "`" not in output
