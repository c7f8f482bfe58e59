"""How far a run agrees with the model.

How the tacho's counter and its waveform compare, as a document.
"""

from typing import Annotated

from pydantic import Field

from analysis.signals.snapshot import CounterReport, CounterState
from daq.schemas.units import Schema, degrees, finite, micrometres, rpm
from model.prediction.comparison import Agreement, SynchronousAgreement, WhirlAgreement

Count = Annotated[int, Field(ge=0)]


class SynchronousAgreementSchema(Schema):
    """Measured against predicted 1X; both probes count alike."""

    speeds: Count = Field(description="Number of measured speeds that are compared", examples=[52])
    median_amplitude_ratio: float | None = Field(
        description="Median of measured over predicted amplitude", examples=[0.97]
    )
    worst_amplitude_ratio: float | None = Field(
        description="The ratio furthest from 1 on a logarithmic scale", examples=[1.31]
    )
    worst_amplitude_at_rpm: float | None = Field(description="Speed at which that was, r/min", examples=[14_800.0])
    median_lag_difference_deg: float | None = Field(
        description="Median of measured minus predicted lag, degrees; positive where the measurement lags more",
        examples=[3.2],
    )
    worst_lag_difference_deg: float | None = Field(description="The largest in size, degrees", examples=[-24.0])
    worst_lag_at_rpm: float | None = Field(description="Speed at which that was, r/min", examples=[14_900.0])
    agrees_to_rpm: float | None = Field(
        description="Speed up to which, from the lowest compared, every amplitude is within a factor of 1.28 and every "
        "lag within 30°, r/min; null where the lowest already is not",
        examples=[14_000.0],
    )
    within_amplitude_ratio: float | None = Field(
        description="Up to there, largest distance of a ratio from 1", examples=[0.08]
    )
    within_lag_difference_deg: float | None = Field(
        description="Up to there, largest size of a lag's difference, degrees", examples=[11.0]
    )


class WhirlAgreementSchema(Schema):
    """Predicted and measured whirl of one rank: the first to come with rising speed, the second, and so on."""

    predicted_order: float | None = Field(
        description="Order at the onset that the model expects; null where it expects no such whirl", examples=[0.7]
    )
    predicted_onset_rpm: float | None = Field(
        description="Speed at which the model expects it to begin, r/min; null likewise", examples=[9500.0]
    )
    predicted_largest_peak_um: float | None = Field(
        description="Its largest size there, half the major axis of its ellipse, zero-to-peak, µm; null likewise",
        examples=[22.0],
    )
    measured_order: float | None = Field(
        description="Order that was measured; null where the run showed no such whirl", examples=[0.49]
    )
    measured_onset_rpm: float | None = Field(
        description="Speed at which it began, r/min; null likewise", examples=[10_980.0]
    )
    measured_largest_peak_um: float | None = Field(
        description="Its largest size, half the major axis of its ellipse, zero-to-peak, µm; null likewise",
        examples=[14.2],
    )
    onset_ratio: float | None = Field(
        description="Measured over predicted onset speed; null where one of them is missing", examples=[1.156]
    )
    was_reached: bool = Field(
        description="Whether the run came to the predicted onset; true where nothing is predicted", examples=[True]
    )


class AgreementSchema(Schema):
    """A run against the model."""

    synchronous: SynchronousAgreementSchema | None = Field(
        description="1X by speed; null where no measured speed can be compared"
    )
    whirls: tuple[WhirlAgreementSchema, ...] = Field(description="Below 1X, in rising order of onset")
    instability_onset_rpm: float | None = Field(
        description="Lowest speed from which the model's 1X motion is unstable, r/min; null where it never is",
        examples=[9320.0],
    )


def agreement_schema(agreement: Agreement) -> AgreementSchema:
    """Return how far a run agrees with the model as a document."""
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
        measured_onset_rpm=None if measured is None else rpm(measured.begin.speed),
        measured_largest_peak_um=None if measured is None else micrometres(measured.amplitude),
        onset_ratio=finite(whirl.onset_ratio),
        was_reached=whirl.was_reached,
    )


class CounterSchema(Schema):
    """The tacho's counter against its waveform since the run began."""

    state: CounterState = Field(description="The verdict", examples=["agrees"])
    compared: Count = Field(description="Edges that both have", examples=[40_180])
    missing: Count = Field(description="Edges of the waveform that the counter has not stamped", examples=[0])
    extra: Count = Field(description="Stamps where the waveform has no edge", examples=[0])
    out_of_tolerance: Count = Field(description="Edges that lie further apart than the rig says they may", examples=[0])
    mean_difference_us: float | None = Field(
        description="How much later the counter has them, in the mean, µs", examples=[0.02]
    )
    largest_difference_us: float | None = Field(description="Largest distance of the two, µs", examples=[0.41])
    recent: Count = Field(description="Edges of either in the last 10 s", examples=[250])
    recent_mismatches: Count = Field(description="Of those, the ones that are missing, extra or apart", examples=[0])
    message: str = Field(
        description="What an operator should know of the whole run; empty where they agree", examples=[""]
    )
    recent_message: str = Field(
        description="Whether they still differ where they have; empty where they agree, or the counter has failed",
        examples=[""],
    )


def counter_schema(counter: CounterReport | None) -> CounterSchema | None:
    """Return a comparison as a document; None where no counter stamps."""
    if counter is None:
        return None
    return CounterSchema(
        state=counter.state,
        compared=counter.compared,
        missing=counter.missing,
        extra=counter.extra,
        out_of_tolerance=counter.out_of_tolerance,
        mean_difference_us=finite(counter.mean_difference * 1e6),
        largest_difference_us=finite(counter.largest_difference * 1e6),
        recent=counter.recent,
        recent_mismatches=counter.recent_mismatches,
        message=counter.message,
        recent_message=counter.recent_message,
    )
