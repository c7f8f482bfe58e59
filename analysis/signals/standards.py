"""Limits of shaft vibration, run-out and residual unbalance from standards, for information, with scope and source.

No standard covers a turbocharger on floating rings: judge its vibration by the clearance. The numbers are quoted from
secondary sources, given in `StandardLimit.source`. Read the standard itself before any decision depends on a number.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from analysis.signals.units import MICROMETRE, NUMBER, PEAK_TO_PEAK, RPM

ISO_SPEED_RANGE = (120.0, 30_000.0)  # r/min, in the title of ISO 20816-3:2022
ISO_ZONES = (("A/B", 4800.0), ("B/C", 9000.0), ("C/D", 13_200.0))  # um peak-to-peak times the root of r/min
ISO_SCOPE = "industrial machines above 15 kW that run at 120 to 30,000 r/min"
ISO_SOURCE = (
    "zone boundaries of ISO 7919-3 and its successor ISO 20816-3 as the field quotes them, scope from its title; not "
    "checked against the standard's text"
)
API_MAX_LIMIT, API_REFERENCE_SPEED = 25.4, 12_000.0  # um peak-to-peak; r/min
API_SCOPE = "axial and centrifugal compressors of the process industry, at the mechanical running test"
API_SOURCE = (
    "API 617, 4.8.2.11, and API 684, SP6.8.2.11, as the open rotor program ROSS cites them; not checked against the "
    "standard's text"
)
API_MIN_RUNOUT, API_RUNOUT_FRACTION = 6.4, 0.25  # um peak-to-peak; of the allowed vibration
API_RUNOUT_SCOPE = "the probed areas of a shaft, mechanical and electrical run-out together"
API_RUNOUT_SOURCE = "API 670 as the field quotes it; not checked against the standard's text"


@dataclass(frozen=True, slots=True)
class StandardLimit:
    """One limit of a standard.

    Parameters
    ----------
    in_scope : bool
        Whether the speed is in scope; a turbocharger never is.
    """

    standard: Annotated[str, NUMBER.of("Name of the standard")]
    name: Annotated[str, NUMBER.of("Name of the limit in the standard")]
    limit: Annotated[
        float,
        PEAK_TO_PEAK.of("Limit of overall vibration; unknown where the speed is out of scope", "limit_peak_to_peak"),
    ]
    scope: Annotated[str, NUMBER.of("Machines that the standard covers")]
    in_scope: bool
    source: Annotated[str, NUMBER.of("Secondary source of the limit")]


def standard_limits(speed: float) -> tuple[StandardLimit, ...]:
    """Return the limits of ISO 20816-3, API 617 and API 670 at a shaft speed.

    Parameters
    ----------
    speed : float
        rad/s, above 0 and finite.

    Notes
    -----
    With n in r/min, in um peak-to-peak: ISO 20816-3 zone boundaries of relative shaft vibration 4800, 9000,
    13200 / sqrt(n); API 617 vibration limit 25.4 sqrt(12000 / n), at most 25.4; API 670 combined run-out, see
    `allowed_combined_runout`.
    """
    if not 0.0 < speed < np.inf:
        raise ValueError(f"speed: {speed} rad/s, expected more than 0, finite")
    rpm = speed / RPM
    inside = ISO_SPEED_RANGE[0] <= rpm <= ISO_SPEED_RANGE[1]
    iso = [
        StandardLimit(
            "ISO 20816-3",
            f"zone boundary {name}",
            float(k / np.sqrt(rpm) * MICROMETRE) if inside else np.nan,
            ISO_SCOPE,
            inside,
            ISO_SOURCE,
        )
        for name, k in ISO_ZONES
    ]
    running = min(API_MAX_LIMIT * float(np.sqrt(API_REFERENCE_SPEED / rpm)), API_MAX_LIMIT) * MICROMETRE
    runout = allowed_combined_runout(running)
    return (
        *iso,
        StandardLimit("API 617", "vibration limit", running, API_SCOPE, in_scope=True, source=API_SOURCE),
        StandardLimit("API 670", "combined run-out", runout, API_RUNOUT_SCOPE, in_scope=True, source=API_RUNOUT_SOURCE),
    )


def allowed_combined_runout(allowed: float) -> float:
    """Return the run-out that API 670 allows for a given allowed vibration, both m peak-to-peak.

    6.4 um or a quarter of the allowed vibration, whichever is more (`API_RUNOUT_SOURCE`).
    """
    if not allowed >= 0.0:
        raise ValueError(f"allowed: {allowed} m peak-to-peak, expected 0 or more")
    return max(API_MIN_RUNOUT * MICROMETRE, API_RUNOUT_FRACTION * allowed)


def permissible_unbalance(grade: float, mass: float, speed: float) -> float:
    """Return the permissible residual unbalance, kg m.

    Parameters
    ----------
    grade : float
        Balance quality grade, m/s (G 2.5 is 2.5e-3 m/s).
    mass : float
        Mass of the rotor, kg.
    speed : float
        Highest service speed, rad/s.

    Notes
    -----
    U = G m / Omega (ISO 21940-11; 9549 G m / n in g mm, mm/s, kg and r/min).
    """
    if not (grade > 0.0 and mass > 0.0 and speed > 0.0):
        raise ValueError(f"grade, mass, speed: {grade} m/s, {mass} kg, {speed} rad/s, expected all above 0")
    return grade * mass / speed
