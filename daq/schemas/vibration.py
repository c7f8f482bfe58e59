"""How vibration is told: a line of the order spectrum at the two probes, and which way a whirl goes."""

import math
from collections.abc import Sequence
from enum import StrEnum

from pydantic import Field

from daq.schemas.document import Document
from daq.schemas.units import degrees, lag_degrees, micrometres


class Direction(StrEnum):
    """Which way a whirl goes round."""

    FORWARD = "forward"  # with the shaft
    BACKWARD = "backward"


def direction(*, is_forward: bool) -> Direction:
    """Return the word for a direction."""
    return Direction.FORWARD if is_forward else Direction.BACKWARD


class ProbesDocument(Document):
    """One line of the order spectrum at the two probes."""

    amplitude_peak_x_um: float | None = Field(description="Amplitude at probe x, µm zero-to-peak", examples=[15.2])
    lag_x_deg: float | None = Field(
        description="Phase lag at probe x after the tacho's mark, 0 to 360 degrees", examples=[47.3]
    )
    amplitude_peak_y_um: float | None = Field(description="Amplitude at probe y, µm zero-to-peak", examples=[16.8])
    lag_y_deg: float | None = Field(
        description="Phase lag at probe y after the tacho's mark, 0 to 360 degrees", examples=[136.9]
    )


def probes_document(vectors: Sequence[complex]) -> ProbesDocument:
    """Return the complex peak amplitudes of one line at the probes x and y, m, as a document."""
    x, y = (complex(vector) for vector in vectors)
    return ProbesDocument(
        amplitude_peak_x_um=micrometres(math.hypot(x.real, x.imag)),
        lag_x_deg=lag_degrees(x),
        amplitude_peak_y_um=micrometres(math.hypot(y.real, y.imag)),
        lag_y_deg=lag_degrees(y),
    )


class MeasuredProbesDocument(ProbesDocument):
    """One line of the measured order spectrum at the two probes, and how sure it is."""

    amplitude_sigma_um: float | None = Field(
        description="Standard deviation of either amplitude, from the noise beside the line, µm", examples=[0.05]
    )
    lag_sigma_x_deg: float | None = Field(
        description="Standard deviation of the lag at probe x, from noise and the tacho's jitter, degrees",
        examples=[0.3],
    )
    lag_sigma_y_deg: float | None = Field(description="The same at probe y, degrees", examples=[0.3])


def measured_probes_document(
    vectors: Sequence[complex], sigma: float, phase_sigma: Sequence[float]
) -> MeasuredProbesDocument:
    """Return a line with the standard deviations of its amplitudes, m, and of its phases at x and y, rad."""
    return MeasuredProbesDocument(
        **probes_document(vectors).model_dump(),
        amplitude_sigma_um=micrometres(sigma),
        lag_sigma_x_deg=degrees(phase_sigma[0]),
        lag_sigma_y_deg=degrees(phase_sigma[1]),
    )
