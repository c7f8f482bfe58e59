"""Shafts and signals as they should not be: a result, or one clear refusal, never a warning."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.angular_record import AngularRecord, angular_record
from analysis.centreline import centreline
from analysis.errors import TachoRefusedError
from analysis.filtered_orbit import filtered_orbit
from analysis.full_spectrum import full_cascade, probe_mismatch
from analysis.glitches import find_glitches
from analysis.orbit import ProbePair
from analysis.order_map import order_map
from analysis.order_track import track_order
from analysis.poincare import bifurcation, poincare_section
from analysis.pulse_record import pulse_record
from analysis.run import Tacho
from analysis.runout import slow_roll
from analysis.shaft_angle import ShaftAngle, shaft_angle
from analysis.speed_curve import speed_curves
from analysis.subsynchronous import subsynchronous_tracks
from analysis.synchronous_average import synchronous_rest

FloatArray = NDArray[np.float64]
Speed = Callable[[FloatArray], FloatArray]

RATE, SAMPLES = 20_000.0, 60_000
TIME = np.arange(SAMPLES) / RATE
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)
SHAFTS: dict[str, Speed] = {
    "stops": lambda time: np.maximum(100.0 * (1.0 - 0.5 * time), 1e-9),
    "nearly stops": lambda time: np.maximum(100.0 * (1.0 - time / 3.0), 2.0),
    "turns back": lambda time: 160.0 - 40.0 * np.abs(time - 1.5),
    "wobbles": lambda time: 100.0 * (1.0 + 0.1 * np.sin(6.0 * np.pi * time)),
}
SIGNALS: dict[str, FloatArray] = {
    "wave": 1e-5 * np.stack([np.cos(200 * np.pi * TIME), np.sin(200 * np.pi * TIME)]),
    "zero": np.zeros((2, SAMPLES)),
    "constant": np.full((2, SAMPLES), 1e-4),
    "one dead": 1e-5 * np.stack([np.cos(200 * np.pi * TIME), np.zeros(SAMPLES)]),
    "noise": 1e-6 * np.random.default_rng(0).standard_normal((2, SAMPLES)),
}


def angle_of(speed: Speed) -> ShaftAngle:
    grid = np.linspace(0.0, 3.0, 300_001)
    rates = speed(grid)
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(grid))])
    pulses = np.interp(np.arange(0.0, np.floor(turns[-1] - 1e-6) + 1.0), turns, grid)
    return shaft_angle(pulse_record(pulses, TACHO))


def everything(record: AngularRecord, displacement: FloatArray, angle: ShaftAngle) -> list[FloatArray]:
    """Return amplitudes and uncertainties of all that can be asked of a record."""
    frames = order_map(record)
    track = track_order(record, 1.0)
    curves = speed_curves(track, 20.0)
    for curve in curves:
        curve.resonances(0)
    subsynchronous_tracks(frames)
    poincare_section(record)
    return [
        frames.amplitudes(),
        frames.noise,
        np.abs(track.vectors),
        track.sigma,
        track.phase_sigma,
        *(curve.sigma for curve in curves),
        full_cascade(frames, 50.0, probe_mismatch(frames))[1].amplitudes,
        bifurcation(record, averaged=8)[1],
        slow_roll(record, 0.0, 1e4).waveform,
        synchronous_rest(record).waveform,
        filtered_orbit(record, (1.0,)).motion,
        centreline(record, np.zeros(2), 1e-4).positions,
        find_glitches(displacement, RATE, angle).displacement,
    ]


@pytest.mark.parametrize("shaft", SHAFTS)
@pytest.mark.parametrize("signal", SIGNALS)
def test_unusual_shafts_and_signals_give_finite_results_and_no_warning(shaft: str, signal: str) -> None:
    angle = angle_of(SHAFTS[shaft])
    record = angular_record(SIGNALS[signal], RATE, angle, ProbePair(0.0, np.pi / 2))
    assert all(np.isfinite(result).all() for result in everything(record, SIGNALS[signal], angle))


@pytest.mark.parametrize("jump", [0.85, 1.18, 1.6])
def test_a_speed_that_jumps_is_refused(jump: float) -> None:
    with pytest.raises(TachoRefusedError, match="analyse the record in parts"):
        angle_of(lambda time: np.where(time < 1.5, 100.0, 100.0 * jump))
