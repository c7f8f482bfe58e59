"""What the columns and figures of analyses are called, in which unit, and what they mean."""

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Values: TypeAlias = NDArray[np.float64] | NDArray[np.str_]
ColumnInput: TypeAlias = Values | NDArray[np.signedinteger]


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a number is.

    Parameters
    ----------
    unit : str
        As people write it; empty where there is none.
    description : str
        In words.
    """

    unit: str
    description: str

    @property
    def text(self) -> str:
        """Unit and description, separated by a colon."""
        return f"{self.unit}: {self.description}" if self.unit else self.description


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """Values of one quantity.

    Parameters
    ----------
    name : str
        With its unit.
    values : ndarray, shape (n,)
        float64, NaN where not known; or words.
    """

    name: str
    values: Values

    @property
    def quantity(self) -> Quantity:
        """What it is."""
        return QUANTITIES[self.name]


def columns(**values: ColumnInput) -> tuple[Column, ...]:
    """Return columns by their names; each must be known here."""
    for name in values:
        if name not in QUANTITIES:
            raise ValueError(f"column {name!r}: expected one of {', '.join(QUANTITIES)}")
    return tuple(Column(name, row if row.dtype.kind == "U" else np.asarray(row, float)) for name, row in values.items())  # type: ignore[arg-type]


def _at_probes(name: str, unit: str, description: str) -> dict[str, Quantity]:
    return {name.format(probe): Quantity(unit, f"{description} at probe {probe}") for probe in "xy"}


def _amplitudes() -> dict[str, Quantity]:
    words = {"peak": "µm zero-to-peak", "peak_to_peak": "µm peak-to-peak", "rms": "µm RMS"}
    found: dict[str, Quantity] = {}
    for scaling, unit in words.items():
        found |= _at_probes(f"amplitude_{scaling}_{{}}_um", unit, "amplitude of the line")
        found[f"amplitude_{scaling}_um"] = Quantity(unit, "largest amplitude, or of full spectra the circle's radius")
        found |= _at_probes(f"sigma_{scaling}_{{}}_um", unit, "standard deviation of the amplitude")
        found[f"sigma_{scaling}_um"] = Quantity(unit, "standard deviation of the amplitudes")
    return found


QUANTITIES: Final[dict[str, Quantity]] = {
    "time_s": Quantity("s", "sample time in the segment"),
    "speed_rpm": Quantity("r/min", "mean shaft speed"),
    "speed_sigma_rpm": Quantity("r/min", "standard deviation of the speed"),
    "order": Quantity("", "frequency over the shaft's; of full spectra negative against the rotation"),
    "order_sigma": Quantity("", "standard deviation of the order"),
    "frequency_hz": Quantity("Hz", "frequency"),
    "revolution": Quantity("", "number of the revolution, from 0"),
    "angle_deg": Quantity("degrees", "shaft angle after the mark"),
    "ramp_direction": Quantity("", "run-up or run-down"),
    "frames": Quantity("", "spectra that were averaged"),
    "component": Quantity("", "number of the component, from 1"),
    **_amplitudes(),
    **_at_probes("lag_{}_deg", "degrees", "phase lag, 0 to 360,"),
    **_at_probes("lag_sigma_{}_deg", "degrees", "standard deviation of the phase lag"),
    **_at_probes("displacement_{}_um", "µm", "displacement towards the shaft's probe, its mean taken off,"),
    **_at_probes("average_{}_um", "µm", "mean revolution, its own mean taken off,"),
    **_at_probes("average_sigma_{}_um", "µm", "standard deviation of the mean revolution"),
    **_at_probes("residual_rms_{}_um", "µm RMS", "what does not repeat with the shaft, at this angle,"),
    **_at_probes("runout_{}_um", "µm", "run-out at this angle"),
    **_at_probes("runout_sigma_{}_um", "µm", "standard deviation of the run-out"),
    **_at_probes("peak_to_peak_{}_um", "µm peak-to-peak", "overall vibration, all orders together,"),
    **_at_probes("clearance_fraction_{}", "", "overall vibration over the clearance's diameter"),
    "X_um": Quantity("µm", "position in the bench's X, to the right"),
    "Y_um": Quantity("µm", "position in the bench's Y, up"),
    "X_sigma_um": Quantity("µm", "standard deviation of X"),
    "Y_sigma_um": Quantity("µm", "standard deviation of Y"),
    "eccentricity_ratio": Quantity(
        "", "distance from the clearance's middle over its radius; above 1 the reference is wrong"
    ),
    "attitude_deg": Quantity("degrees", "from straight down to the shaft, positive in the direction of rotation"),
    "uncertain": Quantity("", "yes: probes within their tolerance could have made this circle of its counterpart"),
    "forward_peak_um": Quantity("µm zero-to-peak", "radius of the circle with the shaft"),
    "backward_peak_um": Quantity("µm zero-to-peak", "radius of the circle against the shaft"),
    "largest_peak_um": Quantity("µm zero-to-peak", "largest half major axis of the component's ellipse"),
    "largest_at_rpm": Quantity("r/min", "speed at the largest"),
    "onset_rpm": Quantity("r/min", "speed at which the component began"),
    "end_rpm": Quantity("r/min", "speed at which the component ended"),
    "lock_rpm": Quantity("r/min", "speed at which the component's frequency locked"),
    "begin_s": Quantity("s", "when the component began"),
    "end_s": Quantity("s", "when the component ended"),
    "direction": Quantity("", "forward, with the shaft, or backward"),
    "behaviour": Quantity("", "whirl follows the speed, whip stays at a frequency"),
    "exponent": Quantity("", "n of frequency proportional to speed^n: 1 whirl, 0 whip"),
    "exponent_sigma": Quantity("", "standard deviation of the exponent"),
    "severity": Quantity("", "of the larger probe against the limits: normal, alarm or danger"),
    "revolutions": Quantity("", "revolutions that were used"),
    "noise_peak_um": Quantity("µm zero-to-peak", "floor of the spectrum between its lines, the median"),
    "noise_bandwidth_hz": Quantity("Hz", "equivalent noise bandwidth of a line"),
    "relative_sigma": Quantity("", "standard deviation over value where a line is noise"),
    "major_peak_um": Quantity("µm zero-to-peak", "half the major axis of the ellipse"),
    "minor_peak_um": Quantity("µm zero-to-peak", "half the minor axis; negative where it goes against the shaft"),
    "tilt_deg": Quantity("degrees", "of the major axis from X, anticlockwise"),
    "period": Quantity("", "revolutions after which the points repeat; 0: they do not"),
    "scatter_um": Quantity("µm RMS", "of the points about what they make"),
    "slow_roll_drift": Quantity("", "change of 1X over the slow roll, of itself; above 0.2 the shaft moved"),
    "probe_gain_mismatch": Quantity(
        "", "sensitivity of probe y over x less 1, as all strong lines agree; it was taken out"
    ),
    "jitter_us": Quantity("µs", "scatter of the tacho's pulses about the smooth angle"),
    "pulses_filled": Quantity("", "tacho pulses that were missing and filled in"),
    "pulses_rejected": Quantity("", "tacho edges that were rejected"),
    "speed_min_rpm": Quantity("r/min", "slowest speed used"),
    "speed_max_rpm": Quantity("r/min", "fastest speed used"),
    "amplification_factor": Quantity("", "speed over half-power width of a resonance (API 684)"),
    "resonance_rpm": Quantity(
        "r/min", "speed of the largest resonance of the run-up, or -down, at the probe that shows it most"
    ),
    "peak_to_peak_max_um": Quantity("µm peak-to-peak", "largest overall vibration"),
}
