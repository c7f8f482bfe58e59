"""Result of an analysis: table, single values and plot; and its JSON schema."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from daq.reports.columns import QUANTITIES, Column
from daq.reports.plots.panel import Panel
from daq.schemas.units import Schema

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
