"""Result of an analysis: table with units and descriptions, single values and plot; and its JSON schema."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from daq.reports.plots.panel import Panel
from daq.schemas.units import Schema

Values: TypeAlias = NDArray[np.float64] | NDArray[np.str_]
ColumnInput: TypeAlias = Values | NDArray[np.signedinteger]


@dataclass(frozen=True, slots=True)
class Quantity:
    """Unit and description of a quantity.

    Parameters
    ----------
    unit : str
        Displayed unit; empty for dimensionless quantities.
    description : str
        Description.
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
        Key of `QUANTITIES`; it carries the unit.
    values : ndarray, shape (n,)
        float64 with NaN for unknown values, or text.
    """

    name: str
    values: Values

    @property
    def quantity(self) -> Quantity:
        """Quantity of the column."""
        return QUANTITIES[self.name]


def columns(**values: ColumnInput) -> tuple[Column, ...]:
    """Return columns from keyword arguments; ValueError for names not in `QUANTITIES`."""
    for name in values:
        if name not in QUANTITIES:
            raise ValueError(f"column {name!r}: expected one of {', '.join(QUANTITIES)}")
    # the dtype's kind tells text from numbers, which mypy cannot see
    return tuple(Column(name, row if row.dtype.kind == "U" else np.asarray(row, float)) for name, row in values.items())  # type: ignore[arg-type]


def _at_probes(name: str, unit: str, description: str) -> dict[str, Quantity]:
    return {name.format(probe): Quantity(unit, f"{description} at probe {probe}") for probe in "xy"}


def _amplitudes() -> dict[str, Quantity]:
    units = {"peak": "µm zero-to-peak", "peak_to_peak": "µm peak-to-peak", "rms": "µm RMS"}
    found: dict[str, Quantity] = {}
    for scaling, unit in units.items():
        found |= _at_probes(f"amplitude_{scaling}_{{}}_um", unit, "amplitude")
        found[f"amplitude_{scaling}_um"] = Quantity(unit, "larger amplitude of the probes, or radius in full spectra")
        found |= _at_probes(f"sigma_{scaling}_{{}}_um", unit, "standard deviation of the amplitude")
        found[f"sigma_{scaling}_um"] = Quantity(unit, "standard deviation of the amplitudes")
    return found


QUANTITIES: Final[dict[str, Quantity]] = {
    "time_s": Quantity("s", "sample time in the segment"),
    "speed_rpm": Quantity("r/min", "mean shaft speed"),
    "speed_sigma_rpm": Quantity("r/min", "standard deviation of the speed"),
    "order": Quantity("", "frequency over shaft frequency; negative: backward, in full spectra"),
    "order_sigma": Quantity("", "standard deviation of the order"),
    "frequency_hz": Quantity("Hz", "frequency"),
    "revolution": Quantity("", "number of the revolution, from 0"),
    "angle_deg": Quantity("degrees", "shaft angle after the keyphasor mark"),
    "ramp_direction": Quantity("", "run-up or run-down"),
    "frames": Quantity("", "number of spectra averaged"),
    "component": Quantity("", "number of the component, from 1"),
    **_amplitudes(),
    **_at_probes("lag_{}_deg", "degrees", "phase lag, 0 to 360,"),
    **_at_probes("lag_sigma_{}_deg", "degrees", "standard deviation of the phase lag"),
    **_at_probes("displacement_{}_um", "µm", "displacement towards the probe, mean removed,"),
    **_at_probes("average_{}_um", "µm", "synchronous average, mean removed,"),
    **_at_probes("average_sigma_{}_um", "µm", "standard deviation of the synchronous average"),
    **_at_probes("residual_rms_{}_um", "µm RMS", "residual of the synchronous average at this angle"),
    **_at_probes("runout_{}_um", "µm", "run-out at this angle"),
    **_at_probes("runout_sigma_{}_um", "µm", "standard deviation of the run-out"),
    **_at_probes("peak_to_peak_{}_um", "µm peak-to-peak", "overall vibration"),
    **_at_probes("clearance_fraction_{}", "", "overall vibration over the diametral clearance"),
    **_at_probes("scatter_peak_{}_um", "µm zero-to-peak", "scatter of the vectors in the bin"),
    **_at_probes("compensated_peak_{}_um", "µm zero-to-peak", "amplitude minus run-out"),
    **_at_probes("compensated_lag_{}_deg", "degrees", "phase lag minus run-out, 0 to 360,"),
    "segment": Quantity("", "gap-free segment of the run, from 0"),
    "sample": Quantity("", "index in the segment, one past the last sample used"),
    "acceleration_rpm_per_s": Quantity("r/min per s", "mean rate of change of the speed"),
    "clearance_um": Quantity("µm", "radius of the clearance circle"),
    "compensated_X_um": Quantity("µm", "X minus run-out"),
    "compensated_Y_um": Quantity("µm", "Y minus run-out"),
    "X_um": Quantity("µm", "position in X, to the right"),
    "Y_um": Quantity("µm", "position in Y, up"),
    "X_sigma_um": Quantity("µm", "standard deviation of X"),
    "Y_sigma_um": Quantity("µm", "standard deviation of Y"),
    "eccentricity_ratio": Quantity(
        "", "distance from the clearance centre over its radius; above 1 the reference is wrong"
    ),
    "attitude_deg": Quantity("degrees", "from straight down to the shaft, positive in the direction of rotation"),
    "uncertain": Quantity("", "yes: the tolerance of the probes could produce this component from its counterpart"),
    "forward_peak_um": Quantity("µm zero-to-peak", "radius of the forward component"),
    "backward_peak_um": Quantity("µm zero-to-peak", "radius of the backward component"),
    "largest_peak_um": Quantity("µm zero-to-peak", "largest half major axis of the component's ellipse"),
    "largest_at_rpm": Quantity("r/min", "speed of the largest value"),
    "onset_rpm": Quantity("r/min", "onset speed of the component"),
    "end_rpm": Quantity("r/min", "end speed of the component"),
    "lock_rpm": Quantity("r/min", "speed at which the frequency of the component locks"),
    "lock_sigma_rpm": Quantity("r/min", "standard deviation of the lock speed"),
    "begin_s": Quantity("s", "start time of the component"),
    "end_s": Quantity("s", "end time of the component"),
    "direction": Quantity("", "forward or backward, relative to the rotation"),
    "behaviour": Quantity("", "whirl: frequency follows the speed; whip: frequency stays constant"),
    "exponent": Quantity("", "n in frequency ∝ speed^n: 1 whirl, 0 whip"),
    "exponent_sigma": Quantity("", "standard deviation of the exponent"),
    "severity": Quantity("", "severity of the larger probe: normal, alarm or danger"),
    "revolutions": Quantity("", "number of revolutions used"),
    "noise_peak_um": Quantity("µm zero-to-peak", "median noise floor of the spectrum"),
    "noise_bandwidth_hz": Quantity("Hz", "equivalent noise bandwidth of a line"),
    "relative_sigma": Quantity("", "relative standard deviation of noise lines"),
    "major_peak_um": Quantity("µm zero-to-peak", "half the major axis of the ellipse"),
    "minor_peak_um": Quantity("µm zero-to-peak", "half the minor axis; negative: backward"),
    "tilt_deg": Quantity("degrees", "angle of the major axis from X, anticlockwise"),
    "period": Quantity("", "revolutions after which the points repeat; 0: aperiodic"),
    "revolutions_needed": Quantity("", "revolutions that would decide an unknown pattern; 0: it is known"),
    "scatter_um": Quantity("µm RMS", "scatter of the points about their pattern"),
    "slow_roll_drift": Quantity("", "relative change of 1X over the slow roll; above 0.2 the shaft moved"),
    "probe_gain_mismatch": Quantity(
        "", "sensitivity of probe y over x minus 1, estimated from all strong lines and corrected"
    ),
    "jitter_us": Quantity("µs", "scatter of the tacho's pulses about the smooth angle"),
    "pulses_filled": Quantity("", "missing tacho pulses that were filled in"),
    "pulses_rejected": Quantity("", "rejected tacho edges"),
    "speed_min_rpm": Quantity("r/min", "lowest speed used"),
    "speed_max_rpm": Quantity("r/min", "highest speed used"),
    "amplification_factor": Quantity("", "resonance speed over half-power bandwidth (API 684)"),
    "amplification_factor_sigma": Quantity("", "standard deviation of the amplification factor"),
    "resonance_sigma_rpm": Quantity("r/min", "standard deviation of the resonance speed"),
    "largest_sigma_peak_um": Quantity("µm zero-to-peak", "standard deviation of the largest amplitude"),
    "resonance_rpm": Quantity("r/min", "speed of the largest resonance over run-up, run-down and both probes"),
    "peak_to_peak_max_um": Quantity("µm peak-to-peak", "largest overall vibration"),
}


ProgressCallback = Callable[[str, float | None], None]
"""Called with the current task and the fraction done, 0 to 1, None where unknown."""

DIGITS = 9  # significant; finer than the resolution of probes and tacho
PREVIEW_ROWS = 24  # rows of a table printed by default


@dataclass(frozen=True, slots=True, eq=False)
class AnalysisResult:
    """Result of an analysis.

    Parameters
    ----------
    title : str
        Displayed title.
    columns : tuple of Column
        Table; all columns have the same length.
    panels : tuple of Panel
        Plot.
    scalars : mapping of str to float
        Single values by names of `QUANTITIES`, such as standard deviations.
    remarks : tuple of str
        Notes on the result.
    representative_rows : ndarray of int or None
        Rows shown in a terminal; None: evenly spaced rows.
    """

    title: str
    columns: tuple[Column, ...]
    panels: tuple[Panel, ...]
    scalars: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    representative_rows: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        lengths = {column.name: column.values.shape for column in self.columns}
        if len(set(lengths.values())) != 1:
            raise ValueError(f"columns: shapes {lengths}, expected all (n,)")
        if not set(self.scalars) <= set(QUANTITIES):
            raise ValueError(f"scalars: {', '.join(self.scalars)}, expected names of quantities")

    @property
    def n_rows(self) -> int:
        """Number of rows of the table."""
        return int(self.columns[0].values.size)

    def preview_rows(self) -> NDArray[np.intp]:
        """Return the indices of the rows shown in a terminal."""
        if self.representative_rows is not None:
            return self.representative_rows
        return np.unique(np.linspace(0, self.n_rows - 1, min(PREVIEW_ROWS, self.n_rows)).round().astype(np.intp))


class AnalysisSchema(Schema):
    """Table and single values of an analysis; every name carries its unit."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    analysis: str = Field(description="Kind of the analysis", examples=["bode"])
    title: str = Field(
        description="Displayed title",
        examples=["2026-11-24T09-12-07-gj90c · 1,043 to 15,632 r/min, 0.0 to 20.0 s · 1X"],
    )
    columns: dict[str, tuple[float | str | None, ...]] = Field(
        description="Columns of the table by name; null where a value is unknown",
        examples=[{"speed_rpm": [1100.2, 1200.1], "amplitude_peak_x_um": [0.61, 0.69], "lag_x_deg": [271.3, 273.0]}],
    )
    scalars: dict[str, float | None] = Field(
        description="Single values by name", examples=[{"sigma_peak_um": 0.003, "jitter_us": 4.8}]
    )
    descriptions: dict[str, str] = Field(
        description="Unit and description of every column and single value by name",
        examples=[{"speed_rpm": "r/min: mean shaft speed", "lag_x_deg": "degrees: phase lag, 0 to 360, at probe x"}],
    )
    remarks: tuple[str, ...] = Field(
        description="Notes on the result", examples=[["peak at x: 12.1 µm at 8,020 r/min, amplification 4.2"]]
    )


def analysis_schema(run: str, kind: str, analysis: AnalysisResult) -> AnalysisSchema:
    """Return the schema of an analysis."""
    names = dict.fromkeys([*(column.name for column in analysis.columns), *analysis.scalars])
    return AnalysisSchema(
        run=run,
        analysis=kind,
        title=analysis.title,
        columns={column.name: _values(column) for column in analysis.columns},
        scalars={name: _rounded(value) for name, value in analysis.scalars.items()},
        descriptions={name: QUANTITIES[name].text for name in names},
        remarks=analysis.remarks,
    )


def _values(column: Column) -> tuple[float | str | None, ...]:
    return tuple(value if isinstance(value, str) else _rounded(value) for value in column.values.tolist())


def _rounded(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
