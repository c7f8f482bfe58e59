"""What lies between the simulated sensors and the card: cables, and what a bench's hands do wrong with them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.config.schema import Miswiring
from daq.drivers.simulation.random_streams import Purpose, draws

FloatArray = NDArray[np.float64]

OPEN_NOISE = (2e-5, 3e-4)  # V rms: up to a code in the widest range
OPEN_OFFSET = 0.05  # V about zero
TIP_VOLTS = (0.02, 0.25)  # V: what a conditioner gives with the tip on the shaft
SATURATED_VOLTS = (11.0, 14.0)  # V: what it gives with nothing in reach
CONDITIONER_NOISE = 1e-3  # V rms
CONVERTER_NOISE = 1.5e-4  # V rms, of each input by itself
WEAK = (0.15, 0.35)  # of the tacho's voltage: a wrong divider
HUM = (0.1, 0.5)  # V peak: 10 to 50 µm
HUM_THIRD = 0.3  # of its amplitude, three times as fast

NO_EDGES = {Miswiring.TACHO_SILENT, Miswiring.TACHO_REVERSED, Miswiring.TACHO_WEAK}  # at the counter's line
OPENED = {Miswiring.X_OPEN: 0, Miswiring.Y_OPEN: 1, Miswiring.TACHO_SILENT: 2}  # number in x, y, tacho
REVERSED = {Miswiring.X_REVERSED: 0, Miswiring.TACHO_REVERSED: 2}
EXCHANGED = {Miswiring.PROBES_EXCHANGED: (0, 1), Miswiring.TACHO_EXCHANGED: (0, 2)}


@dataclass(frozen=True, slots=True)
class SimulatedWiring:
    """Takes the sensors' voltages to the card's inputs.

    Parameters
    ----------
    miswiring : Miswiring
        What is wrong.
    rows : tuple of int
        Rows of probe x, probe y and the tacho.
    seed : int
        Of the run: draws how wrong it is.
    """

    miswiring: Miswiring
    rows: tuple[int, int, int]
    seed: int

    @property
    def reaches_counter(self) -> bool:
        """Whether the tacho's edges pass the levels of the line that a counter listens to."""
        return self.miswiring not in NO_EDGES

    def carry(self, portion: int, time: FloatArray, volts: FloatArray) -> FloatArray:
        """Return the voltages at the inputs, V, for those of the sensors.

        Parameters
        ----------
        portion : int
            Number of the portion of the run.
        time : ndarray of float64, shape (n,)
            Of the samples, s.
        volts : ndarray of float64, shape (n_channels, n)
            Of the sensors; may be changed.
        """
        how = draws(self.seed, Purpose.WIRING)  # the same through the run
        noise = draws(self.seed, Purpose.WIRING_NOISE, portion)
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
    """Return what an input reads that nothing is connected to but its bias resistor, V."""
    offset, rms = how.uniform(-OPEN_OFFSET, OPEN_OFFSET), how.uniform(*OPEN_NOISE)
    return np.asarray(offset + rms * noise.standard_normal(n), dtype=np.float64)


def _hum(how: np.random.Generator, time: FloatArray) -> FloatArray:
    """Return what a loop through two mains earths adds, V."""
    angle = 2.0 * np.pi * how.choice([50.0, 60.0]) * how.uniform(0.999, 1.001) * time + how.uniform(0.0, 2.0 * np.pi)
    return np.asarray(how.uniform(*HUM) * (np.sin(angle) + HUM_THIRD * np.sin(3.0 * angle)), dtype=np.float64)
