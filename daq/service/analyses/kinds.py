"""The kinds of analysis: what each is called, asked and made by."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from daq.service.analyses import questions
from daq.service.analyses.analysis import Analysis
from daq.service.analyses.below import sub_synchronous
from daq.service.analyses.envelopes import envelopes, waveforms
from daq.service.analyses.levels import overall_of
from daq.service.analyses.maps import cascade, waterfall
from daq.service.analyses.orbits import orbit_of, poincare
from daq.service.analyses.positions import bifurcation_of, centreline_of
from daq.service.analyses.revolution import slow_roll_of, synchronous
from daq.service.analyses.spectra import frequency_spectrum_of, full_spectrum_of, order_spectrum
from daq.service.analyses.vectors import bode_of, polar_of
from daq.service.questions import Question


@dataclass(frozen=True, slots=True)
class AnalysisKind:
    """One kind.

    Parameters
    ----------
    meaning : str
        What it gives, in a sentence without its stop.
    question : type
        What may be asked.
    make : callable
        Makes it of a run's samples and a question.
    """

    meaning: str
    question: type[Question]
    make: Callable[..., Analysis]


KINDS: Final[Mapping[str, AnalysisKind]] = {
    "order-spectrum": AnalysisKind(
        "Amplitude and phase lag by order about a moment", questions.OrderSpectrumQuery, order_spectrum
    ),
    "full-spectrum": AnalysisKind(
        "Circles with and against the rotation by order about a moment", questions.FullSpectrumQuery, full_spectrum_of
    ),
    "frequency-spectrum": AnalysisKind(
        "Amplitude by frequency, averaged over a stretch of time; needs no tacho",
        questions.FrequencySpectrumQuery, frequency_spectrum_of,
    ),
    "cascade": AnalysisKind(
        "Spectra over speed: of orders, full, or of frequencies", questions.CascadeQuery, cascade
    ),
    "waterfall": AnalysisKind(
        "Spectra over time: of orders, full, or of frequencies", questions.WaterfallQuery, waterfall
    ),
    "bode": AnalysisKind(
        "Amplitude and phase lag of any order over speed, run-up and run-down apart", questions.VectorsQuery, bode_of
    ),
    "polar": AnalysisKind(
        "The same vectors, drawn in the plane", questions.VectorsQuery, polar_of
    ),
    "orbit": AnalysisKind(
        "The shaft's path about a moment: direct, of chosen orders (1X, 2X, nX), or without them (not-1X)",
        questions.OrbitQuery, orbit_of,
    ),
    "centreline": AnalysisKind(
        "The shaft's mean position in its clearance over speed", questions.CentrelineQuery, centreline_of
    ),
    "envelopes": AnalysisKind(
        "Amplitude and phase lag of several orders over time, by the Vold-Kalman filter",
        questions.EnvelopesQuery, envelopes,
    ),
    "waveforms": AnalysisKind(
        "Waveforms of single orders about a moment, by the Vold-Kalman filter", questions.WaveformsQuery, waveforms
    ),
    "average": AnalysisKind(
        "The synchronous average of a revolution about a moment, and the residual", questions.AverageQuery, synchronous
    ),
    "poincare": AnalysisKind(
        "The shaft's positions at the mark about a moment, and what they make", questions.PoincareQuery, poincare
    ),
    "bifurcation": AnalysisKind(
        "The shaft's position at the mark of every revolution over speed", questions.BifurcationQuery, bifurcation_of
    ),
    "sub-synchronous": AnalysisKind(
        "Every component below 1X: order, size, onset and end, whirl or whip",
        questions.SubSynchronousQuery, sub_synchronous,
    ),
    "overall": AnalysisKind(
        "Overall vibration and speed over time, against the limits; needs no tacho", questions.OverallQuery, overall_of
    ),
    "slow-roll": AnalysisKind(
        "The run-out that the run's own slow turning tells", questions.SlowRollQuery, slow_roll_of
    ),
}  # fmt: skip


def analysed(kind: str, run: Any, query: Question) -> Analysis:
    """Return an analysis of a run's samples."""
    return KINDS[kind].make(run, query)
