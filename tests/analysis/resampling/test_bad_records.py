"""Bad signals and unusual shafts through every function: a finite result or one clear error, never a warning."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import (
    AngularRecord,
    angular_record,
    angular_record_from_codes,
    synchronous_average,
    synchronous_residual,
)
from analysis.shaft.orbit import centreline, direct_orbit, filtered_orbit, orbit_without
from analysis.shaft.poincare import bifurcation_diagram, poincare_section
from analysis.signals.errors import AmbiguousTachoError, AnalysisError
from analysis.signals.header import Tacho
from analysis.signals.probes import ProbePair
from analysis.spectra.disturbances import drift, mains_hum
from analysis.spectra.frequency_spectrum import frequency_map, frequency_spectrum
from analysis.spectra.full_spectrum import full_cascade, probe_mismatch
from analysis.spectra.order_map import OrderMap, order_map, order_spectrum
from analysis.spectra.tacholess_speed import angular_record_without_tacho, speed_from_ridge
from analysis.spectra.windows import FLAT_TOP
from analysis.tacho.edges import edge_detector
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.pulse_train import PulseTrain
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle
from analysis.vectors.glitches import find_glitches
from analysis.vectors.order_track import OrderTrack, track_order
from analysis.vectors.runout import SlowRoll, slow_roll
from analysis.vectors.speed_curve import speed_curves
from analysis.vectors.vold_kalman import order_envelopes
from analysis.whirl.tracks import subsynchronous_tracks

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

FloatArray = NDArray[np.float64]
Codes = NDArray[np.int16]
Speed = Callable[[FloatArray], FloatArray]
Results = list[FloatArray] | list[float]

RATE, SAMPLES = 4_000.0, 12_000
TIME = np.arange(SAMPLES) / RATE
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)
PAIR = ProbePair(0.0, np.pi / 2)
STEADY = "steady"
SHAFTS: dict[str, Speed] = {
    STEADY: lambda time: np.full_like(time, 100.0),
    "stops": lambda time: np.maximum(100.0 * (1.0 - 0.5 * time), 1e-9),
    "nearly stops": lambda time: np.maximum(100.0 * (1.0 - time / 3.0), 2.0),
    "turns back": lambda time: 160.0 - 40.0 * np.abs(time - 1.5),
    "wobbles": lambda time: 100.0 * (1.0 + 0.1 * np.sin(6.0 * np.pi * time)),
}
WAVE = 1e-5 * np.stack([np.cos(200 * np.pi * TIME), np.sin(200 * np.pi * TIME)])


def spoiled(value: float) -> FloatArray:
    wave = WAVE.copy()
    wave[0, 5000] = value
    return wave


SIGNALS: dict[str, FloatArray] = {
    "wave": WAVE,
    "zero": np.zeros((2, SAMPLES)),
    "constant": np.full((2, SAMPLES), 1e-4),
    "one dead": WAVE * np.array([[1.0], [0.0]]),
    "noise": 1e-6 * np.random.default_rng(0).standard_normal((2, SAMPLES)),
    "clipped": np.clip(WAVE, -4e-6, 4e-6),
    "step": WAVE + 1e-4 * (TIME > 1.5),
    "spike": spoiled(1.0),
    "tiny": 1e-300 * WAVE,
    "one NaN": spoiled(np.nan),
    "all NaN": np.nan * WAVE,
    "infinite": spoiled(-np.inf),
    "half a turn": WAVE[:, :20],
    "two turns": WAVE[:, :100],
    "one sample": WAVE[:, :1],
    "empty": WAVE[:, :0],
    "three channels": np.zeros((3, SAMPLES)),
}


@cache
def angle_of(shaft: str) -> ShaftAngle:
    grid = np.linspace(0.0, 3.0, 300_001)
    rates = SHAFTS[shaft](grid)
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(grid))])
    pulses = np.interp(np.arange(0.0, np.floor(turns[-1] - 1e-6) + 1.0), turns, grid)
    return shaft_angle(pulse_record(pulses, TACHO))


@cache
def record_of(shaft: str, signal: str) -> AngularRecord:
    return angular_record(SIGNALS[signal], RATE, angle_of(shaft), PAIR)


def lines(frames: OrderMap) -> Results:
    return [frames.amplitudes(), frames.noise, frames.speeds, frames.speed_sigma, frames.accelerations]


def vectors(track: OrderTrack) -> Results:
    return [np.abs(track.vectors), track.sigma, track.phase_sigma, track.speeds]


def curves(record: AngularRecord) -> Results:
    found = speed_curves(track_order(record, 1.0), 20.0)
    peaks = [[peak.amplitude for peak in curve.resonances(0)] for curve in found]
    return [np.concatenate([curve.sigma[0], curve.lags[1], peak]) for curve, peak in zip(found, peaks, strict=True)]


def runout(roll: SlowRoll) -> Results:
    return [np.append(roll.waveform, roll.drift), roll.vector_sigma]


def ridge(displacement: FloatArray) -> Results:
    found = speed_from_ridge(displacement, RATE, 400.0, 900.0)
    return [found.speeds, found.sigma, found.confidence]


def envelopes(displacement: FloatArray) -> Results:
    angle = np.asarray(200 * np.pi * np.arange(displacement.shape[1]) / RATE, dtype=np.float64)
    found = order_envelopes(displacement[0], angle, RATE, (1.0, 2.0), bandwidth=20.0)
    return [np.abs(found.envelopes), found.sigma, found.residual]


OF_RECORDS: dict[str, Callable[[AngularRecord], Results]] = {
    "order map": lambda record: lines(order_map(record)),
    "order map, flat top": lambda record: lines(order_map(record, window=FLAT_TOP)),
    "order map of single turns": lambda record: lines(order_map(record, revolutions=1)),
    "order track": lambda record: vectors(track_order(record, 1.0)),
    "order track less a vector": lambda record: vectors(
        track_order(record, 2.0).subtract(np.ones(2, dtype=np.complex128), np.ones(2))
    ),
    "components below 1X": lambda record: [track.orders for track in subsynchronous_tracks(order_map(record))],
    "full cascade": lambda record: [
        full_cascade(order_map(record), 50.0, probe_mismatch(order_map(record)))[1].amplitudes
    ],
    "average": lambda record: [synchronous_average(record).waveform, synchronous_average(record).sigma],
    "rest": lambda record: [synchronous_residual(record).waveform],
    "direct orbit": lambda record: [direct_orbit(record).motion],
    "1X orbit": lambda record: [filtered_orbit(record, (1.0,)).motion],
    "1X tilt": lambda record: [filtered_orbit(record, (1.0,)).ellipses[0].tilt],
    "not-1X orbit": lambda record: [orbit_without(record).motion],
    "centreline": lambda record: [centreline(record, np.zeros(2), 1e-4).eccentricity_ratio],
    "slow roll": lambda record: runout(slow_roll(record, 0.0, 1e4)),
    "Poincaré section": lambda record: [poincare_section(record).points],
    "bifurcation": lambda record: [bifurcation_diagram(record, averaging_revolutions=8)[1]],
    "speed curves": curves,
    "hum beside the shaft": lambda record: [mains_hum(TIME * 0.0, RATE, record).amplitude],
}
OF_SAMPLES: dict[str, Callable[[FloatArray], Results]] = {
    "angular record": lambda wave: [angular_record(wave, RATE, angle_of(STEADY), PAIR).waveform],
    "glitches": lambda wave: [find_glitches(wave, RATE, angle_of(STEADY)).displacement],
    "frequency spectrum": lambda wave: [frequency_spectrum(wave, RATE, resolution=5.0).amplitudes],
    "frequency map": lambda wave: [frequency_map(wave, RATE, angle_of(STEADY), resolution=5.0).amplitudes],
    "order spectrum": lambda wave: [np.abs(order_spectrum(wave, 16)[1])],
    "drift": lambda wave: [drift(wave[0], RATE).slope, drift(wave[0], RATE).sigma],
    "hum": lambda wave: [mains_hum(wave[0], RATE).amplitude, mains_hum(wave[0], RATE).sigma],
    "ridge": ridge,
    "Vold-Kalman": envelopes,
    "edges": lambda wave: [edge_detector(TACHO).edges(3e5 * wave[0], 0)],
}


def assert_finite_or_refused(tool: Callable[[], Results]) -> None:
    try:
        results = tool()
    except (AnalysisError, ValueError) as error:
        assert type(error) is ValueError or isinstance(error, AnalysisError)  # noqa: PT017  # either outcome is right
        assert any(word in str(error) for word in ("expected", "hold"))  # noqa: PT017  # what is wrong, or is missing
        return
    assert all(np.isfinite(result).all() for result in results)


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("tool", OF_SAMPLES)
def test_samples_give_a_finite_result_or_one_clear_error(tool: str, signal: str) -> None:
    assert_finite_or_refused(lambda: OF_SAMPLES[tool](SIGNALS[signal]))


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("tool", OF_RECORDS)
def test_records_give_a_finite_result_or_one_clear_error(tool: str, signal: str) -> None:
    assert_finite_or_refused(lambda: OF_RECORDS[tool](record_of(STEADY, signal)))


@pytest.mark.parametrize("shaft", SHAFTS)
@pytest.mark.parametrize("tool", OF_RECORDS)
def test_unusual_shafts_give_finite_results(tool: str, shaft: str) -> None:
    assert all(np.isfinite(result).all() for result in OF_RECORDS[tool](record_of(shaft, "wave")))


@pytest.mark.parametrize("signal", ["one NaN", "all NaN", "infinite"])
@pytest.mark.parametrize("tool", OF_SAMPLES)
def test_samples_that_are_not_finite_are_refused(tool: str, signal: str) -> None:
    with pytest.raises(ValueError, match="finite"):
        OF_SAMPLES[tool](SIGNALS[signal])


WRONG: dict[str, tuple[str, Callable[[AngularRecord], object]]] = {
    "no revolution in a map": ("revolutions", lambda record: order_map(record, revolutions=0)),
    "frames that never go on": ("overlap", lambda record: order_map(record, overlap=1.0)),
    "a map beyond the record": ("highest order", lambda record: order_map(record, highest_order=99.0)),
    "a map that ends below 1X": ("1X", lambda record: subsynchronous_tracks(order_map(record, highest_order=0.9))),
    "order 0": ("order", lambda record: track_order(record, 0.0)),
    "an order beyond the record": ("order", lambda record: track_order(record, 99.0)),
    "too short a window": ("revolutions", lambda record: track_order(record, 1.0, revolutions=2)),
    "an orbit of no order": ("orders", lambda record: filtered_orbit(record, ())),
    "an orbit of no turn": ("revolutions", lambda record: filtered_orbit(record, (1.0,), revolutions=0)),
    "a direct orbit of no turn": ("revolutions", lambda record: direct_orbit(record, 0)),
    "the rest of one turn": ("revolutions", lambda record: synchronous_residual(record, 1)),
    "a clearance of nothing": ("clearance", lambda record: centreline(record, np.zeros(2), 0.0)),
    "a noise below nothing": ("noise", lambda record: poincare_section(record, -1.0)),
    "a noise that is no number": ("noise", lambda record: poincare_section(record, np.nan)),
    "a bin of no width": ("width", lambda record: full_cascade(order_map(record), 0.0)),
    "a curve of no width": ("width", lambda record: speed_curves(track_order(record, 1.0), np.nan)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_invalid_settings_are_refused_by_name(wrong: str) -> None:
    name, call = WRONG[wrong]
    with pytest.raises(ValueError, match=name):
        call(record_of(STEADY, "wave"))


@pytest.mark.parametrize("jump", [0.85, 1.18, 1.6])
def test_jump_of_speed_is_refused(jump: float) -> None:
    SHAFTS[f"jumps to {jump}"] = lambda time: np.where(time < 1.5, 100.0, 100.0 * jump)
    with pytest.raises(AmbiguousTachoError, match="analyse the record in parts"):
        angle_of(f"jumps to {jump}")


def random_pulses(random: np.random.Generator) -> FloatArray:
    """Return random edges: noise, jitter, fluctuating, halved, interrupted or stopping speeds, bursts."""
    n = int(random.integers(1, 400))
    times = [
        np.cumsum(random.exponential(0.01, n)),
        np.arange(n) * 0.01 + random.normal(0.0, random.choice([1e-6, 1e-4, 2e-3]), n),
        np.cumsum(0.01 * np.exp(np.cumsum(random.normal(0.0, random.choice([0.001, 0.05]), n)))),
        np.cumsum(np.where(random.random(n) < 0.5, 0.01, 0.02)),
        np.concatenate([np.arange(n) * 0.01, 5.0 + np.arange(n, n + int(random.integers(1, 50))) * 0.013]),
        np.cumsum(np.linspace(0.01, random.choice([0.001, 0.1, 1.0]), n)),
        np.cumsum(random.choice([1e-9, 1e-3, 0.01, 0.1], n)),
    ][int(random.integers(0, 7))]
    return np.unique(times[random.random(times.size) > random.choice([0.0, 0.01, 0.1])])


def test_any_pulses_give_a_rising_angle_or_one_error() -> None:
    random = np.random.default_rng(0)
    refused = 0
    for _ in range(400):
        tacho = replace(TACHO, pulses_per_revolution=int(random.choice([1, 2, 5])))
        try:
            angle = shaft_angle(pulse_record(random_pulses(random), tacho))
        except AnalysisError:
            refused += 1
            continue
        turns = np.arange(np.ceil(angle.first), np.floor(angle.last) + 1.0)
        assert (np.diff(angle.time(turns)) > 0.0).all()
        assert np.isfinite(angle.time_sigma(turns)).all()
    assert 50 < refused < 350


def test_any_pulses_give_a_finite_live_speed_or_none() -> None:
    random = np.random.default_rng(1)
    finite = 0
    for _ in range(120):
        train = PulseTrain(replace(TACHO, pulses_per_revolution=int(random.choice([1, 2, 3, 12]))), 30)
        pulses = np.repeat(random_pulses(random), random.choice([1, 1, 1, 2]))  # a counter may stamp one tick twice
        for hop in range(int(pulses[-1] / 0.1) + 30 if pulses.size else 30):
            begin, end = np.searchsorted(pulses, [0.1 * hop, 0.1 * (hop + 1)])
            train.advance(pulses[begin:end], 0.1 * (hop + 1), 0.1, 1e5)
            speed, (turns, times) = train.speed(0.1), train.marks
            assert np.isnan(speed) or 0.0 < speed < np.inf
            assert (np.diff(turns) > 0).all()
            assert (np.diff(times) > 0.0).all()
            finite += np.isfinite(speed)
    assert finite > 80


def spoilt(row: Codes, random: np.random.Generator) -> Codes:
    """Return a channel as noise, stuck, clipped, stuck from a random sample on, or unchanged."""
    kind, stuck = int(random.integers(0, 8)), int(random.integers(0, row.size))
    if kind == 0:
        return random.integers(-32768, 32768, row.size).astype(np.int16)
    if kind == 1:
        return np.full(row.size, random.choice([-32768, 32767, 0]), dtype=np.int16)
    if kind == 2:
        return np.clip(row, -2_000, 14_000)
    return np.where(np.arange(row.size) < stuck, row, row[stuck]) if kind == 3 else row


def test_any_codes_give_finite_results_or_one_error(make_bench: Callable[..., "Bench"]) -> None:
    bench = replace(make_bench(rate=5_000.0, tacho={"response_time": 1e-5}), tacho_rise=2e-4)
    good = bench.codes(bench.steady(50.0), bench.circles((2e-5, 1.0, 0.0), (8e-6, 0.47, 1.0)), 1.5)
    random = np.random.default_rng(0)
    finite = 0
    for _ in range(60):
        codes = np.stack([spoilt(row, random) for row in good[:, : int(random.integers(1, good.shape[1]))]])
        for by_tacho in (True, False):
            try:
                record = (
                    angular_record_from_codes(bench.acquisition, codes)
                    if by_tacho
                    else angular_record_without_tacho(bench.acquisition, codes, 200.0, 600.0)[0]
                )
                frames = order_map(record)
            except AnalysisError:
                continue
            assert np.isfinite(frames.amplitudes()).all()
            assert np.isfinite(track_order(record, 1.0).sigma).all()
            finite += 1
    assert finite > 10


def test_records_of_different_shapes_are_refused() -> None:
    good = record_of(STEADY, "wave")
    with pytest.raises(ValueError, match="finite"):
        good.with_waveform(np.nan * good.waveform)
    with pytest.raises(ValueError, match="expected"):
        AngularRecord(good.waveform, 0, good.times[1:], PAIR, 0.0, good.time_sigma)
    with pytest.raises(ValueError, match="rise"):
        AngularRecord(good.waveform, 0, good.times[::-1], PAIR, 0.0, good.time_sigma)
