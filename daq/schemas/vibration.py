"""Schemas of vibration: vectors at the probes, limits of standards, comparison with the model and with the counter."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from analysis.live.summary import ProbeSummary
from analysis.signals.snapshot import CounterReport, CounterState
from analysis.signals.standards import standard_limits
from analysis.signals.units import MICROSECOND
from daq.schemas.units import Schema, degrees, finite, lag_degrees, micrometres, rpm
from model.prediction.comparison import Agreement, SynchronousAgreement, WhirlAgreement


class Direction(StrEnum):
    """Sense of a whirl relative to the rotation."""

    FORWARD = "forward"  # with the shaft
    BACKWARD = "backward"


def direction(*, is_forward: bool) -> Direction:
    """Return the sense of a whirl."""
    return Direction.FORWARD if is_forward else Direction.BACKWARD


class ProbeVectorsSchema(Schema):
    """Amplitude and phase lag of one order at the two probes."""

    amplitude_peak_x_um: float | None = Field(description="Amplitude at probe x, µm zero-to-peak", examples=[15.2])
    lag_x_deg: float | None = Field(
        description="Phase lag at probe x after the keyphasor mark, 0 to 360 degrees", examples=[47.3]
    )
    amplitude_peak_y_um: float | None = Field(description="Amplitude at probe y, µm zero-to-peak", examples=[16.8])
    lag_y_deg: float | None = Field(
        description="Phase lag at probe y after the keyphasor mark, 0 to 360 degrees", examples=[136.9]
    )


def probe_vectors_schema(vectors: Sequence[complex]) -> ProbeVectorsSchema:
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

    amplitude_sigma_um: float | None = Field(
        description="Standard deviation of either amplitude, from the noise between the lines, µm", examples=[0.05]
    )
    lag_sigma_x_deg: float | None = Field(
        description="Standard deviation of the lag at probe x, from noise and the tacho's jitter, degrees",
        examples=[0.3],
    )
    lag_sigma_y_deg: float | None = Field(
        description="Standard deviation of the lag at probe y, degrees", examples=[0.3]
    )


def measured_probe_vectors_schema(
    vectors: Sequence[complex], sigma: float, phase_sigma: Sequence[float]
) -> MeasuredProbeVectorsSchema:
    """Return the schema of one order with the standard deviations of its amplitudes, m, and phases at x and y, rad."""
    return MeasuredProbeVectorsSchema(
        **probe_vectors_schema(vectors).model_dump(),
        amplitude_sigma_um=micrometres(sigma),
        lag_sigma_x_deg=degrees(phase_sigma[0]),
        lag_sigma_y_deg=degrees(phase_sigma[1]),
    )


VIBRATION_STANDARDS = ("ISO 20816-3", "API 617")  # with limits of overall vibration


class StandardSchema(Schema):
    """A limit of a standard compared with the largest vibration, for information: none covers floating rings."""

    standard: str = Field(description="Name of the standard", examples=["ISO 20816-3"])
    name: str = Field(description="Name of the limit in the standard", examples=["zone boundary A/B"])
    limit_peak_to_peak_um: float | None = Field(
        description="Limit at the speed of the largest vibration, µm peak-to-peak; null outside its scope",
        examples=[39.1],
    )
    limit_ratio: float | None = Field(
        description="Largest overall vibration over the limit; null likewise", examples=[2.46]
    )
    scope: str = Field(
        description="Machines that the standard covers",
        examples=["industrial machines above 15 kW that run at 120 to 30,000 r/min"],
    )
    source: str = Field(
        description="Source of the limit", examples=["as the field quotes it; not checked against the text"]
    )


def standard_schemas(probes: tuple[ProbeSummary, ...]) -> tuple[StandardSchema, ...]:
    """Return the limits of standards at the speed of the largest vibration; empty where that speed is unknown."""
    worst = max(probes, key=lambda probe: probe.largest_peak_to_peak, default=None)
    if worst is None or worst.largest_at is None or not 0.0 < worst.largest_at.speed < math.inf:
        return ()
    return tuple(
        StandardSchema(
            standard=figure.standard,
            name=figure.name,
            limit_peak_to_peak_um=micrometres(figure.limit),
            limit_ratio=finite(worst.largest_peak_to_peak / figure.limit),
            scope=figure.scope,
            source=figure.source,
        )
        for figure in standard_limits(worst.largest_at.speed)
        if figure.standard in VIBRATION_STANDARDS
    )


Count = Annotated[int, Field(ge=0)]


class SynchronousAgreementSchema(Schema):
    """Measured and predicted 1X compared over both probes."""

    speeds: Count = Field(description="Number of measured speeds compared", examples=[52])
    median_amplitude_ratio: float | None = Field(
        description="Median of measured over predicted amplitude", examples=[0.97]
    )
    worst_amplitude_ratio: float | None = Field(
        description="The ratio furthest from 1 on a logarithmic scale", examples=[1.31]
    )
    worst_amplitude_at_rpm: float | None = Field(description="Speed of that ratio, r/min", examples=[14_800.0])
    median_lag_difference_deg: float | None = Field(
        description="Median of measured minus predicted lag, degrees; positive where the measurement lags more",
        examples=[3.2],
    )
    worst_lag_difference_deg: float | None = Field(
        description="The difference with the largest magnitude, degrees", examples=[-24.0]
    )
    worst_lag_at_rpm: float | None = Field(description="Speed of that difference, r/min", examples=[14_900.0])
    agrees_to_rpm: float | None = Field(
        description="Speed up to which, from the lowest compared, every amplitude agrees within a factor of 1.28 and "
        "every lag within 30°, r/min; null where the lowest speed already does not",
        examples=[14_000.0],
    )
    within_amplitude_ratio: float | None = Field(
        description="Largest distance of a ratio from 1 up to that speed", examples=[0.08]
    )
    within_lag_difference_deg: float | None = Field(
        description="Largest magnitude of a lag difference up to that speed, degrees", examples=[11.0]
    )


class WhirlAgreementSchema(Schema):
    """Predicted and measured whirl of the same rank in order of onset speed."""

    predicted_order: float | None = Field(
        description="Predicted order at onset; null where no such whirl is predicted", examples=[0.7]
    )
    predicted_onset_rpm: float | None = Field(
        description="Predicted onset speed, r/min; null likewise", examples=[9500.0]
    )
    predicted_largest_peak_um: float | None = Field(
        description="Largest predicted amplitude, half the major axis of the ellipse, zero-to-peak, µm; null likewise",
        examples=[22.0],
    )
    measured_order: float | None = Field(
        description="Measured order; null where the run showed no such whirl", examples=[0.49]
    )
    measured_onset_rpm: float | None = Field(
        description="Measured onset speed, r/min; null likewise", examples=[10_980.0]
    )
    measured_largest_peak_um: float | None = Field(
        description="Largest measured amplitude, half the major axis of the ellipse, zero-to-peak, µm; null likewise",
        examples=[14.2],
    )
    onset_ratio: float | None = Field(
        description="Measured over predicted onset speed; null where one of them is missing", examples=[1.156]
    )
    was_reached: bool = Field(
        description="Whether the run reached the predicted onset speed; true where no whirl is predicted",
        examples=[True],
    )


class AgreementSchema(Schema):
    """Agreement of a run with the model."""

    synchronous: SynchronousAgreementSchema | None = Field(
        description="1X over speed; null where no measured speed can be compared"
    )
    whirls: tuple[WhirlAgreementSchema, ...] = Field(description="Whirls below 1X, by rising onset speed")
    instability_onset_rpm: float | None = Field(
        description="Lowest speed at which the predicted 1X motion is unstable, r/min; null where it is always stable",
        examples=[9320.0],
    )


def agreement_schema(agreement: Agreement) -> AgreementSchema:
    """Return the schema of an agreement."""
    synchronous = agreement.synchronous
    return AgreementSchema(
        synchronous=None if synchronous is None else _synchronous(synchronous),
        whirls=tuple(_whirl(whirl) for whirl in agreement.whirls),
        instability_onset_rpm=rpm(agreement.instability_onset),
    )


def _synchronous(one: SynchronousAgreement) -> SynchronousAgreementSchema:
    return SynchronousAgreementSchema(
        speeds=one.speeds,
        median_amplitude_ratio=finite(one.median_ratio),
        worst_amplitude_ratio=finite(one.worst_ratio),
        worst_amplitude_at_rpm=rpm(one.worst_ratio_speed),
        median_lag_difference_deg=degrees(one.median_phase),
        worst_lag_difference_deg=degrees(one.worst_phase),
        worst_lag_at_rpm=rpm(one.worst_phase_speed),
        agrees_to_rpm=rpm(one.agrees_to),
        within_amplitude_ratio=finite(one.within_ratio),
        within_lag_difference_deg=degrees(one.within_phase),
    )


def _whirl(whirl: WhirlAgreement) -> WhirlAgreementSchema:
    predicted, measured = whirl.predicted, whirl.measured
    return WhirlAgreementSchema(
        predicted_order=None if predicted is None else finite(predicted.order),
        predicted_onset_rpm=None if predicted is None else rpm(predicted.onset),
        predicted_largest_peak_um=None if predicted is None else micrometres(predicted.amplitude),
        measured_order=None if measured is None else finite(measured.order),
        measured_onset_rpm=None if measured is None else rpm(measured.onset.speed),
        measured_largest_peak_um=None if measured is None else micrometres(measured.amplitude),
        onset_ratio=finite(whirl.onset_ratio),
        was_reached=whirl.was_reached,
    )


class CounterSchema(Schema):
    """Comparison of the tacho's counter with its waveform since the start of the run."""

    state: CounterState = Field(description="Verdict of the comparison", examples=["agrees"])
    compared: Count = Field(description="Edges found by both", examples=[40_180])
    missing: Count = Field(description="Edges of the waveform without a time stamp of the counter", examples=[0])
    extra: Count = Field(description="Time stamps without an edge of the waveform", examples=[0])
    out_of_tolerance: Count = Field(
        description="Edges with a time difference above the limit of the rig file", examples=[0]
    )
    mean_difference_us: float | None = Field(
        description="Mean time of the counter minus that of the waveform, µs", examples=[0.02]
    )
    largest_difference_us: float | None = Field(
        description="Largest magnitude of the time difference, µs", examples=[0.41]
    )
    recent: Count = Field(description="Edges found by either in the last 10 s", examples=[250])
    recent_mismatches: Count = Field(
        description="Edges of the last 10 s that are missing, extra or out of tolerance", examples=[0]
    )
    message: str = Field(
        description="Disagreement over the whole run, for the operator; empty where both agree", examples=[""]
    )
    recent_message: str = Field(
        description="Disagreement in the last 10 s; empty where both agree or the counter has failed",
        examples=[""],
    )


def counter_schema(counter: CounterReport | None) -> CounterSchema | None:
    """Return the schema of a counter report; None without a counter."""
    if counter is None:
        return None
    return CounterSchema(
        state=counter.state,
        compared=counter.compared,
        missing=counter.missing,
        extra=counter.extra,
        out_of_tolerance=counter.out_of_tolerance,
        mean_difference_us=finite(counter.mean_difference / MICROSECOND),
        largest_difference_us=finite(counter.largest_difference / MICROSECOND),
        recent=counter.recent,
        recent_mismatches=counter.recent_mismatches,
        message=counter.message,
        recent_message=counter.recent_message,
    )
