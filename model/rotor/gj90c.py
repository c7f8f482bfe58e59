"""The GJ90C turbocharger of the thesis: the printed parameters, completed by assumptions."""

import math

from model.rotor.parameters import FloatingRing, Imbalance, ModelParameters
from model.rotor.rotor import Disc, Rotor, Segment, ShaftMass


def gj90c_rotor() -> Rotor:
    """Return the rotor of Table 5.1.

    The values are as printed, although the polar inertia of a bare shaft station is smaller than the diametral one:
    Table 5.3 was computed with them. ``r`` are radii; read as diameters, they miss Table 5.2 by a factor of four. The
    journals are stations 3 and 4, the only pair that gives the rigid modes of Table 5.3. Station 1 is the compressor
    end, 2 the compressor wheel, 5 the turbine wheel.
    """
    masses = (0.01, 0.06, 0.015, 0.02, 0.07, 0.01)  # Table 5.1
    diametral_inertias = (0.2e-6, 9e-6, 0.2e-6, 0.2e-6, 8e-6, 0.2e-6)  # Table 5.1
    polar_inertias = (0.1e-6, 16e-6, 0.1e-6, 0.1e-6, 14e-6, 0.1e-6)  # Table 5.1
    radii = (5e-3, 5e-3, 4e-3, 7e-3, 7e-3)  # Table 5.1
    lengths = (5e-3, 25e-3, 30e-3, 25e-3, 5e-3)  # Table 5.1
    youngs_modulus = 205e9  # Table 5.1
    sizes = zip(masses, diametral_inertias, polar_inertias, strict=True)
    return Rotor(
        segments=tuple(
            Segment(length, radius, youngs_modulus=youngs_modulus)
            for length, radius in zip(lengths, radii, strict=True)
        ),
        discs=tuple(Disc(station, *size) for station, size in enumerate(sizes, 1)),
        bearing_stations=(3, 4),
        shaft_mass=ShaftMass.NONE,  # included in the disc masses
    )


def gj90c(
    *,
    imbalance: float = 5e-7,
    imbalance_station: int = 5,
    imbalance_phase: float = 0.0,
    viscosity: float = 0.015,
    inner_clearance: float = 20e-6,
    outer_clearance: float = 80e-6,
    probe_angles: tuple[float, float] = (0.0, math.pi / 2),
) -> ModelParameters:
    """Return the GJ90C on its floating rings.

    The outer radius of the ring is the 9 mm of chapter 6 (ring speed 0.407 of the shaft speed), not the 7 mm of Table
    3.1. The printed imbalances (1e-5 to 5e-5 kg m) pin the journals to the wall; the default is typical of a balanced
    wheel.

    Parameters
    ----------
    imbalance : float
        At ``imbalance_station``, kg m.
    imbalance_station : int
        Station of the imbalance, 1 to 6; 5 is the turbine wheel.
    imbalance_phase : float
        Angle of the heavy spot from the once-per-turn mark in the direction of rotation, rad.
    viscosity : float
        Of the oil, Pa s (Table 6.1).
    inner_clearance, outer_clearance : float
        Radial clearances, m (Table 6.1).
    probe_angles : tuple of float, length 2
        Angles of the probes from +X, positive in the direction of rotation, rad.

    Returns
    -------
    ModelParameters
        With gravity; the probes are at the compressor end.
    """
    bearing = FloatingRing(
        length=10e-3,  # Table 3.1
        journal_radius=5e-3,  # Table 3.1
        inner_clearance=inner_clearance,
        outer_clearance=outer_clearance,
        ring_outer_radius=9e-3,  # section 6.1
        ring_mass=0.02,  # Table 3.1
        viscosity=viscosity,
    )
    return ModelParameters(
        rotor=gj90c_rotor(),
        bearing=bearing,
        imbalances=(Imbalance(imbalance_station, imbalance, imbalance_phase),),
        probe_angles=probe_angles,
    )
