"""What an analysis of a run's samples comes to, as a document."""

import math

from pydantic import Field

from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import QUANTITIES, Column
from daq.schemas.units import Schema

DIGITS = 9  # that count: finer than what probes and tacho resolve


class AnalysisSchema(Schema):
    """A table in columns of one length, and single figures; every name carries its unit."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    analysis: str = Field(description="What was made", examples=["bode"])
    title: str = Field(
        description="The same in words",
        examples=["2026-11-24T09-12-07-gj90c · 1,043 to 15,632 r/min, 0.0 to 20.0 s · 1X"],
    )
    columns: dict[str, tuple[float | str | None, ...]] = Field(
        description="By name; null where a value is not known",
        examples=[{"speed_rpm": [1100.2, 1200.1], "amplitude_peak_x_um": [0.61, 0.69], "lag_x_deg": [271.3, 273.0]}],
    )
    figures: dict[str, float | None] = Field(
        description="Quality, and what there is one of, by name", examples=[{"sigma_peak_um": 0.003, "jitter_us": 4.8}]
    )
    descriptions: dict[str, str] = Field(
        description="Unit and meaning of every column and figure by its name",
        examples=[{"speed_rpm": "r/min: mean shaft speed", "lag_x_deg": "degrees: phase lag, 0 to 360, at probe x"}],
    )
    remarks: tuple[str, ...] = Field(
        description="What must be known to read it", examples=[["peak at x: 12.1 µm at 8,020 r/min, amplification 4.2"]]
    )


def analysis_schema(run: str, kind: str, analysis: AnalysisResult) -> AnalysisSchema:
    """Return an analysis as a document."""
    names = dict.fromkeys([*(column.name for column in analysis.columns), *analysis.figures])
    return AnalysisSchema(
        run=run,
        analysis=kind,
        title=analysis.title,
        columns={column.name: _values(column) for column in analysis.columns},
        figures={name: _rounded(value) for name, value in analysis.figures.items()},
        descriptions={name: QUANTITIES[name].text for name in names},
        remarks=analysis.remarks,
    )


def _values(column: Column) -> tuple[float | str | None, ...]:
    return tuple(value if isinstance(value, str) else _rounded(value) for value in column.values.tolist())


def _rounded(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
