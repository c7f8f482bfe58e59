"""The simulated run that the gallery draws.

Its speed goes from 700 to 18,000 r/min and back, with a critical speed at 8,000 r/min, run-out, a whirl at 0.47X from
11,000 r/min that locks to 115 Hz, a shaft that rises in its clearance, and a few glitches.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord, angular_record
from analysis.signals.header import Tacho
from analysis.signals.probes import ProbePair
from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.full_spectrum import ProbeMismatch, probe_mismatch
from analysis.spectra.order_map import OrderMap, order_map
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle
from analysis.vectors.glitches import find_glitches
from analysis.vectors.runout import SlowRoll, slow_roll

FloatArray = NDArray[np.float64]

RATE, DURATION = 40_000.0, 30.0
MIN_SPEED, MAX_SPEED, CRITICAL, ONSET, LOCK = 700.0, 18_000.0, 8_000.0, 11_000.0, 115.0  # r/min; Hz


@dataclass(frozen=True)
class Run:
    """The simulated run and intermediate results that several plots share."""

    time: FloatArray
    displacement: FloatArray
    tacho: FloatArray
    angle: ShaftAngle
    raw: AngularRecord
    record: AngularRecord  # run-out subtracted
    roll: SlowRoll
    frames: OrderMap
    mismatch: ProbeMismatch
    rest_displacement: FloatArray

    def at(self, rpm: float, revolutions: int = 128) -> AngularRecord:
        """Return revolutions of the run-up, centred on a speed."""
        middle = int(np.argmax(self.record.speeds / RPM >= rpm))
        return self.record.section(middle - revolutions // 2, middle + revolutions // 2)

    def samples(self, rpm: float, duration: float) -> slice:
        """Return the samples of the run-up from a speed, for a duration in s."""
        begin = float(self.record.times[np.argmax(self.record.speeds / RPM >= rpm)])
        return slice(int(begin * RATE), int((begin + duration) * RATE))


def simulated() -> Run:
    """Return the simulated run."""
    random = np.random.default_rng(7)
    time = np.arange(int(RATE * DURATION)) / RATE
    hold = 1.5
    ramp = np.interp(time, [0, hold, 16, 18, DURATION], [MIN_SPEED, MIN_SPEED, MAX_SPEED, MAX_SPEED, MIN_SPEED])
    turn_rate = ramp / 60.0
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (turn_rate[1:] + turn_rate[:-1]) / RATE)]) + 0.3
    theta = 2 * np.pi * turns
    ratio = ramp / CRITICAL
    response = ratio**2 / (1 - ratio**2 + 2j * 0.12 * ratio)
    frequency = np.minimum(0.47 * turn_rate, LOCK)
    phase = 2 * np.pi * np.concatenate([[0.0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1]) / RATE)])
    strength = 12 * MICROMETRE * np.clip((ramp - ONSET) / 1_500.0, 0.0, 1.0)
    z = 5 * MICROMETRE * response * np.exp(1j * (theta + 0.5))
    z += 0.8 * MICROMETRE * np.conj(response) * np.exp(-1j * theta)
    z += 2 * MICROMETRE * ratio / (1 + ratio) * np.exp(1j * (2 * theta + 1.0)) + strength * np.exp(1j * phase)
    lift = ramp / MAX_SPEED
    z += 35 * MICROMETRE * lift**0.5 * np.exp(1j * (0.5 * np.pi - 1.1 * (1 - lift)))
    surface = 3 * MICROMETRE * np.cos(theta - 2.0) - 5 * MICROMETRE * np.exp(-0.5 * ((turns % 1.0 - 0.62) / 0.02) ** 2)
    displacement = np.stack([z.real, z.imag]) + surface + 0.15 * MICROMETRE * random.standard_normal((2, time.size))
    for place in random.integers(0, time.size, 12):
        displacement[place % 2, place] += 90 * MICROMETRE
    pulses = np.interp(np.arange(1.0, np.floor(turns[-1])), turns, time) + 1e-6 * random.standard_normal(
        int(turns[-1]) - 1
    )
    tacho = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-4)
    angle = shaft_angle(pulse_record(pulses, tacho))
    clean = find_glitches(displacement, RATE, angle)
    raw = angular_record(clean.displacement, RATE, angle, ProbePair(0.0, np.pi / 2))
    roll = slow_roll(raw, 0.9 * MIN_SPEED * RPM, 1.1 * MIN_SPEED * RPM)
    record = roll.subtract_waveform(raw)
    frames = order_map(record)
    return Run(
        time=time,
        displacement=displacement,
        tacho=np.where(turns % 1.0 < 0.5, 4.0, 0.0),
        angle=angle,
        raw=raw,
        record=record,
        roll=roll,
        frames=frames,
        mismatch=probe_mismatch(frames),
        rest_displacement=np.zeros(2),
    )
