"""Reference frequencies and imbalance responses, computed with ROSS.

Runs in an environment of its own with ROSS installed (`make oracle`), without the model:

    .venv-oracle/bin/python tests/validation/ross/golden.py tests/validation/ross/ross.json
"""

import json
import platform
import sys
import time
import tomllib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import ross as rs
from scipy.linalg import eig

Tables = dict[str, Any]

HERE = Path(__file__).parent
MODEL = HERE.parents[2] / "model" / "rotor"
SPEEDS = (0.0, 4000.0, 8000.0)  # rad/s
SPRING = 1e4  # N/m, of the GJ90C's bearings, Table 5.3
MASSLESS = 1e-3  # kg/m³, if the shaft mass is in the discs
LATERAL = (0, 1, 3, 4)  # x, y and both slopes, of the six coordinates per station in ROSS
DOFS = 6


def matrix(value: Any) -> Any:
    """Return the 2 by 2 matrix of a value in a table."""
    return value if isinstance(value, list) else [[value, 0.0], [0.0, value]]


def bearing(node: int, stiffness: Any, damping: Any, link: int | None = None) -> Any:
    """Return a ROSS bearing from 2 by 2 matrices."""
    (kxx, kxy), (kyx, kyy) = matrix(stiffness)
    (cxx, cxy), (cyx, cyy) = matrix(damping)
    return rs.BearingElement(
        n=node, n_link=link, kxx=kxx, kxy=kxy, kyx=kyx, kyy=kyy, cxx=cxx, cxy=cxy, cyx=cyx, cyy=cyy
    )


def assemble(document: Tables, supports: list[Tables]) -> tuple[Any, int]:
    """Return the ROSS rotor and its number of shaft nodes."""
    massless = document["shaft_mass"] == "none"
    timoshenko = document["beam"] == "timoshenko"
    material = document["material"]
    steel = rs.Material(
        name="shaft",
        rho=MASSLESS if massless else material["density_kg_m3"],
        E=material["youngs_modulus_gpa"] * 1e9,
        Poisson=material.get("poissons_ratio", 0.3),
    )
    places = [station["position_mm"] * 1e-3 for station in document["station"]]
    shaft = [
        rs.ShaftElement(
            L=places[n + 1] - places[n],
            idl=2e-3 * segment.get("inner_radius_mm", 0.0),
            odl=2e-3 * segment["radius_mm"],
            material=steel,
            n=n,
            shear_effects=timoshenko,
            rotary_inertia=not massless,
            gyroscopic=not massless,
        )
        for n, segment in enumerate(document["segment"])
    ]
    discs = [
        rs.DiskElement(
            n=disc["station"] - 1,
            m=disc["mass_kg"],
            Id=disc["diametral_inertia_kg_m2"],
            Ip=disc["polar_inertia_kg_m2"],
        )
        for disc in document["disc"]
    ]
    bearings: list[Any] = []
    rings: list[Any] = []
    nodes = len(places)
    for support in supports:
        node, link = support["station"] - 1, None
        if "ring_mass_kg" in support:
            link = nodes + len(rings)
            rings.append(rs.PointMass(n=link, m=support["ring_mass_kg"]))
            bearings.append(bearing(link, support["outer_stiffness_n_m"], support.get("outer_damping_n_s_m", 0.0)))
        bearings.append(bearing(node, support["stiffness_n_m"], support.get("damping_n_s_m", 0.0), link))
    rotor = rs.Rotor(shaft, discs, bearings, point_mass_elements=rings or None)
    return rotor, nodes


def lateral_eigenvalues(rotor: Any, nodes: int, speed: float) -> Any:
    """Return the lateral eigenvalues with positive imaginary part, by frequency.

    Axial and torsional motion is removed: in a straight rotor it is not coupled to the lateral motion.
    """
    dofs = [DOFS * node + dof for node in range(nodes) for dof in LATERAL]
    rings = (rotor.ndof - DOFS * nodes) // 3
    dofs += [DOFS * nodes + 3 * ring + dof for ring in range(rings) for dof in (0, 1)]
    pick = np.ix_(dofs, dofs)
    M, K, C, G = rotor.M()[pick], rotor.K(0)[pick], rotor.C(0)[pick], rotor.G()[pick]
    n = len(dofs)
    zero, one = np.zeros((n, n)), np.eye(n)
    scale = 1e4  # 1/s: scales velocities to the size of displacements
    left = np.block([[zero, scale * one], [-K / scale, -(C + speed * G)]])
    right = np.block([[one, zero], [zero, M]])
    values = eig(left, right, right=False)
    values = values[values.imag > 1e-6 * np.abs(values)]
    return values[np.argsort(values.imag)]


def rotors() -> Iterator[tuple[str, Tables, list[Tables]]]:
    """Yield name, rotor file and supports of each rotor."""
    gj90c = tomllib.loads((MODEL / "gj90c.toml").read_text(encoding="utf-8"))
    journals = [journal["station"] for journal in gj90c["journal"]]
    yield "gj90c", gj90c, [{"station": station, "stiffness_n_m": SPRING} for station in journals]
    for name in ("pump", "turbo"):
        document = tomllib.loads((HERE / f"{name}.toml").read_text(encoding="utf-8"))
        yield name, document, document["support"]


def response(rotor: Any, nodes: int, document: Tables, speeds: tuple[float, ...]) -> list[Any]:
    """Return the response to the imbalances of a rotor file: [speed][x or y][station], real and imaginary parts."""
    found = rotor.run_unbalance_response(
        [one["station"] - 1 for one in document["imbalance"]],
        [one["magnitude_kg_m"] for one in document["imbalance"]],
        [np.radians(one.get("phase_deg", 0.0)) for one in document["imbalance"]],
        frequency=np.array(speeds),
    )
    vectors = found.forced_resp[: DOFS * nodes].reshape(nodes, DOFS, len(speeds))[:, :2]
    return [[[[v.real, v.imag] for v in vectors[:, plane, k]] for plane in (0, 1)] for k in range(len(speeds))]


def campbell_time() -> float:
    """Return the time of ROSS for the Campbell diagram of the GJ90C at 17 speeds, s, with a new rotor each time."""
    _, document, supports = next(rotors())
    speeds = np.arange(0.0, 8001.0, 500.0)
    times = []
    for _ in range(5):
        rotor, _ = assemble(document, supports)
        begin = time.perf_counter()
        rotor.run_campbell(speeds, frequencies=16)
        times.append(time.perf_counter() - begin)
    return sorted(times)[len(times) // 2]


def main(target: str) -> None:
    """Write the results of ROSS, or print its computing time if the target is "time"."""
    if target == "time":
        print(campbell_time())
        return
    golden: Tables = {
        "made_by": "tests/validation/ross/golden.py",
        "ross": version("ross-rotordynamics"),
        "numpy": np.__version__,
        "python": platform.python_version(),
        "speeds_rad_s": SPEEDS,
        "rotors": {},
    }
    for name, document, supports in rotors():
        rotor, nodes = assemble(document, supports)
        modes = [lateral_eigenvalues(rotor, nodes, speed) for speed in SPEEDS]
        golden["rotors"][name] = {
            "frequencies_hz": [list(one.imag / (2 * np.pi)) for one in modes],
            "growth_rates_per_s": [list(one.real) for one in modes],
            "response_m": response(rotor, nodes, document, SPEEDS[1:]),
        }
    Path(target).write_text(json.dumps(golden, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
