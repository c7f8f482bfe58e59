"""Parser for rotor.toml: validated model parameters in SI units. `docs/model.md` describes the format."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from model.errors import ParameterError
from model.rotor.parameters import GRAVITY, Bow, FilmModel, FloatingRing, Imbalance, ModelParameters
from model.rotor.rotor import Beam, Disc, Rotor, Segment, ShaftMass
from model.rotor.supports import Rub, StaticLoad, Support, SupportCoefficients
from model.rotor.tables import Table, TableError

T = TypeVar("T")

MIN_STATION_DISTANCE = 1e-5  # m, between neighbouring stations


@dataclass(frozen=True, slots=True)
class _Material:
    youngs_modulus: float
    density: float
    poissons_ratio: float


def parse_rotor(tables: Mapping[str, object]) -> ModelParameters:
    """Return the model parameters described by a rotor file.

    Parameters
    ----------
    tables : mapping
        Content of a rotor.toml as `tomllib` returns it.

    Returns
    -------
    ModelParameters
        Rotor, floating rings, linear supports, walls, imbalances, loads and probes.

    Raises
    ------
    TableError
        All faults: unknown keys (with the closest match) and units, missing quantities, sizes that
        are not above 0, stations out of order, supports, walls, discs or imbalances at no station, an imbalance
        beyond the clearance.
    """
    faults: list[str] = []
    root = Table(tables, "", faults)
    root.text("name", "")
    gravity = root.number("gravity", "acceleration", GRAVITY, "not negative")
    rotor = _rotor(root, faults)
    bearing = _bearing(root, faults)
    last = rotor.stations if rotor is not None else 0
    imbalances = [_imbalance(table, last) for table in root.tables("imbalance")]
    loads = [_load(table, last, faults) for table in root.tables("load")]
    supports = [_support(table, last, faults) for table in root.tables("support")]
    rubs = [_rub(table, rotor, last, faults) for table in root.tables("rub")]
    bows = [_bow(table, last, faults) for table in root.tables("bow")]
    modal_damping = root.number("modal_damping", "number", 0.0, "not negative")
    probe_station, probe_angles = 1, (0.0, math.pi / 2)
    probes = root.table("probes", required=False)
    if probes is not None:
        probe_station = probes.integer("station", 1)
        probe_angles = probes.numbers("angles", "angle", probe_angles)
        probes.report_unknown_keys()
    root.report_unknown_keys()
    if faults or rotor is None:
        raise TableError(faults)
    try:
        return ModelParameters(
            rotor=rotor,
            bearing=bearing,
            imbalances=tuple(imbalances),
            gravity=gravity,
            probe_station=probe_station,
            probe_angles=probe_angles,
            loads=tuple(one for one in loads if one is not None),
            supports=tuple(one for one in supports if one is not None),
            rubs=tuple(one for one in rubs if one is not None),
            bows=tuple(one for one in bows if one is not None),
            modal_damping=modal_damping,
        )
    except ParameterError as error:
        raise TableError([str(error)]) from error


def _build(table: Table, faults: list[str], make: Callable[[], T]) -> T | None:
    """Return the object built from a table; None if the table has faults. A ParameterError becomes a fault."""
    before = len(faults)
    table.report_unknown_keys()
    if len(faults) > before:
        return None
    try:
        return make()
    except ParameterError as error:
        table.fault(str(error))
        return None


def _rotor(root: Table, faults: list[str]) -> Rotor | None:
    before = len(faults)
    beam = Beam(root.text("beam", Beam.EULER_BERNOULLI.value, [one.value for one in Beam]))
    shaft_mass = ShaftMass(root.text("shaft_mass", ShaftMass.NONE.value, [one.value for one in ShaftMass]))
    material = _material(root)
    positions = _positions(root)
    segments = _segments(root, positions, material, faults)
    discs = [_disc(table, len(positions), faults) for table in root.tables("disc")]
    journals = _journals(root, len(positions))
    if len(faults) > before:
        return None
    try:
        return Rotor(
            segments=tuple(one for one in segments if one is not None),
            discs=tuple(one for one in discs if one is not None),
            bearing_stations=journals,
            shaft_mass=shaft_mass,
            beam=beam,
        )
    except ParameterError as error:
        root.fault(str(error))
        return None


def _material(root: Table) -> _Material | None:
    table = root.table("material", required=False)
    if table is None:
        return None
    found = _material_of(table, None)
    table.report_unknown_keys()
    return found


def _material_of(table: Table, usual: _Material | None) -> _Material:
    return _Material(
        youngs_modulus=table.number("youngs_modulus", "modulus", usual.youngs_modulus if usual else None),
        density=table.number("density", "density", usual.density if usual else 0.0, "not negative"),
        poissons_ratio=table.number("poissons_ratio", "number", usual.poissons_ratio if usual else 0.3, "not negative"),
    )


def _positions(root: Table) -> list[float]:
    positions: list[float] = []
    for number, table in enumerate(root.tables("station"), 1):
        position = table.number("position", "length", limit="any")
        table.report_unknown_keys()
        if positions and position < positions[-1] + MIN_STATION_DISTANCE:
            table.fault(
                f"position: {position:g} m of station {number}, expected more than {positions[-1]:g} m, where station "
                f"{number - 1} is, by {MIN_STATION_DISTANCE:g} m at least: stations must be in order along the axis"
            )
            position = positions[-1] + MIN_STATION_DISTANCE  # avoids follow-up faults
        positions.append(position)
    if len(positions) < 2:
        root.fault(f"station: {len(positions)} stations, expected two or more tables [[station]]")
    return positions


def _segments(
    root: Table, positions: list[float], material: _Material | None, faults: list[str]
) -> list[Segment | None]:
    tables = root.tables("segment")
    if len(tables) != len(positions) - 1 and len(positions) >= 2:
        root.fault(f"segment: {len(tables)} segments, expected {len(positions) - 1} between {len(positions)} stations")
    segments: list[Segment | None] = []
    for number, table in enumerate(tables, 1):
        start, end = table.integer("from", number), table.integer("to", number + 1)
        if (start, end) != (number, number + 1):
            table.fault(
                f"from = {start}, to = {end}: expected {number} and {number + 1}, segments join neighbouring stations "
                "in order"
            )
        radius = table.number("radius", "radius")
        inner_radius = table.number("inner_radius", "radius", 0.0, "not negative")
        own = _material_of(table, material)
        if number >= len(positions):
            table.report_unknown_keys()
            continue
        length = float(f"{positions[number] - positions[number - 1]:.12g}")  # 30 mm - 5 mm = 25 mm, without rounding
        make = partial(Segment, length, radius, inner_radius, own.youngs_modulus, own.density, own.poissons_ratio)
        segments.append(_build(table, faults, make))
    return segments


def _station(table: Table, last: int) -> int:
    station = table.integer("station")
    if last and not 1 <= station <= last:
        table.fault(f"station = {station}: no such station, expected 1 to {last}")
    return station


def _disc(table: Table, last: int, faults: list[str]) -> Disc | None:
    station = _station(table, last)
    mass = table.number("mass", "mass")
    diametral = table.number("diametral_inertia", "moment of inertia")
    polar = table.number("polar_inertia", "moment of inertia")
    return _build(table, faults, lambda: Disc(station, mass, diametral, polar))


def _journals(root: Table, last: int) -> tuple[int, ...]:
    """Return the stations of the two journals; empty for a rotor without bearings and journals."""
    stations = []
    for table in root.tables("journal"):
        stations.append(table.integer("station"))
        table.report_unknown_keys()
    if not stations and not root.has("bearing"):
        return ()
    if len(stations) != 2:
        root.fault(f"journal: {len(stations)}, expected two tables [[journal]], each with a station")
        return 1, 2
    for number, station in enumerate(stations):
        if last and not 1 <= station <= last:
            root.fault(f"journal[{number}].station = {station}: no such station, expected 1 to {last}")
    first, second = stations
    if first >= second:
        root.fault(f"journal[1].station = {second}: expected more than {first}, the first journal's")
    return first, second


def _bearing(root: Table, faults: list[str]) -> FloatingRing | None:
    table = root.table("bearing", required=False)
    if table is None:
        return None
    length = table.number("length", "length")
    journal_radius = table.number("journal_radius", "radius")
    inner, outer = table.number("inner_clearance", "length"), table.number("outer_clearance", "length")
    ring_radius = table.number("ring_outer_radius", "radius")
    ring_mass, viscosity = table.number("ring_mass", "mass"), table.number("viscosity", "viscosity")
    load = table.number("static_load", "force", 0.0, "any")
    film_model = FilmModel(table.text("film_model", FilmModel.CAPONE.value, [one.value for one in FilmModel]))
    return _build(
        table,
        faults,
        lambda: FloatingRing(length, journal_radius, inner, outer, ring_radius, ring_mass, viscosity, load, film_model),
    )


def _imbalance(table: Table, last: int) -> Imbalance:
    station = _station(table, last)
    magnitude = table.number("magnitude", "imbalance", limit="not negative")
    phase = table.number("phase", "angle", 0.0, "any")
    table.report_unknown_keys()
    return Imbalance(station, magnitude, phase)


def _load(table: Table, last: int, faults: list[str]) -> StaticLoad | None:
    station = _station(table, last)
    x, y = table.number("x", "force", 0.0, "any"), table.number("y", "force", 0.0, "any")
    return _build(table, faults, lambda: StaticLoad(station, x, y))


def _bow(table: Table, last: int, faults: list[str]) -> Bow | None:
    station, displacement = _station(table, last), table.number("displacement", "length", limit="any")
    phase = table.number("phase", "angle", 0.0, "any")
    return _build(table, faults, lambda: Bow(station, displacement, phase))


def _support(table: Table, last: int, faults: list[str]) -> Support | None:
    station = _station(table, last)
    inner = SupportCoefficients(
        table.matrix("stiffness", "stiffness", required=True), table.matrix("damping", "damping", required=False)
    )
    ring_mass = table.number("ring_mass", "mass", 0.0)
    outer = None
    if ring_mass or table.has("outer_stiffness"):
        outer = SupportCoefficients(
            table.matrix("outer_stiffness", "stiffness", required=True),
            table.matrix("outer_damping", "damping", required=False),
        )
    return _build(table, faults, lambda: Support(station, inner, outer, ring_mass))


def _rub(table: Table, rotor: Rotor | None, last: int, faults: list[str]) -> Rub | None:
    station = _station(table, last)
    shaft = rotor.radius(station) if rotor is not None and 1 <= station <= last else 1.0
    clearance, stiffness = table.number("clearance", "length"), table.number("stiffness", "stiffness")
    radius = table.number("radius", "radius", shaft)
    friction = table.number("friction", "number", 0.0, "not negative")
    damping = table.number("damping", "contact damping", 0.0, "not negative")
    return _build(table, faults, lambda: Rub(station, clearance, stiffness, radius, friction, damping))
