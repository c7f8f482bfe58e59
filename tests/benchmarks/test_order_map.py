"""How much faster than the run the order map of a run-up is, beside the other open program that makes one."""

import subprocess
import sys
import time

import numpy as np
import pytest
from numpy.typing import NDArray
from rota import maps, speed

from analysis.live.analyser import Analyser
from analysis.resampling.angular_record import angular_record_from_codes
from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, AnalysisSettings, Calibration, Channel, Device, Role, Tacho
from analysis.spectra.order_map import OrderMap, order_map
from analysis.vectors.vold_kalman import order_envelopes

pytestmark = pytest.mark.benchmark

RATE = 100_000.0
DURATION = 60.0
SLOWEST, FASTEST = 100.0, 1000.0  # revolutions a second
MICRO = 1e-6
METRES_PER_VOLT, VOLTS_PER_CODE = 1e-4, 10.0 / 32768
ORDERS = ((1.0, 20.0, 0.05), (2.0, 5.0, 0.20), (0.5, 8.0, 0.12))  # order, um peak, bar of the rms error, %
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


def run_up(duration: float, slowest: float = SLOWEST, fastest: float = FASTEST) -> NDArray[np.int16]:
    """Return the codes of an even run-up: 1X 20 um forward, 2X 5 um backward, 0.5X 8 um forward, noise 0.2 um rms."""
    random = np.random.default_rng(1)
    codes = np.empty((3, int(duration * RATE)), dtype=np.int16)
    for begin in range(0, codes.shape[1], CHUNK):
        index = np.arange(begin, min(begin + CHUNK, codes.shape[1]))
        for row in range(3):
            seconds = index / RATE + row / 1e6
            turn_rate = slowest + (fastest - slowest) / duration * seconds
            theta = np.pi * (slowest + turn_rate) * seconds
            if row == 2:
                volts = np.clip(2.0 + 2.0 * np.sin(theta) / np.sin(2 * np.pi * turn_rate * 15e-6), 0.0, 4.0)
            else:
                z = 20 * np.exp(1j * theta) + 5 * np.exp(-2j * theta) + 8 * np.exp(0.5j * theta)
                moved = (z.real, z.imag)[row] + 0.2 * random.standard_normal(index.size)
                volts = (450e-6 - MICRO * moved) / METRES_PER_VOLT
            codes[row, index] = np.round(volts / VOLTS_PER_CODE)
    return codes


def errors(amplitudes: NDArray[np.float64], lines_an_order: int) -> list[float]:
    """Return the rms error of each order's amplitude, shape (n_frames, n_orders) in um, in per cent."""
    return [
        float(100 * np.sqrt(np.mean((amplitudes[:, round(order * lines_an_order)] / amplitude - 1.0) ** 2)))
        for order, amplitude, _ in ORDERS
    ]


def mapped(codes: NDArray[np.int16]) -> OrderMap:
    return order_map(angular_record_from_codes(acquisition(), codes))


def test_the_order_map_of_a_minute_is_made_thirty_times_as_fast_as_it_ran() -> None:
    codes = run_up(DURATION)
    mapped(codes[:, : int(2 * RATE)])
    used = []
    for _ in range(3):
        begin = time.process_time()
        found = mapped(codes)
        used.append(time.process_time() - begin)
    ratio = DURATION / min(used)
    seen = errors(np.abs(found.spectrum[0]) / MICRO, 16)
    print(
        f"\norder map of {DURATION:.0f} s of 2 channels: {ratio:.0f} times real time; rms errors {np.round(seen, 3)} %"
    )
    assert all(error <= bar for error, (_, _, bar) in zip(seen, ORDERS, strict=True))
    phase = np.degrees(np.angle(found.spectrum[0, :, 16]))
    drift = phase[-phase.size // 3 :].mean() - phase[: phase.size // 3].mean()
    print(f"phase of 1X: bias {phase.mean():.4f}, scatter {phase.std():.3f}, drift {drift:.4f} degrees")
    assert max(abs(float(phase.mean())), float(phase.std())) <= 0.1
    assert abs(float(drift)) < 0.01
    assert ratio > 30


def test_the_order_map_of_a_minute_takes_less_than_half_a_gigabyte() -> None:
    program = (
        "import resource, sys; sys.path.insert(0, 'tests/benchmarks'); import test_order_map as t; "
        "codes = t.run_up(t.DURATION); t.mapped(codes); print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    megabytes = int(done.stdout.split()[-1]) / 1024
    print(f"\npeak memory of the whole process, samples included: {megabytes:.0f} MB")
    assert megabytes < 500


def test_the_order_map_is_nine_times_as_fast_as_rota_at_equal_accuracy() -> None:
    duration = 12.0
    codes = run_up(duration)
    probes = acquisition().channels
    begin = time.process_time()
    found = mapped(codes)
    ours = time.process_time() - begin
    both = np.stack([probes[row].displacement(codes[row]) for row in (0, 1)], axis=1) / MICRO
    tacho = probes[2].volts(codes[2])
    begin = time.process_time()
    rpm = speed.tacho_to_rpm(tacho, RATE, level=2.0, hysteresis=1.0)
    theirs_map = maps.rpm_order_map(
        both - both.mean(axis=0), RATE, rpm, order_resolution=1 / 16, max_order=10, amplitude="peak"
    )
    theirs = time.process_time() - begin
    values = np.abs(np.asarray(theirs_map.values))
    frames = values[:, :, 0] if values.shape[0] != np.size(theirs_map.axis) else values[:, :, 0].T
    ours_seen, theirs_seen = errors(np.abs(found.spectrum[0]) / MICRO, 16), errors(frames, 16)
    print(
        f"\n{theirs / ours:.1f} times as fast as rota-order; rms errors {np.round(ours_seen, 3)} %, "
        f"rota {np.round(theirs_seen, 3)} %"
    )
    assert theirs / ours > 9
    assert ours_seen[0] < 1.05 * theirs_seen[0]


def test_everything_shown_live_is_made_in_two_milliseconds_at_sixty_thousand_revolutions_a_minute() -> None:
    codes = run_up(4.0, slowest=999.9, fastest=1000.0)
    size = int(RATE * AnalysisSettings().update_interval)
    firsts = range(0, codes.shape[1], size)
    blocks = [SampleBlock(np.ascontiguousarray(codes[:, first : first + size]), 0, first, 0) for first in firsts]
    medians = []
    for _ in range(5):  # the least disturbed pass counts
        analyser, used, frames = Analyser(acquisition(), AnalysisSettings()), [], 0
        for block in blocks:
            begin = time.process_time()
            frames += sum(snapshot.frame is not None for snapshot in analyser.add_block(block))
            used.append(time.process_time() - begin)
        medians.append(1e3 * float(np.median(used)))
        assert frames > 30
    median = min(medians)
    print(f"\nlive update of 0.1 s at 60,000 r/min: median {median:.2f} ms of processor time")
    assert median <= 2.0


def test_vold_kalman_of_three_orders_is_forty_times_as_fast_as_the_run_after_decimation() -> None:
    rate = 10_000.0
    seconds = np.arange(int(5 * rate)) / rate
    angle = 2 * np.pi * (100 * seconds + 40 * seconds**2)
    wave = 20 * np.cos(angle) + 5 * np.cos(2 * angle) + 8 * np.cos(0.47 * angle)
    used = []
    for _ in range(3):
        begin = time.process_time()
        found = order_envelopes(wave, angle, rate, (1.0, 2.0, 0.47), bandwidth_percent=3.0)
        used.append(time.process_time() - begin)
    ratio = 5.0 / min(used)
    print(f"\nVold-Kalman, 3 orders, 10 kS/s: {ratio:.0f} times real time")
    assert np.abs(np.abs(found.envelopes[0]) - 20)[5000:-5000].max() < 0.04
    assert ratio > 40
