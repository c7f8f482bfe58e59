"""The wiring between the simulated sensors and the card, and the wiring faults that a preflight should detect.

Each fault is one class. Its constructor draws the size of the fault from the seed of the run, the same throughout the
run. `apply` gives the effect at given times, so that it does not depend on how the run is divided.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq.config.schema import Miswiring
from daq.drivers.simulation import StreamPurpose, random_stream

FloatArray = NDArray[np.float64]

OPEN_NOISE = (2e-5, 3e-4)  # V rms: up to a code in the widest range
OPEN_OFFSET = 0.05  # V about zero
TIP_VOLTS = (0.02, 0.25)  # V: output of a conditioner with the probe's tip on the shaft
SATURATED_VOLTS = (11.0, 14.0)  # V: output with no target in range
CONDITIONER_NOISE = 1e-3  # V rms
CONVERTER_NOISE = 1.5e-4  # V rms, independent for each input
WEAK = (0.15, 0.35)  # of the tacho's voltage: a wrong divider
HUM = (0.1, 0.5)  # V peak: 10 to 50 µm
HUM_THIRD = 0.3  # third harmonic, relative to the fundamental
CONTACT_INTERVAL = 0.25  # s, an interval in which contact is lost at least once
MAX_CONTACT_LOSSES = 3  # in an interval
CONTACT_LOSS = (0.002, 0.03)  # s, duration of a loss


@dataclass(frozen=True, slots=True)
class SensorRows:
    """Rows of the sensors in the samples.

    Parameters
    ----------
    x, y, tacho : int
        Rows of probe x, probe y and the tacho.
    """

    x: int
    y: int
    tacho: int


class CorrectWiring:
    """Correct wiring, and the base class of the wiring faults.

    Attributes
    ----------
    reaches_counter : bool
        Whether the tacho's edges cross the logic levels of the counter's line.
    """

    reaches_counter: bool = True

    def apply(self, time: FloatArray, volts: FloatArray, noise: np.random.Generator) -> None:
        """Change the sensors' voltages to those at the inputs.

        Parameters
        ----------
        time : ndarray of float64, shape (n,)
            Sample times from the beginning of the run, s.
        volts : ndarray of float64, shape (n_channels, n)
            The sensors' voltages, V; changed in place.
        noise : Generator
            Source of the noise at these times.
        """


class OpenInput(CorrectWiring):
    """Nothing is connected to an input; its bias resistor pulls it to zero."""

    def __init__(self, row: int, seed: int, *, is_tacho: bool = False) -> None:
        size = random_stream(seed, StreamPurpose.WIRING)
        self._row = row
        self._offset, self._rms = size.uniform(-OPEN_OFFSET, OPEN_OFFSET), size.uniform(*OPEN_NOISE)
        self.reaches_counter = not is_tacho

    def apply(self, time: FloatArray, volts: FloatArray, noise: np.random.Generator) -> None:
        """Replace the sensor's voltage by that of the open input."""
        volts[self._row] = self._offset + self._rms * noise.standard_normal(time.size)


class IntermittentContact(OpenInput):
    """A damaged probe cable: contact is lost for short random intervals, and the input is open meanwhile."""

    def __init__(self, row: int, seed: int) -> None:
        super().__init__(row, seed)
        self._seed = seed

    def apply(self, time: FloatArray, volts: FloatArray, noise: np.random.Generator) -> None:
        """Replace the sensor's voltage by that of the open input while contact is lost."""
        connected = volts[self._row].copy()
        super().apply(time, volts, noise)
        volts[self._row] = np.where(self.is_lost(time), volts[self._row], connected)

    def is_lost(self, time: FloatArray) -> NDArray[np.bool_]:
        """Return whether contact is lost at rising times, s."""
        lost = np.zeros(time.size, dtype=np.bool_)
        first, last = (math.floor(end / CONTACT_INTERVAL) for end in (time[0], time[-1]))
        for number in range(first, last + 1):
            # A stream for each interval, so that its losses do not depend on where a portion of the run begins.
            rng = random_stream(self._seed, StreamPurpose.CONTACT, number)
            for duration in rng.uniform(*CONTACT_LOSS, rng.integers(1, MAX_CONTACT_LOSSES, endpoint=True)):
                start = number * CONTACT_INTERVAL + rng.uniform(0.0, CONTACT_INTERVAL - duration)
                lost |= (time >= start) & (time < start + duration)
        return lost


class ReversedInput(CorrectWiring):
    """The two wires of an input are exchanged."""

    def __init__(self, row: int, *, is_tacho: bool = False) -> None:
        self._row = row
        self.reaches_counter = not is_tacho

    def apply(self, _time: FloatArray, volts: FloatArray, _noise: np.random.Generator) -> None:
        """Change the sign of the voltage."""
        volts[self._row] *= -1.0


class ExchangedInputs(CorrectWiring):
    """Two sensors are connected to each other's inputs."""

    def __init__(self, first: int, second: int) -> None:
        self._rows = [first, second]

    def apply(self, _time: FloatArray, volts: FloatArray, _noise: np.random.Generator) -> None:
        """Exchange the voltages."""
        volts[self._rows] = volts[self._rows[::-1]]


class ConstantOutput(CorrectWiring):
    """A conditioner at one end of its output, whatever the shaft does."""

    def __init__(self, row: int, volts: tuple[float, float], seed: int) -> None:
        self._row = row
        self._volts = random_stream(seed, StreamPurpose.WIRING).uniform(*volts)

    def apply(self, time: FloatArray, volts: FloatArray, noise: np.random.Generator) -> None:
        """Replace the voltage by a constant with the conditioner's noise."""
        volts[self._row] = self._volts + CONDITIONER_NOISE * noise.standard_normal(time.size)


class BridgedInputs(CorrectWiring):
    """Two inputs touch and have the mean of both signals."""

    def __init__(self, first: int, second: int) -> None:
        self._rows = [first, second]

    def apply(self, time: FloatArray, volts: FloatArray, noise: np.random.Generator) -> None:
        """Replace both voltages by their mean, with the noise of the converter."""
        volts[self._rows] = np.mean(volts[self._rows], axis=0) + CONVERTER_NOISE * noise.standard_normal((2, time.size))


class WeakTacho(CorrectWiring):
    """A wrong divider at the tacho's output."""

    reaches_counter = False

    def __init__(self, row: int, seed: int) -> None:
        self._row = row
        self._part = random_stream(seed, StreamPurpose.WIRING).uniform(*WEAK)

    def apply(self, _time: FloatArray, volts: FloatArray, _noise: np.random.Generator) -> None:
        """Attenuate the voltage."""
        volts[self._row] *= self._part


class MainsHum(CorrectWiring):
    """A ground loop that adds mains hum with its third harmonic to both probes."""

    def __init__(self, rows: list[int], seed: int) -> None:
        size = random_stream(seed, StreamPurpose.WIRING)
        self._rows = rows
        self._frequency, self._deviation = size.choice([50.0, 60.0]), size.uniform(0.999, 1.001)
        self._phase = size.uniform(0.0, 2.0 * np.pi)
        self._volts = size.uniform(*HUM)

    def apply(self, time: FloatArray, volts: FloatArray, _noise: np.random.Generator) -> None:
        """Add the hum."""
        angle = 2.0 * np.pi * self._frequency * self._deviation * time + self._phase
        volts[self._rows] += self._volts * (np.sin(angle) + HUM_THIRD * np.sin(3.0 * angle))


FAULTS: Final[dict[Miswiring, Callable[[SensorRows, int], CorrectWiring]]] = {
    Miswiring.NONE: lambda _rows, _seed: CorrectWiring(),
    Miswiring.X_OPEN: lambda rows, seed: OpenInput(rows.x, seed),
    Miswiring.Y_OPEN: lambda rows, seed: OpenInput(rows.y, seed),
    Miswiring.X_INTERMITTENT: lambda rows, seed: IntermittentContact(rows.x, seed),
    Miswiring.X_CLOSED: lambda rows, seed: ConstantOutput(rows.x, TIP_VOLTS, seed),
    Miswiring.Y_OUT_OF_REACH: lambda rows, seed: ConstantOutput(rows.y, SATURATED_VOLTS, seed),
    Miswiring.X_REVERSED: lambda rows, _seed: ReversedInput(rows.x),
    Miswiring.BRIDGED: lambda rows, _seed: BridgedInputs(rows.x, rows.y),
    Miswiring.PROBES_EXCHANGED: lambda rows, _seed: ExchangedInputs(rows.x, rows.y),
    Miswiring.TACHO_EXCHANGED: lambda rows, _seed: ExchangedInputs(rows.x, rows.tacho),
    Miswiring.TACHO_SILENT: lambda rows, seed: OpenInput(rows.tacho, seed, is_tacho=True),
    Miswiring.TACHO_REVERSED: lambda rows, _seed: ReversedInput(rows.tacho, is_tacho=True),
    Miswiring.TACHO_WEAK: lambda rows, seed: WeakTacho(rows.tacho, seed),
    Miswiring.HUM: lambda rows, seed: MainsHum([rows.x, rows.y], seed),
}
"""The fault for each value of `[simulation] miswiring`, from the rows of the sensors and the seed of the run."""
