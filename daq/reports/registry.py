"""Registry of the analyses: title, description, columns, query parameters and functions of each kind, by source."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from daq.reports.analysis_result import AnalysisResult
from daq.reports.kinds.envelopes import analyse_envelopes, analyse_waveforms
from daq.reports.kinds.orbits import analyse_bifurcation, analyse_centreline, analyse_orbit, analyse_poincare
from daq.reports.kinds.recorded import (
    recorded_bode,
    recorded_cascade,
    recorded_full_spectrum,
    recorded_orbit,
    recorded_order_spectrum,
    recorded_polar,
    recorded_waterfall,
)
from daq.reports.kinds.spectra import (
    analyse_cascade,
    analyse_frequency_spectrum,
    analyse_full_spectrum,
    analyse_order_spectrum,
    analyse_waterfall,
)
from daq.reports.kinds.vectors import analyse_bode, analyse_polar, analyse_sub_synchronous
from daq.reports.kinds.waveform import analyse_overall, analyse_slow_roll, analyse_synchronous_average
from daq.reports.parameters import (
    AnalysisQuery,
    AverageQuery,
    BifurcationQuery,
    CascadeQuery,
    CentrelineQuery,
    EnvelopesQuery,
    FrequencySpectrumQuery,
    FullSpectrumQuery,
    OrbitQuery,
    OrderSpectrumQuery,
    OverallQuery,
    PoincareQuery,
    SlowRollQuery,
    Source,
    SubSynchronousQuery,
    VectorsQuery,
    WaterfallQuery,
    WaveformsQuery,
)
from daq.reports.run_samples import RunSamples

VECTORS: Final = (
    "ramp_direction",
    "speed_rpm",
    "amplitude_peak_x_um",
    "sigma_peak_x_um",
    "lag_x_deg",
    "lag_sigma_x_deg",
    "amplitude_peak_y_um",
    "sigma_peak_y_um",
    "lag_y_deg",
    "lag_sigma_y_deg",
    "frames",
)


Analyse: TypeAlias = Callable[[RunSamples, Any], AnalysisResult]


@dataclass(frozen=True, slots=True)
class AnalysisKind:
    """A kind of analysis.

    Parameters
    ----------
    title : str
        Displayed title.
    description : str
        What it returns, without a full stop.
    columns : tuple of str
        Names of the table's columns with default parameters.
    parameters : type
        Its query parameters.
    analyse_samples : callable
        Computes the result from a run's samples and the query parameters.
    analyse_recorded : callable or None
        Returns it as the live analysis recorded it, for the same parameters; None if a recording does not store it.
    """

    title: str
    description: str
    columns: tuple[str, ...]
    parameters: type[AnalysisQuery]
    analyse_samples: Analyse
    analyse_recorded: Analyse | None = None

    def analyse(self, run: RunSamples, query: AnalysisQuery) -> AnalysisResult:
        """Return the result from the source that the query names."""
        if query.source is Source.RECORDED and self.analyse_recorded is not None:
            return self.analyse_recorded(run, query)
        return self.analyse_samples(run, query)


KINDS: Final[Mapping[str, AnalysisKind]] = {
    "order-spectrum": AnalysisKind(
        "Order spectrum",
        "Amplitude and phase lag by order, at a time of the run",
        (
            "order",
            "amplitude_peak_x_um",
            "lag_x_deg",
            "lag_sigma_x_deg",
            "amplitude_peak_y_um",
            "lag_y_deg",
            "lag_sigma_y_deg",
        ),
        OrderSpectrumQuery,
        analyse_order_spectrum,
        recorded_order_spectrum,
    ),
    "full-spectrum": AnalysisKind(
        "Full spectrum",
        "Forward and backward components by order, at a time of the run",
        ("order", "amplitude_peak_um", "uncertain"),
        FullSpectrumQuery,
        analyse_full_spectrum,
        recorded_full_spectrum,
    ),
    "frequency-spectrum": AnalysisKind(
        "Frequency spectrum",
        "Amplitude by frequency, averaged over a time interval; needs no tacho",
        ("frequency_hz", "amplitude_peak_x_um", "amplitude_peak_y_um"),
        FrequencySpectrumQuery,
        analyse_frequency_spectrum,
    ),
    "cascade": AnalysisKind(
        "Cascade",
        "Spectra over speed: order, full or frequency spectra",
        ("speed_rpm", "order", "amplitude_peak_um"),
        CascadeQuery,
        analyse_cascade,
        recorded_cascade,
    ),
    "waterfall": AnalysisKind(
        "Waterfall",
        "Spectra over time: order, full or frequency spectra",
        ("time_s", "order", "amplitude_peak_um"),
        WaterfallQuery,
        analyse_waterfall,
        recorded_waterfall,
    ),
    "bode": AnalysisKind(
        "Bode plot of an order",
        "Amplitude and phase lag of any order over speed, run-up and run-down separately",
        VECTORS,
        VectorsQuery,
        analyse_bode,
        recorded_bode,
    ),
    "polar": AnalysisKind(
        "Polar plot of an order",
        "Amplitude and phase lag of any order over speed, as vectors in the plane",
        VECTORS,
        VectorsQuery,
        analyse_polar,
        recorded_polar,
    ),
    "orbit": AnalysisKind(
        "Orbit",
        "Orbit at a time of the run: direct, of selected orders (1X, 2X, nX), or without them (not-1X)",
        ("revolution", "angle_deg", "time_s", "X_um", "Y_um"),
        OrbitQuery,
        analyse_orbit,
        recorded_orbit,
    ),
    "centreline": AnalysisKind(
        "Shaft centreline",
        "Mean position of the shaft in its clearance over speed",
        ("time_s", "speed_rpm", "X_um", "Y_um", "X_sigma_um", "Y_sigma_um", "eccentricity_ratio", "attitude_deg"),
        CentrelineQuery,
        analyse_centreline,
    ),
    "envelopes": AnalysisKind(
        "Envelopes of orders",
        "Amplitude and phase lag of several orders over time, by the Vold-Kalman filter",
        (
            "time_s",
            "speed_rpm",
            "order",
            "amplitude_peak_x_um",
            "sigma_peak_x_um",
            "lag_x_deg",
            "amplitude_peak_y_um",
            "sigma_peak_y_um",
            "lag_y_deg",
        ),
        EnvelopesQuery,
        analyse_envelopes,
    ),
    "waveforms": AnalysisKind(
        "Waveforms of orders",
        "Waveforms of single orders at a time of the run, by the Vold-Kalman filter",
        ("time_s", "angle_deg", "order", "displacement_x_um", "displacement_y_um"),
        WaveformsQuery,
        analyse_waveforms,
    ),
    "average": AnalysisKind(
        "Synchronous average",
        "Synchronous average of a revolution at a time of the run, and the residual",
        ("angle_deg", "average_x_um", "average_y_um", "residual_rms_x_um", "residual_rms_y_um"),
        AverageQuery,
        analyse_synchronous_average,
    ),
    "poincare": AnalysisKind(
        "Poincaré section",
        "Shaft positions at the keyphasor mark at a time of the run, and their pattern",
        ("revolution", "time_s", "speed_rpm", "X_um", "Y_um"),
        PoincareQuery,
        analyse_poincare,
    ),
    "bifurcation": AnalysisKind(
        "Bifurcation diagram",
        "Shaft position at the keyphasor mark of every revolution over speed",
        ("time_s", "speed_rpm", "X_um", "Y_um"),
        BifurcationQuery,
        analyse_bifurcation,
    ),
    "sub-synchronous": AnalysisKind(
        "Components below 1X",
        "Components below 1X: order, amplitude, onset and end, whirl or whip",
        (
            "component",
            "order",
            "order_sigma",
            "onset_rpm",
            "end_rpm",
            "begin_s",
            "end_s",
            "largest_peak_um",
            "sigma_peak_um",
            "largest_at_rpm",
            "exponent",
            "exponent_sigma",
            "lock_rpm",
            "lock_sigma_rpm",
            "direction",
            "behaviour",
        ),
        SubSynchronousQuery,
        analyse_sub_synchronous,
    ),
    "overall": AnalysisKind(
        "Overall vibration",
        "Overall vibration and speed over time, compared with the limits; needs no tacho",
        (
            "time_s",
            "speed_rpm",
            "peak_to_peak_x_um",
            "peak_to_peak_y_um",
            "clearance_fraction_x",
            "clearance_fraction_y",
            "severity",
        ),
        OverallQuery,
        analyse_overall,
    ),
    "slow-roll": AnalysisKind(
        "Run-out",
        "Run-out over the shaft angle, from the slow roll of the run",
        ("angle_deg", "runout_x_um", "runout_y_um"),
        SlowRollQuery,
        analyse_slow_roll,
    ),
}
