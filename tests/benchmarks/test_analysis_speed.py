"""Speed of the live analysis relative to the card, in CPU time of one core."""

import time

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.live.analyser import Analyser
from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, AnalysisSettings, Calibration, Channel, Device, Role, Tacho

DURATION = 10.0
VOLTS_PER_CODE = 10.0 / 32768


def acquisition(rate: float) -> Acquisition:
    calibration = Calibration((50e-6, 1e-4), volts_low=0.5, volts_high=9.5)
    scaling = (0.0, VOLTS_PER_CODE)
    return Acquisition(
        device=Device("simulated", "benchmark", "0", "none", simulated=True),
        rate=rate,
        convert_rate=1e6,
        channels=(
            Channel("x", Role.PROBE_X, "ai0", -10.0, 10.0, scaling, calibration),
            Channel("y", Role.PROBE_Y, "ai1", -10.0, 10.0, scaling, calibration, angle=np.pi / 2),
            Channel("tacho", Role.TACHO, "ai2", -10.0, 10.0, scaling),
        ),
        tacho=Tacho(threshold=2.0, hysteresis=1.0),
    )


def run_up(rate: float) -> NDArray[np.int16]:
    """Return the codes of a run-up from 1,000 to 20,000 r/min with 1X, 2X and whirl."""
    seconds = np.arange(int(rate * DURATION)) / rate
    theta = 2 * np.pi * (16.7 * seconds + 0.5 * 316.6 / DURATION * seconds**2)
    z = 20e-6 * np.exp(1j * theta) + 8e-6 * np.exp(0.47j * theta) + 3e-6 * np.exp(2j * theta)
    noise = 0.1e-6 * np.random.default_rng(1).standard_normal((2, seconds.size))
    volts = (450e-6 - np.stack([z.real, z.imag]) - noise) / 1e-4
    tacho = np.clip(2.0 + 40.0 * np.sin(theta), 0.0, 4.0)
    return np.round(np.vstack([volts, tacho]) / VOLTS_PER_CODE).astype(np.int16)


@pytest.mark.benchmark
@pytest.mark.parametrize(("rate", "min_ratio"), [(200_000.0, 20), (333_333.0, 15)])  # the second is the card's maximum
def test_analysis_is_many_times_faster_than_the_card(rate: float, min_ratio: int) -> None:
    codes = run_up(rate)
    size = int(rate / 10)
    blocks = [
        SampleBlock(np.ascontiguousarray(codes[:, begin : begin + size]), 0, begin, 0)
        for begin in range(0, codes.shape[1], size)
    ]
    analyser = Analyser(acquisition(rate), AnalysisSettings())
    used = []
    snapshots = []
    for block in blocks:
        begin = time.process_time()
        snapshots += analyser.add_block(block)
        used.append(time.process_time() - begin)
    ratio = DURATION / sum(used)
    print(
        f"\nanalysis of 3 × {rate / 1000:.0f} kS/s: {1e3 * np.median(used):.2f} ms for each 0.1 s "
        f"(99 % within {1e3 * np.quantile(used, 0.99):.2f} ms), {ratio:.0f} times as fast as the card"
    )
    assert sum(snapshot.frame is not None for snapshot in snapshots) > 90
    assert ratio > min_ratio
