"""A synthetic run-up with 1X, 2X and 0.5X, as codes of two probes and a tacho.

Run as a program, it prints the peak memory, KiB, of making the order map of a minute.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import angular_record_from_codes
from analysis.signals.header import Acquisition, Calibration, Channel, Device, Role, Tacho
from analysis.signals.units import MICROMETRE
from analysis.spectra.order_map import OrderMap, order_map

RATE = 100_000.0
DURATION = 60.0
MIN_TURN_RATE, MAX_TURN_RATE = 100.0, 1000.0  # revolutions per second
METRES_PER_VOLT, VOLTS_PER_CODE = 1e-4, 10.0 / 32768
CHUNK = 500_000


def acquisition() -> Acquisition:
    calibration = Calibration((50e-6, METRES_PER_VOLT), volts_low=0.5, volts_high=9.5)
    scaling = (0.0, VOLTS_PER_CODE)
    return Acquisition(
        device=Device("simulated", "benchmark", "0", "none", simulated=True),
        rate=RATE,
        convert_rate=1e6,
        channels=(
            Channel("x", Role.PROBE_X, "ai0", -10.0, 10.0, scaling, calibration),
            Channel("y", Role.PROBE_Y, "ai1", -10.0, 10.0, scaling, calibration, angle=np.pi / 2),
            Channel("tacho", Role.TACHO, "ai2", -10.0, 10.0, scaling),
        ),
        tacho=Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5),
    )


def run_up(duration: float, low: float = MIN_TURN_RATE, high: float = MAX_TURN_RATE) -> NDArray[np.int16]:
    """Return the codes of a linear run-up: 1X 20 um forward, 2X 5 um backward, 0.5X 8 um forward, noise 0.2 um rms."""
    random = np.random.default_rng(1)
    codes = np.empty((3, int(duration * RATE)), dtype=np.int16)
    for begin in range(0, codes.shape[1], CHUNK):
        index = np.arange(begin, min(begin + CHUNK, codes.shape[1]))
        for row in range(3):
            seconds = index / RATE + row / 1e6
            turn_rate = low + (high - low) / duration * seconds
            theta = np.pi * (low + turn_rate) * seconds
            if row == 2:
                volts = np.clip(2.0 + 2.0 * np.sin(theta) / np.sin(2 * np.pi * turn_rate * 15e-6), 0.0, 4.0)
            else:
                z = 20 * np.exp(1j * theta) + 5 * np.exp(-2j * theta) + 8 * np.exp(0.5j * theta)
                moved = (z.real, z.imag)[row] + 0.2 * random.standard_normal(index.size)
                volts = (450e-6 - MICROMETRE * moved) / METRES_PER_VOLT
            codes[row, index] = np.round(volts / VOLTS_PER_CODE)
    return codes


def order_map_of(codes: NDArray[np.int16]) -> OrderMap:
    """Return the order map of a run-up's codes."""
    return order_map(angular_record_from_codes(acquisition(), codes))


if __name__ == "__main__":
    import resource  # POSIX only

    order_map_of(run_up(DURATION))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
