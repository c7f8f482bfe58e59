"""What an analysis of a run's samples comes to: a table, a few figures, a drawing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq.reports.columns import QUANTITIES, Column
from daq.reports.plots.panel import Panel

ProgressCallback = Callable[[str, float | None], None]
"""Told what goes on, and the part of it that is done, 0 to 1, where that is known."""

PREVIEW_ROWS = 24  # rows of a table that are printed, where no others are named


@dataclass(frozen=True, slots=True, eq=False)
class AnalysisResult:
    """An outcome.

    Parameters
    ----------
    title : str
        What it is, in words.
    columns : tuple of Column
        The table, columns of one length.
    panels : tuple of Panel
        The drawing.
    figures : mapping of str to float
        Single numbers by names of `QUANTITIES`: quality, and what there is one of.
    remarks : tuple of str
        What must be known to read it.
    representative_rows : ndarray of int or None
        The rows that tell most, for a terminal; None: some, evenly.
    """

    title: str
    columns: tuple[Column, ...]
    panels: tuple[Panel, ...]
    figures: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    representative_rows: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        lengths = {column.name: column.values.shape for column in self.columns}
        if len(set(lengths.values())) != 1:
            raise ValueError(f"columns: shapes {lengths}, expected all (n,)")
        if not set(self.figures) <= set(QUANTITIES):
            raise ValueError(f"figures: {', '.join(self.figures)}, expected names of quantities")

    @property
    def n_rows(self) -> int:
        """Rows of the table."""
        return int(self.columns[0].values.size)

    def preview_rows(self) -> NDArray[np.intp]:
        """Return the rows that a terminal shows."""
        if self.representative_rows is not None:
            return self.representative_rows
        return np.unique(np.linspace(0, self.n_rows - 1, min(PREVIEW_ROWS, self.n_rows)).round().astype(np.intp))
