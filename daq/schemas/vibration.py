"""Schemas of vibration: vectors at the two probes, sense of whirl, limits of standards."""

import math
from collections.abc import Sequence
from enum import StrEnum

from pydantic import Field

from analysis.live.summary import ProbeSummary
from analysis.signals.standards import standard_limits
from daq.schemas.units import Schema, degrees, finite, lag_degrees, micrometres


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
