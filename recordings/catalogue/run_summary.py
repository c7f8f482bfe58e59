"""What a search needs of a run's summary, as rows of the catalogue."""

import math
from dataclasses import dataclass
from typing import Any

from analysis.live.summary import RunSummary
from recordings.catalogue.entry import RunEntry
from recordings.catalogue.search import RPM
from recordings.mcap.markers import Marker

MICRO = 1e-6


@dataclass(frozen=True, slots=True)
class SummarisedRun:
    """A run and what was found in it.

    Parameters
    ----------
    entry : RunEntry
        The run as its file was when it was read.
    summary : RunSummary
        Its summary.
    markers : tuple of Marker
        Its named moments.
    """

    entry: RunEntry
    summary: RunSummary
    markers: tuple[Marker, ...]

    def columns(self) -> dict[str, Any]:
        """Return what is kept in the run's own row."""
        summary = self.summary
        return {
            "is_summarised": True,
            "lowest_speed_rpm": _finite(summary.lowest_speed / RPM),
            "highest_speed_rpm": _finite(summary.highest_speed / RPM),
            "largest_peak_to_peak_um": _finite(summary.largest_peak_to_peak / MICRO),
            "severity": summary.severity.value,
        }

    def finding_rows(self) -> list[dict[str, Any]]:
        """Return a row for every sub-synchronous component."""
        return [
            {
                "number": number,
                "order": whirl.order,
                "is_forward": whirl.is_forward,
                "onset_rpm": whirl.begin.speed / RPM,
                "end_rpm": whirl.end.speed / RPM,
                "largest_peak_um": whirl.amplitude / MICRO,
            }
            for number, whirl in enumerate(self.summary.whirls)
            if math.isfinite(whirl.begin.speed) and math.isfinite(whirl.end.speed)
        ]

    def marker_rows(self) -> list[dict[str, Any]]:
        """Return a row for every named moment."""
        return [
            {"number": number, "segment": marker.segment, "sample": marker.sample, "text": marker.text}
            for number, marker in enumerate(self.markers)
        ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
