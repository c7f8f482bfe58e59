"""`rig model`: table, JSON and plots of every study; error messages."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from daq.cli.main import main

Capture = pytest.CaptureFixture[str]
ROTOR = Path(__file__).parents[4].joinpath("docs", "model.md").read_text(encoding="utf-8")

SWEEP = ["sweep", "--vary", "viscosity_pa_s=0.01,0.02", "-o", "x.parquet"]
STUDIES = {
    "modes": ["--count", "6"],
    "campbell": ["--speeds-rad-s", "0:8000:17"],
    "critical": ["--stiffness-n-m", "1e3:1e10:8:log"],
    "response": ["--speeds-rad-s", "500:1500:3"],
    "onset": ["--speeds-rad-s", "600:1000:3"],
    "waterfall": ["--speeds-rad-s", "1000:1100:2", "--settle", "8", "--turns", "8"],
    "bifurcation": ["--speeds-rad-s", "1000:1100:2", "--settle", "8", "--turns", "8"],
    "motion": ["--speed-rad-s", "1100", "--station", "4", "--settle", "8", "--turns", "8", "--perturbation-um", "0"],
    "lubrication": ["--speeds-rad-s", "1000:3000:3"],
    "film": ["--eccentricity", "0.2,0.3"],
}


OTHER = ROTOR.split("```toml\n")[1].split("```")[0]


def document(capsys: Capture, *arguments: str) -> dict[str, list[dict[str, float]]]:
    assert main(["model", *arguments, "--json"]) == 0
    found: dict[str, list[dict[str, float]]] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.parametrize("name", STUDIES)
def test_study_prints_a_table_and_draws_labelled_axes(name: str, tmp_path: Path, capsys: Capture) -> None:
    picture = tmp_path / "out.svg"
    assert main(["model", name, *STUDIES[name], "-o", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 3
    texts = [element.text or "" for element in ET.parse(picture).iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314  # our own
    assert sum("[" in text and "]" in text for text in texts) >= 1, texts
    assert "nan" not in " ".join(lines + texts).lower().split()


@pytest.mark.parametrize("name", STUDIES)
def test_study_depends_on_the_rotor(name: str, tmp_path: Path, capsys: Capture) -> None:
    rotor = tmp_path / "rotor.toml"
    rotor.write_text(OTHER, encoding="utf-8")
    rows = document(capsys, name, str(rotor), *STUDIES[name])["rows"]
    assert rows
    assert rows != document(capsys, name, *STUDIES[name])["rows"]


def test_sweep_of_another_rotor_computes_every_quantity(tmp_path: Path, capsys: Capture) -> None:
    rotor = tmp_path / "rotor.toml"
    rotor.write_text(OTHER, encoding="utf-8")
    short = {
        "onset": ("speeds", 2),
        "whirl": ("turns", 8),
        "response": ("speed_rad_s", 900),
        "critical": ("stiffness_n_m", 1e6),
    }
    for quantity, (option, value) in short.items():
        few = ["--vary", "lowest_speed_rad_s=900", "--vary", "highest_speed_rad_s=950", "--vary", "settle_turns=8"]
        few += ["--vary", "speeds=2"] if option == "turns" else []
        arguments = [
            *(few if quantity == "whirl" else few[:4] if quantity == "onset" else []),
            "--vary",
            f"{option}={value}",
        ]
        file = tmp_path / f"{quantity}.parquet"
        arguments = ["sweep", str(rotor), "--quantity", quantity, *arguments, "-o", str(file), "--processes", "1"]
        (row,) = document(capsys, *arguments)["rows"]
        assert "fault" not in row


PLAIN = """\
station = [{ position_mm = 0 }, { position_mm = 100 }, { position_mm = 400 }]
segment = [{ radius_mm = 10 }, { radius_mm = 10 }]
disc = [
  { station = 1, mass_kg = 0.1, diametral_inertia_kg_m2 = 1e-5, polar_inertia_kg_m2 = 2e-5 },
  { station = 2, mass_kg = 2, diametral_inertia_kg_m2 = 2e-3, polar_inertia_kg_m2 = 4e-3 },
  { station = 3, mass_kg = 0.1, diametral_inertia_kg_m2 = 1e-5, polar_inertia_kg_m2 = 2e-5 },
]
support = [{ station = 1, stiffness_n_m = 1e7, damping_n_s_m = 500 }, { station = 3, stiffness_n_m = 1e7 }]
imbalance = [{ station = 2, magnitude_g_mm = 20 }]
material = { youngs_modulus_gpa = 205 }
"""


@pytest.fixture
def plain(tmp_path: Path) -> str:
    rotor = tmp_path / "plain.toml"
    rotor.write_text(PLAIN, encoding="utf-8")
    return str(rotor)


def test_rotor_without_films_is_studied_on_its_supports(plain: str, capsys: Capture) -> None:
    for name, arguments in {**STUDIES, "response": ["--speeds-rad-s", "100:900:5"]}.items():
        if name in {"modes", "campbell", "response"}:
            assert document(capsys, name, plain, *arguments)["rows"]
    rows = document(capsys, "response", plain, "--speeds-rad-s", "100:900:5", "--station", "2")["rows"]
    # A disc of 2 kg on springs and shaft: in phase with the imbalance below the critical speed, in antiphase above.
    assert rows[0]["lag_deg"] < 5
    assert "up_lag_deg" not in rows[0]


@pytest.mark.parametrize("name", ["onset", "waterfall", "bifurcation", "motion", "lubrication", "film"])
def test_film_study_of_a_rotor_without_films_is_refused(name: str, plain: str, capsys: Capture) -> None:
    assert main(["model", name, plain]) == 2
    stderr = capsys.readouterr().err
    assert stderr == "rig: bearing: none, expected a rotor on oil films, with [bearing] in its file\n"


def test_journal_study_of_a_rotor_without_journals_is_refused(plain: str, tmp_path: Path, capsys: Capture) -> None:
    sweep = ["sweep", plain, "-o", str(tmp_path / "x.parquet"), "--quantity"]
    for arguments, message in (
        (["critical", plain], "journal: none, expected two stations for bearings or springs"),
        (["modes", plain, "--stiffness-n-m", "1e6"], "journal: none, expected two stations"),
        ([*sweep, "onset", "--vary", "viscosity_pa_s=0.01,0.02"], "quantity: onset needs oil films"),
        ([*sweep, "critical", "--vary", "stiffness_n_m=1e4,1e5"], "journal: none, expected two stations"),
    ):
        assert main(["model", *arguments]) == 2
        assert message in capsys.readouterr().err


def test_fault_in_a_rotor_file_names_the_file(tmp_path: Path, capsys: Capture) -> None:
    rotor = tmp_path / "rotor.toml"
    rotor.write_text(OTHER.replace("clearance_um = 60,", "clearance_um = -60,"), encoding="utf-8")
    assert main(["model", "modes", str(rotor)]) == 2
    stderr = capsys.readouterr().err
    assert "rub[0].clearance_um = -60 µm: expected a finite value above 0" in stderr
    assert "rotor.toml" in stderr


def test_plots_of_equal_studies_are_equal(tmp_path: Path, capsys: Capture) -> None:
    for name in ("a.svg", "b.svg"):
        assert main(["model", "modes", "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert main(["model", "modes", "-o", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert main(["model", "modes", "-o", str(tmp_path / "a.pdf")]) == 0
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    capsys.readouterr()


def test_modes_are_those_of_table_5_2(capsys: Capture) -> None:
    rows = document(capsys, "modes")["rows"]
    forward = [row["frequency_hz"] for row in rows if row["frequency_hz"] > 0]
    assert forward == pytest.approx([1730.2, 5044.9, 11975.2], abs=0.06)


def test_campbell_tracks_a_branch_of_table_5_3_and_lists_critical_speeds(capsys: Capture) -> None:
    found = document(capsys, "campbell", "--speeds-rad-s", "0:8000:17")
    first_bending = [row["branch_6_hz"] for row in found["rows"]]
    assert [first_bending[0], first_bending[-1]] == pytest.approx([1731.7, 2409.3], abs=0.06)
    remarks = " ".join(map(str, found["remarks"]))
    assert "forward 135.8, 329.5; reverse 121.5, 329.3, 7,800.1" in remarks


def test_onset_of_the_default_rotor_is_found_by_bisection(capsys: Capture) -> None:
    found = document(capsys, "onset", "--speeds-rad-s", "600:1000:3")
    [remark] = [str(remark) for remark in found["remarks"]]
    # docs/model.md: the synchronous motion is unstable from 7,700 r/min, 806 rad/s, at 0.70X
    assert remark == "inner film: unstable from 800 to 1,000 rad/s, whirl at 0.70X"
    assert {str(row["film"]) for row in found["rows"]} == {"inner"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["film", "--eccentricity", "0.2,1.2"], "eccentricit"),
        (["sweep", "--vary", "oil=1,2", "-o", "x.parquet"], "vary oil: unknown, expected one of imbalance_kg_m"),
        (["sweep", "--vary", "viscosity_pa_s=0.01,0.02", "-o", "x.csv"], "expected a name that ends with .parquet"),
        (["waterfall", "--turns", "2"], "--turns 2: expected 8 or more"),
        (["modes", "nowhere.toml"], "nowhere.toml"),
        (["response", "--station", "7"], "probe_station: 7, expected 1 to 6"),
        (["waterfall", "--station", "7"], "probe_station: 7, expected 1 to 6"),
        (["motion", "--station", "7"], "probe_station: 7, expected 1 to 6"),
        (["motion", "--turns", "2"], "--turns 2: expected 8 or more"),
        (
            ["motion", "--perturbation-um", "50"],
            "perturbation: 50 µm, expected 0 or more and less than the inner clearance of 20 µm",
        ),
    ],
)
def test_invalid_arguments_are_one_message(arguments: list[str], message: str, capsys: Capture) -> None:
    assert main(["model", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error


def test_plot_of_another_format_is_refused(capsys: Capture) -> None:
    for option, arguments in (("-o/--output", ["modes", "-o"]), ("--plot", [*SWEEP, "--plot"])):
        with pytest.raises(SystemExit) as caught:
            main(["model", *arguments, "out.gif"])
        assert caught.value.code == 2
        message = f"argument {option}: out.gif: expected a name that ends with .svg, .png, .pdf"
        assert message in capsys.readouterr().err


@pytest.mark.parametrize("wrong", ["1:2", "2:1:1", "0:10:5", "a,b", "5:1:9", "1:inf:4"])
def test_invalid_range_is_refused(wrong: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        main(["model", "onset", "--speeds-rad-s", wrong])
    assert "expected" in capsys.readouterr().err


def test_missing_extra_is_named(tmp_path: Path) -> None:
    commands = [[*SWEEP, "--scheduler", "tcp://127.0.0.1:1"], SWEEP]
    code = f"""
import sys
sys.modules |= dict.fromkeys(("distributed", "pyarrow"))
from daq.cli.main import main
sys.exit(sum(main(["model", *command]) != 2 for command in {commands!r}))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    stderr = done.stderr.splitlines()
    assert done.returncode == 0, done.stderr
    assert [line.partition("install 'rig-service[")[2] for line in stderr] == ["dask]'", "formats]'"]
    assert not list(tmp_path.iterdir())


def test_sweep_prints_its_points_and_resumes(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "out.parquet"
    arguments = ["sweep", "--vary", "stiffness_n_m=1e4,1e7", "--quantity", "critical", "-o", str(file)]
    picture = tmp_path / "out.svg"
    first = document(capsys, *arguments, "--processes", "1", "--plot", str(picture))["rows"]
    assert [row["first_forward_rad_s"] for row in first] == pytest.approx([135.8, 4034.8], abs=0.06)
    assert picture.exists()
    assert document(capsys, *arguments)["rows"] == first


def test_closed_output_pipe_is_no_error() -> None:
    command = [sys.executable, "-m", "daq.cli.main", "model", "campbell", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stderr is not None
        program.stdout.close()
        assert program.stderr.read() == ""
        assert program.wait(60.0) == 130
