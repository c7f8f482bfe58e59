"""Fixtures for the tests of recordings: header, blocks, snapshots, databases."""

import math
import os
from collections.abc import Callable, Iterator
from uuid import uuid4

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import (
    Acquisition,
    AnalysisSettings,
    Calibration,
    Channel,
    Device,
    Edge,
    Limits,
    Role,
    RunHeader,
    Tacho,
)
from analysis.signals.snapshot import OVERALL, OrderFrame, RunOut, Snapshot, TachoReport, TachoState, Trace, Whirl
from analysis.signals.units import RPM
from tests.recordings.postgresql import new_schema, server

RATE = 20_000.0
STARTED_NS = 1_795_511_527_123_456_789


@pytest.fixture
def header() -> RunHeader:
    """Return the header of a run with two probes and a tacho at 20 kS/s."""
    calibration = Calibration(
        (1.234e-4, 1.0 / 7.87e4, -3.3e-9),
        0.5,
        9.5,
        1.7e-7,
        "2UM-117",
        "KD-2306 No. 3",
        "2026-03-02",
        "42CrMo4, diameter 10 mm",
        "M. Curie",
    )
    scaling = (1.7e-4, 10.0 / 32768 * 1.0001, 2.2e-14)
    channels = (
        Channel("x", Role.PROBE_X, "ai0", -10.0, 10.0, scaling, calibration, math.pi / 4, 1.0, 9.0),
        Channel("y", Role.PROBE_Y, "ai1", -10.0, 10.0, scaling, calibration, 3 * math.pi / 4, 1.0, 9.0),
        Channel("tacho", Role.TACHO, "ai2", -10.0, 10.0, scaling),
    )
    return RunHeader(
        run="2026-11-24T09-12-07-gj90c",
        rig="GJ90C bench",
        started_ns=STARTED_NS,
        acquisition=Acquisition(
            Device("nidaqmx", "USB-6251", "1A2B3C", "25.5", simulated=False),
            RATE,
            1.0e6 / 1.1,
            channels,
            Tacho(2.5, 1.0, Edge.FALLING, 1, 0.31, 1e-3, 1.5e-4),
        ),
        settings=AnalysisSettings(update_interval=0.1 / 3),
        limits=Limits(80e-6 * 1.01, 95e-6, 100e-6, 20_000 * RPM),
        config_toml='name = "GJ90C bench"  # µm\n',
        program="rig 0.1.0",
        note='oil 40 °C, "cold" start\n',
    )


@pytest.fixture
def codes_of() -> Callable[..., NDArray[np.int16]]:
    """Return a function that returns the codes of an interval: (segment, first, stop)."""
    return _codes


@pytest.fixture
def make_block() -> Callable[..., SampleBlock]:
    """Return a function that makes blocks; codes depend on segment and sample only, and reach both rails."""

    def make(segment: int, first_sample: int, n_samples: int, n_channels: int = 3) -> SampleBlock:
        return SampleBlock(
            _codes(segment, first_sample, first_sample + n_samples, n_channels),
            segment,
            first_sample,
            STARTED_NS + first_sample * 50_000 + 7,
            1000 + segment,
        )

    return make


@pytest.fixture
def make_snapshot() -> Callable[..., Snapshot]:
    """Return a function that makes snapshots with values that any rounding would change."""

    def make(segment: int, sample: int, *, with_frame: bool = True, with_whirl: bool = True) -> Snapshot:
        random = np.random.default_rng(sample)
        vectors = np.array([3e-6 + 1e-6j, -1e-6j / 3])
        whirl = Whirl(0.4987654321, 1e-5 / 3, 1e-6 / 7, vectors, 1e-4 / 3, 1e-8 / 7)
        weaker = Whirl(0.1711111111, 1e-6 / 3, 1e-6 / 9, vectors, 1e-3 / 3, 1e-8 / 7)
        runout = RunOut(random.standard_normal((8, 4)).view(np.complex128) * 1e-6, np.array([1e-8 / 3, 1e-8 / 9]))
        frame = OrderFrame(
            speed=1234.5 / 7,
            acceleration=-0.0,
            orders=np.arange(129) / 16,
            spectrum=random.standard_normal((2, 258)).view(np.complex128) * 1e-5,
            vectors=np.array([[1e-5 / 3 - 1e-6j, -1e-5 + 0j], [complex(-0.0, 0.0), 3e-7j]]),
            noise=1e-8 / 3,
            whirls=(whirl, weaker) if with_whirl else (),
            orbit=random.standard_normal((2, 256)) * 1e-5,
            sigma=np.array([1e-8 / 3, 1e-8 / 7]),
            angle_sigma=1e-3 / 7,
            runout=runout if with_whirl else None,
            compensated_orbit=random.standard_normal((2, 256)) * 1e-5 if with_whirl else None,
        )
        return Snapshot(
            segment=segment,
            sample=sample,
            time=sample / RATE,
            speed=1234.5 / 7 if with_frame else math.nan,
            tacho=TachoReport(
                TachoState.GOOD if with_frame else TachoState.NO_PULSES,
                1234,
                2,
                1,
                1e-7 / 3,
                phase_reference_is_arbitrary=with_frame,
            ),
            gap_volts=random.standard_normal(2) + 5,
            gap_in_window=np.array([True, False]),
            overall=random.random((len(OVERALL.rows), 2)) * 1e-4,
            clipped=np.array([0, 3, 0]),
            outside_calibration=np.array([0, 1_234_567]),
            frame=frame if with_frame else None,
            trace=Trace(np.arange(3.0), np.zeros((2, 3)), np.zeros(3)),
        )

    return make


def _codes(segment: int, first: int, stop: int, n_channels: int = 3) -> NDArray[np.int16]:
    """Return codes like noisy sines that reach both rails."""
    sample = np.arange(first, stop, dtype=np.uint64)
    noise = ((sample * np.uint64(2654435761)) >> np.uint64(7)) & np.uint64(15)
    angle = 2 * np.pi * 0.0075 * sample.astype(np.float64)
    rows = [np.round(40_000 * np.sin(angle + k + segment)) + noise.astype(np.float64) for k in range(n_channels)]
    codes: NDArray[np.int16] = np.clip(np.stack(rows), -32768, 32767).astype(np.int16)
    return codes


@pytest.fixture(scope="session")
def postgresql() -> Iterator[str]:
    """Run one PostgreSQL server for all tests; return its address."""
    with server() as address:
        yield address


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run a test with SQLite in the data folder, then with an empty schema of a PostgreSQL server."""
    before = os.environ.pop("RIG_CATALOGUE", None)
    if request.param == "postgresql":
        name = f"test_{uuid4().hex}"
        os.environ["RIG_CATALOGUE"] = new_schema(request.getfixturevalue("postgresql"), name)
    yield request.param
    os.environ.pop("RIG_CATALOGUE", None)
    if before is not None:
        os.environ["RIG_CATALOGUE"] = before
