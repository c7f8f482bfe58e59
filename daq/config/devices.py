"""Cards that the service knows, with their limits.

USB-6251: "NI 6251 Specifications" (M Series). USB-6211: ranges, 16 bits, pairs of inputs, clocks, 32-bit counters and
lines (PFI 0 to 3 are inputs, PFI 4 to 7 outputs) from the "NI USB-621x User Manual" (tables 3-1 and 4-1, chapter 10).
PCIe-6321: ranges, 16 bits, rates and clocks from the "X Series User Manual" (tables 4-1, 4-5). Not yet checked against
the cards' own specifications: how many inputs and counters both have, the rate of the USB-6211, and the logic levels of
both; check these before the first run with such a card. Every card here has 16 bits, because a recording's int16 codes
clip at their ends.
"""

from collections.abc import Mapping
from dataclasses import dataclass

SETTLING_TIME = 10e-6  # s that the driver adds for the amplifier to settle if the sample interval allows it


@dataclass(frozen=True, slots=True)
class DeviceSpec:
    """Limits of a card.

    Parameters
    ----------
    product : str
        Product name, the beginning of the driver's product type.
    input_ranges : tuple of float
        Ranges of the analog inputs, ±V, from the narrowest.
    resolution : int
        Bits of the converter.
    aggregate_rate : float
        Highest sample rate of several channels together, Hz.
    single_channel_rate : float
        Highest sample rate of one channel alone, Hz.
    differential_inputs : int
        Differential inputs, from ai0; the negative side of input n is single-ended input n + `differential_inputs`.
    single_ended_inputs : int
        Single-ended inputs, from ai0.
    sample_timebase : float
        Clock that is divided by whole numbers to give the sample and convert clocks, Hz.
    counters : int
        General-purpose counters, from ctr0.
    counter_width : int
        Bits of a count.
    counter_timebases : mapping of float to str
        Clocks that a counter can count: rate, Hz, and the driver's name; the fastest first.
    pfi_inputs : int
        Digital lines that can be a counter's input, from PFI0.
    """

    product: str
    input_ranges: tuple[float, ...]
    resolution: int
    aggregate_rate: float
    single_channel_rate: float
    differential_inputs: int
    single_ended_inputs: int
    sample_timebase: float
    counters: int
    counter_width: int
    counter_timebases: Mapping[float, str]
    pfi_inputs: int

    def max_total_rate(self, channels: int) -> float:
        """Return the highest sample rate of all channels together, Hz."""
        return self.single_channel_rate if channels == 1 else self.aggregate_rate

    def coerced_rate(self, rate: float) -> float:
        """Return the nearest sample rate, Hz, that the timebase allows: the timebase over a whole number."""
        return self.sample_timebase / max(round(self.sample_timebase / rate), 1)

    def convert_rate(self, rate: float, channels: int) -> float:
        """Return the rate, Hz, of the multiplexer's convert clock at a sample rate, Hz.

        One fastest conversion plus 10 µs per channel if that fits into the sample interval, else evenly spaced (M
        Series, USB-621x and X Series manuals, AI Convert Clock), in whole ticks of the timebase.
        """
        between_samples = round(self.sample_timebase / rate)
        padded = round(self.sample_timebase * (1.0 / self.max_total_rate(channels) + SETTLING_TIME))
        return self.sample_timebase / (padded if padded * channels <= between_samples else between_samples // channels)

    @property
    def counter_names(self) -> tuple[str, ...]:
        """Names of the counters, as "ctr0"."""
        return tuple(f"ctr{number}" for number in range(self.counters))

    @property
    def counter_wrap(self) -> int:
        """Number of ticks after which a count starts again from 0."""
        return 1 << self.counter_width

    @property
    def fastest_counter_timebase(self) -> float:
        """Rate of the fastest clock that a counter can count, Hz."""
        return max(self.counter_timebases)


LOW_LEVEL, HIGH_LEVEL = 0.8, 2.2  # V: logic levels of a PFI line of the USB-6251, required of the others too

M_SERIES_TIMEBASES = {80e6: "80MHzTimebase", 20e6: "20MHzTimebase", 100e3: "100kHzTimebase"}
X_SERIES_TIMEBASES = {100e6: "100MHzTimebase", 20e6: "20MHzTimebase", 100e3: "100kHzTimebase"}

DEVICES = {
    spec.product: spec
    for spec in (
        DeviceSpec(
            product="USB-6251",
            input_ranges=(0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
            resolution=16,
            aggregate_rate=1e6,
            single_channel_rate=1.25e6,
            differential_inputs=8,
            single_ended_inputs=16,
            sample_timebase=20e6,
            counters=2,
            counter_width=32,
            counter_timebases=M_SERIES_TIMEBASES,
            pfi_inputs=16,
        ),
        DeviceSpec(
            product="USB-6211",
            input_ranges=(0.2, 1.0, 5.0, 10.0),
            resolution=16,
            aggregate_rate=250e3,
            single_channel_rate=250e3,
            differential_inputs=8,
            single_ended_inputs=16,
            sample_timebase=20e6,
            counters=2,
            counter_width=32,
            counter_timebases=M_SERIES_TIMEBASES,
            pfi_inputs=4,
        ),
        DeviceSpec(
            product="PCIe-6321",
            input_ranges=(0.2, 1.0, 5.0, 10.0),
            resolution=16,
            aggregate_rate=250e3,
            single_channel_rate=250e3,
            differential_inputs=8,
            single_ended_inputs=16,
            sample_timebase=100e6,
            counters=4,
            counter_width=32,
            counter_timebases=X_SERIES_TIMEBASES,
            pfi_inputs=16,  # of 24 digital lines; the 8 of port 0 are no PFI lines
        ),
    )
}
"""The known cards by product name."""


def device_spec(product: str) -> DeviceSpec:
    """Return the limits of a card.

    Raises
    ------
    ValueError
        The product is unknown; names the known ones.
    """
    if product not in DEVICES:
        raise ValueError(f'product "{product}": expected one of {", ".join(DEVICES)}')
    return DEVICES[product]
