"""A bench of known motion: codes as the card would deliver them, with its multiplexer's skew and its converter."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.run import Acquisition, AnalysisSettings, Calibration, Channel, Device, Limits, Role, RunHeader, Tacho
from analysis.samples import SampleBlock

FloatArray = NDArray[np.float64]
Motion = Callable[[FloatArray], tuple[FloatArray, FloatArray]]  # theta, rad, to motion in X and Y, m
Angle = Callable[[FloatArray], FloatArray]  # time, s, to theta, rad

VOLTS_PER_CODE = 10.0 / 32768
METRES_PER_VOLT = 1e-4


@dataclass(frozen=True)
class Bench:
    """Known motion seen through an acquisition."""

    acquisition: Acquisition
    tacho_rise: float = 30e-6
    tacho_low: float = 0.1
    tacho_high: float = 4.2
    noise: float = 0.1e-6  # also the converter's dither
    seed: int = 1

    def codes(self, angle: Angle, motion: Motion, n: int) -> NDArray[np.int16]:
        """Return the codes, shape (n_channels, n), of a motion given against the shaft's angle."""
        acquisition = self.acquisition
        random = np.random.default_rng(self.seed)
        rows = []
        for row, channel in enumerate(acquisition.channels):
            time = np.arange(n) / acquisition.rate + row / acquisition.convert_rate
            if channel.role is Role.TACHO:
                volts = self.tacho_volts(angle, time)
            else:
                X, Y = motion(angle(time))
                displacement = X * np.cos(channel.angle) + Y * np.sin(channel.angle)
                displacement += self.noise * random.standard_normal(n)
                assert channel.calibration is not None
                volts = (500e-6 - displacement - channel.calibration.coefficients[0]) / METRES_PER_VOLT
            rows.append(np.clip(np.round(volts / VOLTS_PER_CODE), -32768, 32767))
        return np.array(rows).astype(np.int16)

    def tacho_volts(self, angle: Angle, time: FloatArray) -> FloatArray:
        """Return the tacho's voltage: the mark covers the first part of each turn, edges are straight ramps."""
        tacho = self.acquisition.tacho
        marks = tacho.pulses_per_revolution
        theta = angle(time - tacho.delay)
        pulse_rate = np.gradient(theta, time) * marks / (2 * np.pi)
        middle = 0.5 * tacho.mark_fraction
        phase = (theta * marks / (2 * np.pi) + 0.5 - middle) % 1.0 - 0.5 + middle
        width = pulse_rate * self.tacho_rise
        light = np.minimum(0.5 + phase / width, 0.5 + (tacho.mark_fraction - phase) / width)
        return self.tacho_low + (self.tacho_high - self.tacho_low) * np.clip(light, 0.0, 1.0)


def steady(turn_rate: float, start: float = 0.3) -> Angle:
    """Return the angle of a steady speed, revolutions a second."""
    return lambda time: 2 * np.pi * (turn_rate * time + start)


def ramp(begin: float, end: float, duration: float) -> Angle:
    """Return the angle of a speed that rises evenly from begin to end, revolutions a second."""
    return lambda time: 2 * np.pi * (begin * time + 0.5 * (end - begin) / duration * time**2)


def acquisition(rate: float = 100_000.0, **tacho: float) -> Acquisition:
    """Return an acquisition of two probes at right angles and a tacho."""
    calibration = Calibration(coefficients=(50e-6, METRES_PER_VOLT), volts_low=0.5, volts_high=9.5)
    scaling = (0.0, VOLTS_PER_CODE)

    def channel(name: str, role: Role, physical: str, angle: float = 0.0) -> Channel:
        is_probe = role is not Role.TACHO
        gap = {"gap_low": 1.0, "gap_high": 9.0} if is_probe else {}
        return Channel(
            name, role, physical, -10.0, 10.0, scaling, calibration if is_probe else None, angle=angle, **gap
        )

    return Acquisition(
        device=Device("simulated", "test bench", "0", "none", simulated=True),
        rate=rate,
        convert_rate=4 * rate,
        channels=(
            channel("x", Role.PROBE_X, "ai0"),
            channel("y", Role.PROBE_Y, "ai1", np.pi / 2),
            channel("tacho", Role.TACHO, "ai2"),
        ),
        tacho=replace(Tacho(threshold=2.15, hysteresis=1.0), **tacho),  # type: ignore[arg-type]  # ints among floats
    )


def blocks(codes: NDArray[np.int16], size: int, *, first: int = 0, segment: int = 0) -> Iterator[SampleBlock]:
    """Yield the codes in blocks of a size."""
    for begin in range(0, codes.shape[1], size):
        piece = np.ascontiguousarray(codes[:, begin : begin + size])
        yield SampleBlock(piece, segment=segment, first_sample=first + begin, host_time_ns=0)


@pytest.fixture
def header() -> RunHeader:
    return RunHeader(
        run="2026-01-01T00-00-00-test",
        rig="test",
        started_ns=1_767_225_600_000_000_000,
        acquisition=acquisition(),
        settings=AnalysisSettings(),
        limits=Limits(80e-6, 95e-6, 100e-6, 2 * np.pi * 20_000 / 60),
        config_toml="",
        program="test",
    )
