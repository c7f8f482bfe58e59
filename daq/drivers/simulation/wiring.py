"""The wiring between the simulated sensors and the card, with the wiring faults that a preflight should detect."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.config.schema import Miswiring
from daq.drivers.simulation.random_streams import StreamPurpose, random_stream

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

NO_EDGES = {
    Miswiring.TACHO_SILENT,
    Miswiring.TACHO_REVERSED,
    Miswiring.TACHO_WEAK,
}  # faults without edges at the counter's line
OPENED = {Miswiring.X_OPEN: 0, Miswiring.Y_OPEN: 1, Miswiring.TACHO_SILENT: 2}  # number in x, y, tacho
REVERSED = {Miswiring.X_REVERSED: 0, Miswiring.TACHO_REVERSED: 2}
EXCHANGED = {Miswiring.PROBES_EXCHANGED: (0, 1), Miswiring.TACHO_EXCHANGED: (0, 2)}


@dataclass(frozen=True, slots=True)
class SimulatedWiring:
    """Transmits the sensors' voltages to the card's inputs, with a wiring fault.

    Parameters
    ----------
    miswiring : Miswiring
        The fault.
    rows : tuple of int
        Rows of probe x, probe y and the tacho.
    seed : int
        Seed of the run; determines the size of the fault.
    """

    miswiring: Miswiring
    rows: tuple[int, int, int]
    seed: int

    @property
    def reaches_counter(self) -> bool:
        """Whether the tacho's edges cross the logic levels of the counter's line."""
        return self.miswiring not in NO_EDGES

    def transmit(self, portion: int, time: FloatArray, volts: FloatArray) -> FloatArray:
        """Return the voltages at the inputs, V, for the sensors' voltages.

        Parameters
        ----------
        portion : int
            Number of the portion of the run.
        time : ndarray of float64, shape (n,)
            Sample times, s.
        volts : ndarray of float64, shape (n_channels, n)
            The sensors' voltages, V; may be overwritten.
        """
        how = random_stream(self.seed, StreamPurpose.WIRING)  # the same in all portions
        noise = random_stream(self.seed, StreamPurpose.WIRING_NOISE, portion)
        fault, n = self.miswiring, time.size
        x, y, tacho = self.rows
        if fault in OPENED:
            volts[self.rows[OPENED[fault]]] = _open(how, noise, n)
        elif fault in REVERSED:
            volts[self.rows[REVERSED[fault]]] *= -1.0
        elif fault in EXCHANGED:
            one, other = (self.rows[number] for number in EXCHANGED[fault])
            volts[[one, other]] = volts[[other, one]]
        elif fault is Miswiring.X_CLOSED:
            volts[x] = how.uniform(*TIP_VOLTS) + CONDITIONER_NOISE * noise.standard_normal(n)
        elif fault is Miswiring.Y_OUT_OF_REACH:
            volts[y] = how.uniform(*SATURATED_VOLTS) + CONDITIONER_NOISE * noise.standard_normal(n)
        elif fault is Miswiring.BRIDGED:
            volts[[x, y]] = np.mean(volts[[x, y]], axis=0) + CONVERTER_NOISE * noise.standard_normal((2, n))
        elif fault is Miswiring.TACHO_WEAK:
            volts[tacho] *= how.uniform(*WEAK)
        elif fault is Miswiring.HUM:
            volts[[x, y]] += _hum(how, time)
        return volts


def _open(how: np.random.Generator, noise: np.random.Generator, n: int) -> FloatArray:
    """Return the voltage of an open input with its bias resistor, V."""
    offset, rms = how.uniform(-OPEN_OFFSET, OPEN_OFFSET), how.uniform(*OPEN_NOISE)
    return np.asarray(offset + rms * noise.standard_normal(n), dtype=np.float64)


def _hum(how: np.random.Generator, time: FloatArray) -> FloatArray:
    """Return the mains hum that a ground loop adds, V."""
    angle = 2.0 * np.pi * how.choice([50.0, 60.0]) * how.uniform(0.999, 1.001) * time + how.uniform(0.0, 2.0 * np.pi)
    return np.asarray(how.uniform(*HUM) * (np.sin(angle) + HUM_THIRD * np.sin(3.0 * angle)), dtype=np.float64)
