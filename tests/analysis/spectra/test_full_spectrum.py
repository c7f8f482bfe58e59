"""Forward and backward circles, and probe mismatch."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord, angular_record, tacho_edges
from analysis.shaft.orbit import filtered_orbit
from analysis.signals.probes import ProbePair
from analysis.signals.units import MICROMETRE
from analysis.spectra.full_spectrum import full_cascade, full_spectrum, probe_mismatch
from analysis.spectra.order_map import order_map
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import shaft_angle

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

Maker = Callable[..., AngularRecord]
FORWARD = ((20 * MICROMETRE, 1.0, 0.4), (8 * MICROMETRE, 0.5, 0.0), (3 * MICROMETRE, 2.0, 1.0))


def seen(record: AngularRecord, gain: float = 0.0, skew: float = 0.0) -> AngularRecord:
    """Return a record with a probe y of wrong sensitivity and wrong direction."""
    waveform = record.waveform.copy()
    waveform[1] = (1.0 + gain) * waveform[1] + skew * waveform[0]
    return record.with_waveform(waveform)


def test_forward_and_backward_circles_do_not_leak_into_each_other(make_angular: Maker) -> None:
    frames = order_map(make_angular((20.0, 1.0, 0.4), (5.0, -2.0, 0.1), (8.0, 0.5, 0.0)))
    spectrum = full_spectrum(frames.orders, frames.spectrum, frames.pair)
    assert np.abs(spectrum.backward[:, 16]).max() / 20.0 < 1e-10
    assert np.abs(spectrum.forward[:, 32]).max() / 5.0 < 1e-10
    assert np.abs(spectrum.backward[:, 8]).max() / 8.0 < 1e-10
    np.testing.assert_allclose(np.abs(spectrum.forward[:, 16]), 20.0)
    np.testing.assert_allclose(np.abs(spectrum.backward[:, 32]), 5.0)


@pytest.mark.parametrize("angles", [(0.0, np.pi / 2), (np.pi / 4, 3 * np.pi / 4), (0.3, 1.4), (np.pi / 2, 0.0)])
def test_circles_do_not_depend_on_the_probe_angles(make_angular: Maker, angles: tuple[float, float]) -> None:
    plain = make_angular((20.0, 1.0, 0.4), (5.0, -2.0, 0.1))
    pair = ProbePair(*angles)
    turned = replace(plain, waveform=pair.to_probes(plain.waveform), pair=pair)
    frames = order_map(turned)
    spectrum = full_spectrum(frames.orders, frames.spectrum, pair)
    np.testing.assert_allclose(spectrum.forward[:, 16], 20.0 * np.exp(0.4j), atol=1e-9)
    np.testing.assert_allclose(np.abs(spectrum.backward[:, 32]), 5.0, atol=1e-9)


def test_axis_runs_from_backward_to_forward(make_angular: Maker) -> None:
    frames = order_map(make_angular((20.0, 1.0, 0.4), (5.0, -2.0, 0.1)))
    spectrum = full_spectrum(frames.orders, frames.spectrum, frames.pair)
    amplitudes = spectrum.amplitudes[0]
    strong = spectrum.axis[1:-1][
        (amplitudes[1:-1] > amplitudes[:-2]) & (amplitudes[1:-1] > amplitudes[2:]) & (amplitudes[1:-1] > 1)
    ]
    assert spectrum.axis.size == spectrum.amplitudes.shape[1]
    np.testing.assert_allclose(strong, [-2.0, 1.0])


@pytest.mark.parametrize(("gain", "skew"), [(0.01, 0.0), (-0.02, 0.0), (0.0, 0.01), (0.01, -0.005)])
def test_probe_mismatch_is_determined_and_not_shown_as_backward_whirl(
    make_angular: Maker, gain: float, skew: float
) -> None:
    frames = order_map(seen(make_angular(*FORWARD, revolutions=200, noise=0.1 * MICROMETRE), gain, skew))
    mismatch = probe_mismatch(frames)
    assert mismatch.is_determined
    assert mismatch.gain == pytest.approx(gain, abs=3 * mismatch.sigma)
    assert mismatch.skew == pytest.approx(skew, abs=3 * mismatch.sigma)
    assert mismatch.sigma < 0.001
    untold = full_spectrum(frames.orders, frames.spectrum, frames.pair)
    corrected = full_spectrum(frames.orders, frames.spectrum, frames.pair, mismatch)
    assert np.abs(untold.backward[:, 16].mean()) / (20 * MICROMETRE) > 0.004
    assert np.abs(corrected.backward[:, 16].mean()) / (20 * MICROMETRE) < 3e-4
    assert untold.uncertain[:, 16].all()
    assert corrected.uncertain[:, 16].all()


def test_mismatch_is_corrected_in_a_record(make_angular: Maker) -> None:
    true = make_angular(*FORWARD, revolutions=200, noise=0.05 * MICROMETRE)
    record = seen(true, 0.02, 0.01)
    mismatch = probe_mismatch(order_map(record))
    ellipse = filtered_orbit(mismatch.correct_record(record), (1.0,)).ellipses[0]
    assert abs(ellipse.backward) < 0.001 * 20 * MICROMETRE
    assert abs(filtered_orbit(record, (1.0,)).ellipses[0].backward) > 0.01 * 20 * MICROMETRE
    alone = make_angular((20 * MICROMETRE, 1.0, 0.0), noise=0.1 * MICROMETRE)
    assert probe_mismatch(order_map(alone)).correct_record(alone) is alone


def test_circles_sampled_through_card_and_tacho_do_not_leak_into_each_other(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench(noise=0.0, tacho={"response_time": 1e-5}, angles=(np.pi / 4, 3 * np.pi / 4))
    ramp = bench.ramp(100.0, 1000.0, 4.0)
    motion = bench.circles((20 * MICROMETRE, 1.0, 0.4), (5 * MICROMETRE, -2.0, 0.1))
    edges = tacho_edges(bench.acquisition, bench.codes(ramp, motion, 4.0))
    skews = (0.0, 1.0 / bench.acquisition.convert_rate)  # y is sampled later; here without the converter's steps
    seconds = np.arange(400_000) / 1e5 + np.array(skews)[:, None]
    pair = ProbePair(np.pi / 4, 3 * np.pi / 4)
    displacement = np.stack([pair.to_probes(np.stack(motion(ramp(seconds[row]))))[row] for row in (0, 1)])
    angle = shaft_angle(pulse_record(edges, bench.acquisition.tacho))
    frames = order_map(angular_record(displacement, 1e5, angle, pair, skews=skews))
    found = full_spectrum(frames.orders, frames.spectrum, pair)
    assert np.abs(found.backward[:, 16]).max() < 1e-4 * 20 * MICROMETRE
    assert np.abs(found.forward[:, 32]).max() < 1e-4 * 5 * MICROMETRE


def test_mirrored_probe_pair_has_the_same_gain_mismatch(make_angular: Maker) -> None:
    plain = make_angular(*FORWARD, revolutions=200, noise=0.1 * MICROMETRE)
    pair = ProbePair(np.pi / 2, 0.0)
    turned = replace(plain, waveform=pair.to_probes(plain.waveform), pair=pair)
    mismatch = probe_mismatch(order_map(seen(turned, 0.01, 0.005)))
    assert mismatch.gain == pytest.approx(0.01, abs=0.001)
    assert mismatch.skew == pytest.approx(0.005, abs=0.001)


def test_elliptic_motion_is_no_mismatch(make_angular: Maker) -> None:
    frames = order_map(make_angular(*FORWARD, (1 * MICROMETRE, -1.0, 0.0), revolutions=200, noise=0.1 * MICROMETRE))
    mismatch = probe_mismatch(frames)
    assert not mismatch.is_determined
    spectrum = full_spectrum(frames.orders, frames.spectrum, frames.pair, mismatch)
    np.testing.assert_allclose(np.abs(spectrum.backward[:, 16]), 1 * MICROMETRE, rtol=0.05)
    assert not spectrum.uncertain[:, 16].any()  # 5 % of the forward circle: more than probes may differ


def test_single_component_does_not_determine_the_mismatch(make_angular: Maker) -> None:
    frames = order_map(seen(make_angular((20 * MICROMETRE, 1.0, 0.0), noise=0.1 * MICROMETRE), 0.01))
    mismatch = probe_mismatch(frames)
    assert (mismatch.is_determined, mismatch.components) == (False, 1)
    assert full_spectrum(frames.orders, frames.spectrum, frames.pair, mismatch).uncertain[:, 16].all()


def test_full_cascade_contains_the_largest_circles_at_each_speed(make_angular: Maker) -> None:
    slow, fast = make_angular((5.0, 1.0, 0.0)), make_angular((9.0, 1.0, 0.0), (2.0, -1.0, 0.0))
    waveform = np.concatenate([slow.waveform, fast.waveform], axis=1)
    times = np.concatenate([slow.times, slow.times[-1] + fast.times[1:] / 3.0])  # 100, then 300 turns a second
    record = replace(slow, waveform=waveform, times=times, time_sigma=np.zeros(times.size))
    speeds, cascade = full_cascade(order_map(record, overlap=0.0), 2 * np.pi * 10.0)
    np.testing.assert_allclose(speeds, 2 * np.pi * np.array([100.0, 300.0]))
    np.testing.assert_allclose(np.abs(cascade.forward[:, 16]), [5.0, 9.0])
    np.testing.assert_allclose(np.abs(cascade.backward[:, 16]), [0.0, 2.0], atol=1e-9)
    with pytest.raises(ValueError, match="width"):
        full_cascade(order_map(record), 0.0)
