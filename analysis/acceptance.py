"""Figures of standards for the vibration of shafts, for information, each with what it is meant for.

None of them is written for a turbocharger on floating rings: judge that by its clearance. The figures are those that
the field quotes; before anything hangs on one, read the standard itself.
"""

from dataclasses import dataclass

import numpy as np

MICRO = 1e-6
RPM = 60.0 / (2.0 * np.pi)  # r/min of a rad/s
ISO_SPEEDS = (120.0, 30_000.0)  # r/min, scope of ISO 20816-3
ISO_ZONES = (("A/B", 4800.0), ("B/C", 9000.0), ("C/D", 13_200.0))  # um peak-to-peak times the root of r/min
API_LARGEST = 25.4  # um peak-to-peak


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of a standard.

    Parameters
    ----------
    standard, name : str
        Where it stands and what it is called there.
    limit : float
        Overall vibration, m peak-to-peak; NaN where its scope does not reach the speed.
    scope : str
        What it is meant for.
    in_scope : bool
        Whether the speed lies in its scope; the machine never does.
    """

    standard: str
    name: str
    limit: float
    scope: str
    in_scope: bool


def figures(speed: float) -> tuple[Figure, ...]:
    """Return the figures of ISO 20816-3, API 617 and API 670 at a shaft speed.

    Parameters
    ----------
    speed : float
        rad/s, above 0.

    Notes
    -----
    ISO 20816-3 zone boundaries of relative shaft vibration 4800, 9000, 13200 / sqrt(n); API 617 mechanical running
    test 25.4 sqrt(12000 / n), at most 25.4; API 670 combined run-out 6.4 or a quarter of the allowed vibration, in um
    peak-to-peak with n in r/min.
    """
    if not speed > 0.0:
        raise ValueError(f"speed: {speed} rad/s, expected more than 0")
    rpm = speed * RPM
    inside = ISO_SPEEDS[0] <= rpm <= ISO_SPEEDS[1]
    iso_scope = "industrial machines above 15 kW that run at 120 to 30,000 r/min"
    iso = [
        Figure(
            "ISO 20816-3", f"zone boundary {name}", k / np.sqrt(rpm) * MICRO if inside else np.nan, iso_scope, inside
        )
        for name, k in ISO_ZONES
    ]
    running = min(API_LARGEST * np.sqrt(12_000.0 / rpm), API_LARGEST) * MICRO
    api_scope = "axial and centrifugal compressors of the process industry, at the mechanical running test"
    runout = max(6.4 * MICRO, 0.25 * running)
    return (
        *iso,
        Figure("API 617", "vibration limit", float(running), api_scope, in_scope=True),
        Figure(
            "API 670", "combined run-out", float(runout), "probe areas of shafts with proximity probes", in_scope=True
        ),
    )


def unbalance_allowed(grade: float, mass: float, speed: float) -> float:
    """Return the permissible residual unbalance, kg m.

    Parameters
    ----------
    grade : float
        Balance quality grade, m/s (G 2.5 is 2.5e-3 m/s).
    mass : float
        Of the rotor, kg.
    speed : float
        Highest service speed, rad/s.

    Notes
    -----
    U = G m / Omega (ISO 21940-11; 9549 G m / n in g mm, mm/s, kg and r/min).
    """
    if not (grade > 0.0 and mass > 0.0 and speed > 0.0):
        raise ValueError(f"grade, mass, speed: {grade} m/s, {mass} kg, {speed} rad/s, expected all above 0")
    return grade * mass / speed
