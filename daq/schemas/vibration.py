"""Schemas of vibration: vectors at the probes, limits of standards, comparison with the model and with the counter."""

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, Field

from analysis.live.summary import ProbeSummary
from analysis.signals import ComplexArray
from analysis.signals.snapshot import OVERALL, CounterReport, CounterState, Snapshot
from analysis.signals.standards import StandardLimit, standard_limits
from analysis.vectors.speed_curve import SpeedRow
from daq.schemas.units import Count, Number, Schema, degrees, finite, lag_degrees, micrometres, rpm
from model.prediction.comparison import Agreement, PredictedWhirl, SynchronousAgreement, WhirlAgreement

Amplitude = Annotated[float | None, Field(ge=0, le=1e6)]


class OverallSchema(Schema, of=(Snapshot,)):
    """Overall, unfiltered vibration."""

    peak_to_peak_x_um: Number = Field(examples=[38.4])
    peak_to_peak_y_um: Number = Field(examples=[41.0])
    rms_x_um: Number = Field(examples=[13.4])
    rms_y_um: Number = Field(examples=[14.1])


class LargestOverallSchema(Schema, of=(ProbeSummary,)):
    """Largest overall vibration of a probe, or of either probe, over a run."""

    largest_peak_to_peak_um: Number = Field(examples=[96.1])
    largest_rms_um: Number = Field(examples=[33.2])


class SpeedRowOverallSchema(Schema, of=(SpeedRow,)):
    """Mean and largest overall vibration in a speed bin."""

    mean_peak_to_peak_x_um: Number = Field(examples=[38.4])
    mean_peak_to_peak_y_um: Number = Field(examples=[41.0])
    largest_peak_to_peak_x_um: Number = Field(examples=[43.9])
    largest_peak_to_peak_y_um: Number = Field(examples=[47.2])
    mean_rms_x_um: Number = Field(examples=[13.4])
    mean_rms_y_um: Number = Field(examples=[14.1])
    largest_rms_x_um: Number = Field(examples=[15.3])
    largest_rms_y_um: Number = Field(examples=[16.4])


class OverallRangeQuery(BaseModel):
    """Ranges of the largest overall vibration of a run; null: any, also unknown."""

    peak_to_peak_from_um: Amplitude = Field(
        None,
        description="Only runs that reached this overall vibration, µm peak-to-peak",
        examples=[50.0],
    )
    peak_to_peak_to_um: Amplitude = Field(
        None,
        description="Only runs that did not exceed this overall vibration, µm peak-to-peak",
        examples=[90.0],
    )
    rms_from_um: Amplitude = Field(
        None, description="Only runs that reached this overall vibration, µm RMS", examples=[20.0]
    )
    rms_to_um: Amplitude = Field(
        None, description="Only runs that did not exceed this overall vibration, µm RMS", examples=[30.0]
    )

    def overall_ranges(self) -> tuple[tuple[str, float, float], ...]:
        """Return the measures `OVERALL` with a range: name, low and high, m."""
        ends = (
            (row, *(getattr(self, f"{row.name}_{end}_{row.suffix}") for end in ("from", "to"))) for row in OVERALL.rows
        )
        return tuple(
            (row.name, row.scale * (low or 0.0), math.inf if high is None else row.scale * high)
            for row, low, high in ends
            if (low, high) != (None, None)
        )


class ProbeVectorsSchema(Schema):
    """Amplitude and phase lag of one order at the two probes."""

    amplitude_peak_x_um: Number = Field(description="Amplitude at probe x, µm zero-to-peak", examples=[15.2])
    lag_x_deg: Number = Field(
        description="Phase lag at probe x after the keyphasor mark, 0 to 360 degrees", examples=[47.3]
    )
    amplitude_peak_y_um: Number = Field(description="Amplitude at probe y, µm zero-to-peak", examples=[16.8])
    lag_y_deg: Number = Field(
        description="Phase lag at probe y after the keyphasor mark, 0 to 360 degrees", examples=[136.9]
    )


def probe_vectors_schema(vectors: Sequence[complex] | ComplexArray) -> ProbeVectorsSchema:
    """Return the schema of the complex peak amplitudes of one order at probes x and y, m."""
    x, y = (complex(vector) for vector in vectors)
    return ProbeVectorsSchema(
        amplitude_peak_x_um=micrometres(math.hypot(x.real, x.imag)),
        lag_x_deg=lag_degrees(x),
        amplitude_peak_y_um=micrometres(math.hypot(y.real, y.imag)),
        lag_y_deg=lag_degrees(y),
    )


class MeasuredProbeVectorsSchema(ProbeVectorsSchema):
    """Measured amplitude and phase lag of one order at the two probes, with standard deviations."""

    amplitude_sigma_um: Number = Field(
        description="Standard deviation of either amplitude, from the noise between the lines, µm", examples=[0.05]
    )
    lag_sigma_x_deg: Number = Field(
        description="Standard deviation of the lag at probe x, from noise and the tacho's jitter, degrees",
        examples=[0.3],
    )
    lag_sigma_y_deg: Number = Field(description="Standard deviation of the lag at probe y, degrees", examples=[0.3])


def measured_probe_vectors_schema(
    vectors: Sequence[complex] | ComplexArray, sigma: float, phase_sigma: Sequence[float]
) -> MeasuredProbeVectorsSchema:
    """Return the schema of one order with the standard deviations of its amplitudes, m, and phases at x and y, rad."""
    return MeasuredProbeVectorsSchema(
        **probe_vectors_schema(vectors).model_dump(),
        amplitude_sigma_um=micrometres(sigma),
        lag_sigma_x_deg=degrees(phase_sigma[0]),
        lag_sigma_y_deg=degrees(phase_sigma[1]),
    )


VIBRATION_STANDARDS = ("ISO 20816-3", "API 617")  # with limits of overall vibration


class StandardSchema(Schema, of=(StandardLimit,)):
    """A limit of a standard compared with the largest vibration, for information: none covers floating rings."""

    standard: str = Field(examples=["ISO 20816-3"])
    name: str = Field(examples=["zone boundary A/B"])
    limit_peak_to_peak_um: Number = Field(examples=[39.1])
    limit_ratio: Number = Field(description="Largest overall vibration over the limit; null likewise", examples=[2.46])
    scope: str = Field(examples=["industrial machines above 15 kW that run at 120 to 30,000 r/min"])
    source: str = Field(examples=["as the field quotes it; not checked against the text"])


def standard_schemas(probes: tuple[ProbeSummary, ...]) -> tuple[StandardSchema, ...]:
    """Return the limits of standards at the speed of the largest vibration; empty where that speed is unknown."""
    worst = max(probes, key=lambda probe: probe.largest_peak_to_peak, default=None)
    if worst is None or worst.largest_at is None or not 0.0 < worst.largest_at.speed < math.inf:
        return ()
    return tuple(
        StandardSchema.of(figure, limit_ratio=finite(worst.largest_peak_to_peak / figure.limit))
        for figure in standard_limits(worst.largest_at.speed)
        if figure.standard in VIBRATION_STANDARDS
    )


class SynchronousAgreementSchema(Schema, of=(SynchronousAgreement,)):
    """Measured and predicted 1X compared over both probes."""

    speeds: Count = Field(examples=[52])
    median_amplitude_ratio: Number = Field(examples=[0.97])
    worst_amplitude_ratio: Number = Field(examples=[1.31])
    worst_amplitude_at_rpm: Number = Field(examples=[14_800.0])
    median_lag_difference_deg: Number = Field(examples=[3.2])
    worst_lag_difference_deg: Number = Field(examples=[-24.0])
    worst_lag_at_rpm: Number = Field(examples=[14_900.0])
    agrees_to_rpm: Number = Field(examples=[14_000.0])
    within_amplitude_ratio: Number = Field(examples=[0.08])
    within_lag_difference_deg: Number = Field(examples=[11.0])


class WhirlAgreementSchema(Schema, of=(WhirlAgreement, PredictedWhirl)):
    """Predicted and measured whirl of the same rank in order of onset speed."""

    predicted_order: Number = Field(examples=[0.7])
    predicted_onset_rpm: Number = Field(examples=[9500.0])
    predicted_largest_peak_um: Number = Field(examples=[22.0])
    measured_order: Number = Field(
        description="Measured order; null where the run showed no such whirl", examples=[0.49]
    )
    measured_onset_rpm: Number = Field(description="Measured onset speed, r/min; null likewise", examples=[10_980.0])
    measured_largest_peak_um: Number = Field(
        description="Largest measured amplitude, half the major axis of the ellipse, zero-to-peak, µm; null likewise",
        examples=[14.2],
    )
    onset_ratio: Number = Field(examples=[1.156])
    was_reached: bool = Field(examples=[True])


class AgreementSchema(Schema, of=(Agreement,)):
    """Agreement of a run with the model."""

    synchronous: SynchronousAgreementSchema | None = Field()
    whirls: tuple[WhirlAgreementSchema, ...] = Field()
    instability_onset_rpm: Number = Field(examples=[9320.0])


def agreement_schema(agreement: Agreement) -> AgreementSchema:
    """Return the schema of an agreement."""
    return AgreementSchema.of(agreement, whirls=tuple(map(_whirl, agreement.whirls)))


def _whirl(whirl: WhirlAgreement) -> WhirlAgreementSchema:
    measured = whirl.measured
    return WhirlAgreementSchema.of(
        whirl.predicted,
        whirl,
        measured_order=None if measured is None else finite(measured.order),
        measured_onset_rpm=None if measured is None else rpm(measured.onset.speed),
        measured_largest_peak_um=None if measured is None else micrometres(measured.amplitude),
    )


class CounterSchema(Schema, of=(CounterReport,)):
    """Comparison of the tacho's counter with its waveform since the start of the run."""

    state: CounterState = Field(examples=["agrees"])
    compared: Count = Field(examples=[40_180])
    missing: Count = Field(examples=[0])
    extra: Count = Field(examples=[0])
    out_of_tolerance: Count = Field(examples=[0])
    mean_difference_us: Number = Field(examples=[0.02])
    largest_difference_us: Number = Field(examples=[0.41])
    recent: Count = Field(examples=[250])
    recent_mismatches: Count = Field(examples=[0])
    message: str = Field(examples=[""])
    recent_message: str = Field(examples=[""])
