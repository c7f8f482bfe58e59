"""One simulated probe: from displacement to the voltage of its conditioner."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.signals.header import Calibration
from daq.drivers.simulation.random_streams import Purpose, draws

FloatArray = NDArray[np.float64]

TABLE = 4096
BEYOND = 0.1  # part of the calibrated span by which the conditioner's output goes beyond it before it saturates
GLITCH_LENGTH = 1e-4  # s


class GapToVolts:
    """A calibration read backwards: the voltage that a gap gives, saturating beyond the calibrated span.

    Parameters
    ----------
    calibration : Calibration
        Gap, m, as a rising polynomial of voltage.
    """

    def __init__(self, calibration: Calibration) -> None:
        margin = BEYOND * (calibration.volts_high - calibration.volts_low)
        volts = np.linspace(calibration.volts_low - margin, calibration.volts_high + margin, TABLE)
        gaps = np.polynomial.polynomial.polyval(volts, calibration.coefficients)
        falls = np.flatnonzero(np.diff(gaps) <= 0.0)
        middle = TABLE // 2
        first = int(falls[falls < middle].max()) + 1 if np.any(falls < middle) else 0
        stop = int(falls[falls >= middle].min()) + 1 if np.any(falls >= middle) else TABLE
        self._volts, self._gaps = volts[first:stop], gaps[first:stop]

    def __call__(self, gap: FloatArray) -> FloatArray:
        """Return the voltage, V, for gaps, m."""
        return np.asarray(np.interp(gap, self._gaps, self._volts), dtype=np.float64)

    def slope(self, gap: float) -> float:
        """Return the change of voltage with gap, V/m, near a gap, m; 0 where the output is saturated."""
        near = np.array([gap - 1e-6, gap + 1e-6])
        return float(np.diff(self(near))[0] / 2e-6)


class FirstOrder:
    """A first-order low pass, exact for an input that is linear between samples.

    Parameters
    ----------
    corner : float
        Frequency of -3 dB, Hz.
    rate : float
        Sample rate, Hz.
    """

    def __init__(self, corner: float, rate: float) -> None:
        decay = 2.0 * np.pi * corner / rate
        pole = np.exp(-decay)
        held = (1.0 - pole) / decay
        self._forward = np.array([1.0 - held, held - pole])
        self._back = np.array([1.0, -pole])
        self._state: FloatArray | None = None

    def __call__(self, signal: FloatArray) -> FloatArray:
        """Return the next samples; before the first the input stood still."""
        if self._state is None:
            self._state = np.array([(1.0 - self._forward[0]) * signal[0]])
        filtered, self._state = lfilter(self._forward, self._back, signal, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)


class SimulatedProbe:
    """A probe and its conditioner.

    Parameters
    ----------
    calibration : Calibration
        Of the probe.
    standing_gap : float
        With the shaft in the bearing's centre, m.
    noise : float
        Of the conditioner, m rms.
    bandwidth : float
        Of the conditioner, Hz.
    glitches : tuple of float
        How many a second, and the rms of their heights, m.
    rate : float
        Sample rate, Hz.
    key : tuple of int
        Seed of the run and number of the probe.
    """

    def __init__(
        self,
        calibration: Calibration,
        *,
        standing_gap: float,
        noise: float,
        bandwidth: float,
        glitches: tuple[float, float],
        rate: float,
        key: tuple[int, int],
    ) -> None:
        self._gap_to_volts = GapToVolts(calibration)
        self._standing_gap = standing_gap
        self._noise = noise * abs(self._gap_to_volts.slope(standing_gap))
        self._low_pass = FirstOrder(bandwidth, rate)
        self._glitches = glitches
        self._rate = rate
        self._seed, self._number = key

    def volts(self, portion: int, displacement: FloatArray) -> FloatArray:
        """Return the conditioner's output, V, in the next fixed portion of the run.

        Parameters
        ----------
        portion : int
            Its number, from 0, one after the other.
        displacement : ndarray of float64, shape (n,)
            Of the shaft towards the probe, m.
        """
        gap = self._standing_gap - displacement - self._glitch(portion, displacement.size)
        volts = self._low_pass(self._gap_to_volts(gap))
        rng = draws(self._seed, Purpose.PROBE_NOISE, self._number, portion)
        return volts + self._noise * rng.standard_normal(displacement.size)

    def _glitch(self, portion: int, n: int) -> FloatArray | float:
        """Return the glitches of a portion, m: short half waves that no shaft could make."""
        per_second, height = self._glitches
        rng = draws(self._seed, Purpose.GLITCHES, self._number, portion)
        count = int(rng.poisson(per_second * n / self._rate))
        length = min(max(int(GLITCH_LENGTH * self._rate), 1), n)
        if count == 0:
            return 0.0
        glitches = np.zeros(n)
        shape = np.sin(np.pi * (np.arange(length) + 0.5) / length)
        for start in rng.integers(0, n - length + 1, size=count):
            glitches[start : start + length] += height * rng.standard_normal() * shape
        return glitches
