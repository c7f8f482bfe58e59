"""The A/D converter of the simulated card: clocks, scaling and codes.

The limits are those of the card's `DeviceSpec`; the other figures are from NI's M Series manual and 6255 specification,
see `convert_rate` and `scaling`.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import CODE_MAX, CODE_MIN
from daq.config.devices import DeviceSpec

FloatArray = NDArray[np.float64]

PADDING = 10e-6  # s that the driver adds for the amplifier to settle if the sample interval allows it

# An uncalibrated converter, relative to the range: it exceeds the range by 4.8 % and has offset and curvature.
OFFSET = 6e-5
GAIN = 1.048
SQUARE = 1.5e-5  # at full scale
CUBE = -2.5e-5  # at full scale


def coerced_rate(card: DeviceSpec, rate: float) -> float:
    """Return the nearest rate, Hz, that the card's timebase allows: the timebase over a whole number."""
    return card.sample_timebase / max(round(card.sample_timebase / rate), 1)


def convert_rate(card: DeviceSpec, rate: float, channels: int) -> float:
    """Return the rate, Hz, of the multiplexer's convert clock.

    One fastest conversion plus 10 µs per channel if that fits into the sample interval, else evenly spaced (M Series,
    USB-621x and X Series manuals, AI Convert Clock), in whole ticks of the timebase.
    """
    timebase = card.sample_timebase
    between_samples = round(timebase / rate)
    padded = round(timebase * (1.0 / card.max_total_rate(channels) + PADDING))
    return timebase / (padded if padded * channels <= between_samples else between_samples // channels)


def scaling(full_range: float) -> tuple[float, float, float, float]:
    """Return the device's scaling polynomial, V per code**k, for the range ±``full_range``, V."""
    full_code = float(CODE_MAX + 1)
    return (
        OFFSET * full_range,
        GAIN * full_range / full_code,
        SQUARE * full_range / full_code**2,
        CUBE * full_range / full_code**3,
    )


def codes(volts: FloatArray, polynomial: tuple[float, ...]) -> NDArray[np.int16]:
    """Return the converter's codes for voltages, V: the inverted scaling polynomial, rounded and clipped."""
    offset, gain, square, cube = polynomial
    linear = (volts - offset) / gain
    code = linear
    for _ in range(2):  # the curvature is small, so each iteration gains four digits
        code = linear - code * code * (square + cube * code) / gain
    return np.clip(np.rint(code), CODE_MIN, CODE_MAX).astype(np.int16)
