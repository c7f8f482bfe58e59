"""A simulated probe: from displacement to the voltage of its conditioner."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.signals.header import Calibration
from daq.drivers.simulation.random_streams import StreamPurpose, random_stream

FloatArray = NDArray[np.float64]

TABLE_SIZE = 4096
SATURATION_MARGIN = 0.1  # of the calibrated span: the conditioner's output exceeds the span by it, then saturates
GLITCH_LENGTH = 1e-4  # s


class GapToVolts:
    """The inverse of a calibration: voltage as a function of gap, saturating beyond the calibrated span.

    Parameters
    ----------
    calibration : Calibration
        Gap, m, as a rising polynomial of voltage.
    """

    def __init__(self, calibration: Calibration) -> None:
        margin = SATURATION_MARGIN * (calibration.volts_high - calibration.volts_low)
        volts = np.linspace(calibration.volts_low - margin, calibration.volts_high + margin, TABLE_SIZE)
        gaps = np.polynomial.polynomial.polyval(volts, calibration.coefficients)
        falls = np.flatnonzero(np.diff(gaps) <= 0.0)
        middle = TABLE_SIZE // 2
        first = int(falls[falls < middle].max()) + 1 if np.any(falls < middle) else 0
        stop = int(falls[falls >= middle].min()) + 1 if np.any(falls >= middle) else TABLE_SIZE
        self._volts, self._gaps = volts[first:stop], gaps[first:stop]

    def __call__(self, gap: FloatArray) -> FloatArray:
        """Return the voltage, V, for gaps, m."""
        return np.asarray(np.interp(gap, self._gaps, self._volts), dtype=np.float64)

    def slope(self, gap: float) -> float:
        """Return the change of voltage with gap, V/m, near a gap, m; 0 if the output is saturated."""
        near = np.array([gap - 1e-6, gap + 1e-6])
        return float(np.diff(self(near))[0] / 2e-6)


class FirstOrderLowPass:
    """A first-order low-pass filter, exact for an input that is linear between samples.

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
        """Return the next filtered samples; the input is assumed constant before the first one."""
        if self._state is None:
            self._state = np.array([(1.0 - self._forward[0]) * signal[0]])
        filtered, self._state = lfilter(self._forward, self._back, signal, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)


class SimulatedProbe:
    """A probe and its conditioner.

    Parameters
    ----------
    calibration : Calibration
        Calibration of the probe.
    standing_gap : float
        Gap with the shaft in the bearing's centre, m.
    noise : float
        Noise of the conditioner, m rms.
    bandwidth : float
        Bandwidth of the conditioner, Hz.
    glitches : tuple of float
        Glitches per second, and the rms of their heights, m.
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
        self._low_pass = FirstOrderLowPass(bandwidth, rate)
        self._glitches = glitches
        self._rate = rate
        self._seed, self._number = key

    def volts(self, portion: int, displacement: FloatArray) -> FloatArray:
        """Return the conditioner's output, V, in the next fixed portion of the run.

        Parameters
        ----------
        portion : int
            Its number; consecutive calls count from 0.
        displacement : ndarray of float64, shape (n,)
            Displacement of the shaft towards the probe, m.
        """
        gap = self._standing_gap - displacement - self._glitch(portion, displacement.size)
        volts = self._low_pass(self._gap_to_volts(gap))
        rng = random_stream(self._seed, StreamPurpose.PROBE_NOISE, self._number, portion)
        return volts + self._noise * rng.standard_normal(displacement.size)

    def _glitch(self, portion: int, n: int) -> FloatArray | float:
        """Return the glitches of a portion, m: half sine waves too short to be shaft motion."""
        per_second, height = self._glitches
        rng = random_stream(self._seed, StreamPurpose.GLITCHES, self._number, portion)
        count = int(rng.poisson(per_second * n / self._rate))
        length = min(max(int(GLITCH_LENGTH * self._rate), 1), n)
        if count == 0:
            return 0.0
        glitches = np.zeros(n)
        shape = np.sin(np.pi * (np.arange(length) + 0.5) / length)
        for start in rng.integers(0, n - length + 1, size=count):
            glitches[start : start + length] += height * rng.standard_normal() * shape
        return glitches
