"""Fixtures: a bench of known motion whose codes pass through a simulated card, and records of known motion."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.live.analyser import Analyser
from analysis.resampling.angular_record import AngularRecord, angular_record_from_codes
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Limits,
    Role,
    RunHeader,
    Tacho,
)
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import RPM

FloatArray = NDArray[np.float64]
Codes = NDArray[np.int16]
Motion = Callable[[FloatArray], tuple[FloatArray, FloatArray]]  # theta, rad, to motion in X and Y, m
Angle = Callable[[FloatArray], FloatArray]  # time, s, to theta, rad

VOLTS_PER_CODE = 10.0 / 32768
METRES_PER_VOLT = 1e-4


def steady(turn_rate: float, start: float = 0.3) -> Angle:
    """Return the angle at a constant speed, revolutions per second."""
    return lambda time: 2 * np.pi * (turn_rate * time + start)


def ramp(begin: float, end: float, duration: float) -> Angle:
    """Return the angle of a linear ramp from begin to end, revolutions per second."""
    return lambda time: 2 * np.pi * (begin * time + 0.5 * (end - begin) / duration * time**2)


def circles(*components: tuple[float, float, float]) -> Motion:
    """Return the sum of circles: radius, m; order, negative for backward; phase, rad."""

    def motion(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        z = np.zeros(theta.shape, dtype=np.complex128)
        for radius, order, phase in components:
            z += radius * np.exp(1j * np.sign(order) * (abs(order) * theta + phase))
        return z.real, z.imag

    return motion


def make_acquisition(rate: float, angles: tuple[float, float], tacho: Tacho) -> Acquisition:
    """Return an acquisition of two probes and a tacho."""
    calibration = Calibration(coefficients=(50e-6, METRES_PER_VOLT), volts_low=0.5, volts_high=9.5)
    scaling = (0.0, VOLTS_PER_CODE)
    probes = tuple(
        Channel(
            name=name,
            role=role,
            physical=f"ai{row}",
            range_low=-10.0,
            range_high=10.0,
            scaling=scaling,
            calibration=calibration,
            angle=angle,
            gap_low=1.0,
            gap_high=9.0,
        )
        for row, (name, role, angle) in enumerate(
            [("x", Role.PROBE_X, angles[0]), ("y", Role.PROBE_Y, angles[1])],
        )
    )
    return Acquisition(
        device=Device("simulated", "test bench", "0", "none", simulated=True),
        rate=rate,
        convert_rate=4 * rate,
        channels=(*probes, Channel("tacho", Role.TACHO, "ai2", -10.0, 10.0, scaling)),
        tacho=tacho,
    )


@dataclass(frozen=True)
class Bench:
    """Known motion sampled through an acquisition."""

    acquisition: Acquisition
    settings: AnalysisSettings
    noise: float = 0.1e-6  # m rms; also the converter's dither
    tacho_rise: float = 30e-6

    steady = staticmethod(steady)
    ramp = staticmethod(ramp)
    circles = staticmethod(circles)

    def codes(self, angle: Angle, motion: Motion, duration: float) -> Codes:
        """Return the codes, shape (3, n), of a motion given as a function of shaft angle."""
        acquisition = self.acquisition
        n = round(duration * acquisition.rate)
        random = np.random.default_rng(1)
        rows = []
        for row, channel in enumerate(acquisition.channels):
            time = np.arange(n) / acquisition.rate + row / acquisition.convert_rate
            if channel.calibration is None:
                volts = self.tacho_volts(angle, time)
            else:
                X, Y = motion(angle(time))
                displacement = X * np.cos(channel.angle) + Y * np.sin(channel.angle)
                displacement += self.noise * random.standard_normal(n)
                volts = (500e-6 - displacement - channel.calibration.coefficients[0]) / METRES_PER_VOLT
            rows.append(np.clip(np.round(volts / VOLTS_PER_CODE), -32768, 32767))
        return np.array(rows).astype(np.int16)

    def tacho_volts(self, angle: Angle, time: FloatArray) -> FloatArray:
        """Return the tacho voltage, 0 to 4.3 V: the mark begins at theta = 0 and the edges are linear."""
        tacho = self.acquisition.tacho
        marks = tacho.pulses_per_revolution
        turns = angle(time - tacho.delay) * marks / (2 * np.pi)
        width = np.gradient(turns, time) * self.tacho_rise
        middle = 0.5 * tacho.mark_fraction
        phase = (turns + 0.5 - middle) % 1.0 - 0.5 + middle
        light = np.minimum(0.5 + phase / width, 0.5 + (tacho.mark_fraction - phase) / width)
        return 4.3 * np.clip(light, 0.0, 1.0)

    def blocks(self, codes: Codes, size: int, *, first: int = 0, segment: int = 0) -> Iterator[SampleBlock]:
        """Yield the codes in blocks of a size."""
        for begin in range(0, codes.shape[1], size):
            piece = np.ascontiguousarray(codes[:, begin : begin + size])
            yield SampleBlock(piece, segment=segment, first_sample=first + begin, host_time_ns=0)

    def snapshots(self, codes: Codes, size: int = 10_000) -> list[Snapshot]:
        """Return the snapshots of the codes as one segment."""
        analyser = Analyser(self.acquisition, self.settings)
        snapshots = [snapshot for block in self.blocks(codes, size) for snapshot in analyser.add_block(block)]
        return snapshots + analyser.end_segment(SegmentEnd(0, codes.shape[1], EndReason.FINISHED))

    def frames(self, angle: Angle, motion: Motion, duration: float) -> list[OrderFrame]:
        """Return the order frames of a motion."""
        snapshots = self.snapshots(self.codes(angle, motion, duration))
        return [snapshot.frame for snapshot in snapshots if snapshot.frame is not None]


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    """Return a factory of benches: rate, probe angles, noise, changed tacho fields and analysis settings."""

    def make(
        *,
        rate: float = 100_000.0,
        angles: tuple[float, float] = (0.0, np.pi / 2),
        noise: float = 0.1e-6,
        tacho: dict[str, Any] | None = None,
        **settings: Any,
    ) -> Bench:
        read = replace(Tacho(threshold=2.15, hysteresis=1.0), **(tacho or {}))
        return Bench(make_acquisition(rate, angles, read), replace(AnalysisSettings(), **settings), noise)

    return make


@pytest.fixture
def header(make_bench: Callable[..., Bench]) -> RunHeader:
    """Return the header of a run on the bench."""
    bench = make_bench()
    return RunHeader(
        run="2026-01-01T00-00-00-test",
        rig="test",
        started_ns=1_767_225_600_000_000_000,
        acquisition=bench.acquisition,
        settings=bench.settings,
        limits=Limits(80e-6, 95e-6, 100e-6, 20_000 * RPM),
        config_toml="",
        program="test",
    )


@pytest.fixture
def make_record(make_bench: Callable[..., Bench]) -> Callable[..., AngularRecord]:
    """Return a factory of angular records sampled on a bench: motion, angle, duration, arguments of `make_bench`."""

    def make(motion: Motion, angle: Angle, duration: float, *, points: int = 64, **bench: Any) -> AngularRecord:
        made = make_bench(**bench)
        return angular_record_from_codes(made.acquisition, made.codes(angle, motion, duration), points=points)

    return make


@pytest.fixture
def make_angular() -> Callable[..., AngularRecord]:
    """Return a factory of exact angular records at constant speed, without card or tacho: the given circles."""

    def make(
        *components: tuple[float, float, float],
        revolutions: int = 64,
        points: int = 64,
        turn_rate: float = 100.0,
        noise: float = 0.0,
        mean: tuple[float, float] = (0.0, 0.0),
        seed: int = 0,
    ) -> AngularRecord:
        theta = 2 * np.pi * np.arange(revolutions * points) / points
        motion = np.stack(circles(*components)(theta)).reshape(2, revolutions, points)
        motion += noise * np.random.default_rng(seed).standard_normal(motion.shape)
        motion += np.array(mean)[:, None, None]
        times = np.arange(revolutions + 1) / turn_rate
        return AngularRecord(motion, 0, times, ProbePair(0.0, np.pi / 2), 0.0, np.zeros(times.size))

    return make
