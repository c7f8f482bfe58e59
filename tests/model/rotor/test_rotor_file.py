import copy
import math
import tomllib
from importlib.resources import files
from typing import Any

import pytest

from model.rotor.gj90c import gj90c
from model.rotor.parameters import Bow, FilmModel
from model.rotor.rotor import Beam, ShaftMass
from model.rotor.rotor_file import parse_rotor
from model.rotor.supports import Rub, StaticLoad, Support, SupportCoefficients
from model.rotor.tables import TableError

RUB = {"station": 2, "clearance_um": 50, "stiffness_n_m": 1e7}


@pytest.fixture
def document() -> dict[str, Any]:
    return tomllib.loads(files("model.rotor").joinpath("gj90c.toml").read_text(encoding="utf-8"))


def faults_of(document: dict[str, Any]) -> tuple[str, ...]:
    with pytest.raises(TableError) as caught:
        parse_rotor(document)
    assert str(caught.value) == "; ".join(caught.value.faults)
    return caught.value.faults


def test_gj90c_file_equals_the_default_rotor_exactly(document: dict[str, Any]) -> None:
    assert parse_rotor(document) == gj90c()


def test_every_unit_of_a_quantity_is_converted(document: dict[str, Any]) -> None:
    other = copy.deepcopy(document)
    other["station"][1] = {"position_um": 5000}
    other["disc"][0] = {"station": 1, "mass_g": 10, "diametral_inertia_g_mm2": 200, "polar_inertia_kg_mm2": 0.1}
    other["material"] = {"youngs_modulus_pa": 205e9}
    other["bearing"]["viscosity_cp"] = 15
    del other["bearing"]["viscosity_pa_s"]
    other["imbalance"][0] = {"station": 5, "magnitude_g_mm": 0.5}
    assert parse_rotor(other) == parse_rotor(document)


def test_walls_are_read_with_the_shaft_radius_by_default(document: dict[str, Any]) -> None:
    document["rub"] = [
        {"station": 4, "clearance_um": 60, "stiffness_n_um": 20},
        {
            "station": 2,
            "clearance_mm": 0.05,
            "stiffness_n_m": 1e7,
            "radius_mm": 22,
            "friction": 0.1,
            "damping_s_m": 0.5,
        },
    ]
    assert parse_rotor(document).rubs == (Rub(4, 60e-6, 2e7, 7e-3), Rub(2, 50e-6, 1e7, 22e-3, 0.1, 0.5))


def test_rotor_on_supports_alone_needs_neither_bearing_nor_journals(document: dict[str, Any]) -> None:
    del document["bearing"]
    document["support"] = [{"station": 3, "stiffness_n_m": 1e7}, {"station": 4, "stiffness_n_m": 1e7}]
    assert parse_rotor(document).bearing is None
    assert parse_rotor(document).rotor.journal_stations == (3, 4)  # stations for springs
    del document["journal"]
    parameters = parse_rotor(document)
    assert parameters.rotor.bearing_stations == ()
    with pytest.raises(ValueError, match=r"bearing: none, expected a rotor on oil films, with \[bearing\] in its file"):
        _ = parameters.floating_ring
    with pytest.raises(ValueError, match="journal: none, expected two stations for bearings or springs"):
        _ = parameters.rotor.journals
    document["imbalance"][0]["magnitude_kg_m"] = 1.0  # no clearance limits it
    assert parse_rotor(document).imbalances[0].magnitude == 1.0


def test_supports_loads_and_shaft_mass_are_read(document: dict[str, Any]) -> None:
    document |= {
        "beam": "timoshenko",
        "shaft_mass": "consistent",
        "material": {"youngs_modulus_gpa": 205, "density_kg_m3": 7800, "poissons_ratio": 0.29},
        "support": [
            {"station": 3, "stiffness_n_m": 1e7, "damping_n_s_m": 200},
            {
                "station": 4,
                "stiffness_n_um": [[10, 2], [-2, 8]],
                "ring_mass_g": 20,
                "outer_stiffness_n_m": 3e6,
                "outer_damping_n_s_m": [[100, 0], [0, 80]],
            },
        ],
        "load": [{"station": 2, "y_n": -5}],
    }
    document["segment"][2] |= {"inner_radius_mm": 1, "density_g_cm3": 4.5}
    document["bearing"] |= {"static_load_n": 2, "film_model": "full-sommerfeld"}
    parameters = parse_rotor(document)
    rotor = parameters.rotor
    assert (rotor.beam, rotor.shaft_mass) == (Beam.TIMOSHENKO, ShaftMass.CONSISTENT)
    assert [segment.density for segment in rotor.segments] == [7800, 7800, 4500, 7800, 7800]
    assert rotor.segments[2].inner_radius == 1e-3
    assert rotor.segments[2].poissons_ratio == 0.29
    assert parameters.loads == (StaticLoad(2, 0.0, -5.0),)
    assert parameters.floating_ring.static_load == 2.0
    assert parameters.floating_ring.film_model is FilmModel.FULL_SOMMERFELD
    film = SupportCoefficients(((3e6, 0), (0, 3e6)), ((100, 0), (0, 80)))
    assert parameters.supports == (
        Support(3, SupportCoefficients.isotropic(1e7, 200)),
        Support(4, SupportCoefficients(((1e7, 2e6), (-2e6, 8e6))), film, 0.02),
    )


@pytest.mark.parametrize(
    ("place", "changes", "message"),
    [
        (("station", 2), {"position_mm": 5}, "station[2].position: 0.005 m of station 3, expected more than 0.005 m"),
        (("segment", 1), {"radius_mm": -5}, "segment[1].radius_mm = -5 mm: expected a finite value above 0"),
        (("segment", 1), {"inner_radius_mm": 5}, "segment[1].inner_radius: 0.005 m, expected 0 to less than 0.005 m"),
        (("segment", 1), {"to": 4}, "segment[1].from = 2, to = 4: expected 2 and 3, segments join neighbouring"),
        (("segment", 1), {"lenght_mm": 4}, "segment[1].lenght_mm = 4: unknown key"),
        (("disc", 1), {"mass_kg": 0}, "disc[1].mass_kg = 0 kg: expected a finite value above 0"),
        (("disc", 1), {"station": 7}, "disc[1].station = 7: no such station, expected 1 to 6"),
        (("disc", 1), {"station": 1.5}, "disc[1].station = 1.5: expected a whole number"),
        (("disc", 1), {"mass_g": 4}, "disc[1].mass_g = 4: expected one key only, mass_kg is given already"),
        (("disc", 1), {"mass_kg": "heavy"}, "disc[1].mass_kg = heavy: expected a number"),
        (("disc", 1), {"mass_kg": float("nan")}, "disc[1].mass_kg = nan kg: expected a finite value above 0"),
        (("journal", 0), {"station": 4}, "journal[1].station = 4: expected more than 4"),
        (("journal", 1), {"station": 9}, "journal[1].station = 9: no such station, expected 1 to 6"),
        (
            ("bearing",),
            {"inner_clearance_um": -20},
            "bearing.inner_clearance_um = -20 µm: expected a finite value abov",
        ),
        (
            ("bearing",),
            {"film_model": "ocvirk"},
            'bearing.film_model = "ocvirk": expected "capone" or "full-sommerfeld"',
        ),
        (
            ("bearing",),
            {"ring_outer_radius_mm": 5},
            "bearing.ring_outer_radius: 0.005 m, expected more than the ring's",
        ),
        (("bearing",), {"viscocity_cp": 5}, "bearing.viscocity_cp = 5: unknown key, did you mean viscosity_pa_s?"),
        (("imbalance", 0), {"magnitude_kg_m": 5e-5}, "imbalance: 5e-05 kg m at station 5, expected at most 1.85e-05"),
        (("imbalance", 0), {"station": 0}, "imbalance[0].station = 0: no such station"),
        (("probes",), {"station": 7}, "probe_station: 7, expected 1 to 6"),
        (("probes",), {"angles_deg": [0]}, "probes.angles_deg = [0]: expected two numbers"),
        ((), {"beam": "rayleigh"}, 'beam = "rayleigh": expected "euler-bernoulli" or "timoshenko"'),
        ((), {"shaft_mass": "lumped"}, "density: 0 kg/m³ in segment 1, expected above 0 with shaft_mass lumped"),
        ((), {"suport": []}, "suport = []: unknown key, did you mean support?"),
        ((), {"support": [{"station": 8, "stiffness_n_m": 1e7}]}, "support[0].station = 8: no such station"),
        ((), {"support": [{"station": 3, "stiffness_n_m": 0}]}, "support[0].stiffness_n_m = 0 N/m: expected a finite"),
        (
            (),
            {"support": [{"station": 3, "stiffness_n_m": [1, 2]}]},
            "support[0].stiffness_n_m = [1, 2]: expected a nu",
        ),
        ((), {"support": [{"station": 3}]}, "support[0].stiffness_n_m: missing, expected a stiffness"),
        ((), {"rub": [RUB | {"station": 9}]}, "rub[0].station = 9: no such station, expected 1 to 6"),
        ((), {"rub": [{"station": 2}]}, "rub[0].clearance_mm: missing, expected a length"),
        ((), {"rub": [RUB | {"clearance_um": 0}]}, "rub[0].clearance_um = 0 µm: expected a finite value above 0"),
        ((), {"rub": [RUB | {"stiffness_n_m": -1}]}, "rub[0].stiffness_n_m = -1 N/m: expected a finite value above 0"),
        ((), {"rub": [RUB | {"radius_mm": 0}]}, "rub[0].radius_mm = 0 mm: expected a finite value above 0"),
        ((), {"rub": [RUB | {"friction": -0.1}]}, "rub[0].friction = -0.1: expected a finite value 0 or more"),
        ((), {"rub": [RUB | {"damping_s_m": -1}]}, "rub[0].damping_s_m = -1 s/m: expected a finite value 0 or more"),
        ((), {"rub": [RUB | {"damping_n_s_m": 1}]}, "rub[0].damping_n_s_m = 1: unknown unit n_s_m, expected damping_"),
        ((), {"rub": [RUB | {"gap_um": 1}]}, "rub[0].gap_um = 1: unknown key"),
        ((), {"rub": 3}, "rub = 3: expected tables [[rub]]"),
        ((), {"bearing": 3}, "bearing: 3, expected a table [bearing]"),
        ((), {"disc": 3}, "disc = 3: expected tables [[disc]]"),
        ((), {"journal": []}, "journal: 0, expected two tables [[journal]]"),
        ((), {"journal": [{"station": 3}]}, "journal: 1, expected two tables [[journal]]"),
        ((), {"bearings": {}}, "bearings = {}: unknown key, did you mean bearing?"),
        ((), {"station": [{"position_mm": 0}]}, "station: 1 stations, expected two or more"),
        ((), {"segment": []}, "segment: 0 segments, expected 5 between 6 stations"),
        ((), {"gravity_g": 1}, "gravity_g = 1: unknown key, did you mean gravity_m_s2?"),
    ],
)
def test_invalid_file_is_refused_with_quantity_value_and_unit(
    document: dict[str, Any], place: tuple[str | int, ...], changes: dict[str, Any], message: str
) -> None:
    table: Any = document
    for key in place:
        table = table[key]
    table |= changes
    assert any(fault.startswith(message) for fault in faults_of(document)), faults_of(document)


@pytest.mark.parametrize(
    ("place", "changes", "message"),
    [
        (("segment", 2), {"radius_mm": 10**400}, "segment[2].radius_mm = too many digits: expected a finite value"),
        (("segment", 2), {"radius_mm": 1e-300}, "segment[2].radius_mm = 1e-300 mm: expected 0.01 to 10000 mm in size"),
        (("disc", 0), {"mass_kg": 1e30}, "disc[0].mass_kg = 1e+30 kg: expected 1e-09 to 1e+06 kg in size"),
        (("bearing",), {"viscosity_pa_s": 1e-12}, "bearing.viscosity_pa_s = 1e-12 Pa s: expected 1e-07 to 1000 Pa s"),
        (("station", 5), {"position_mm": float("inf")}, "station[5].position_mm = inf mm: expected a finite value"),
        (("station", 5), {"position_mm": 85.001}, "station[5].position: 0.085001 m of station 6, expected more than"),
    ],
)
def test_implausible_size_is_refused(
    document: dict[str, Any], place: tuple[str | int, ...], changes: dict[str, Any], message: str
) -> None:
    table: Any = document
    for key in place:
        table = table[key]
    table |= changes
    (fault,) = faults_of(document)
    assert fault.startswith(message)


def test_unknown_unit_is_reported_with_the_known_units(document: dict[str, Any]) -> None:
    document["segment"][0] = {"radius_inch": 0.2}
    expected = "segment[0].radius_inch = 0.2: unknown unit inch, expected radius_mm or radius_m or radius_um"
    assert faults_of(document) == (expected,)


def test_all_faults_are_reported_together(document: dict[str, Any]) -> None:
    del document["bearing"]["length_mm"]
    document["disc"][0]["mass_kg"] = -1
    document["name"] = 3
    assert len(faults_of(document)) == 3


def test_bow_and_modal_damping_are_read(document: dict[str, Any]) -> None:
    tables = {**document, "bow": [{"station": 2, "displacement_um": 20.0, "phase_deg": 90}], "modal_damping": 0.01}
    parameters = parse_rotor(tables)
    assert parameters.modal_damping == 0.01
    assert parameters.bows == (Bow(2, 20e-6, math.radians(90)),)
    assert abs(parameters.bow_forces()).max() > 0
