"""Missing or doubled edges: counter and waveform give the same speed, vectors and tacho report."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.header import Acquisition, Role
from analysis.signals.snapshot import CounterState, TachoState
from tests.daq.support.counted_bench import RISING, RigFactory, analysed, counted, header_of, items_of, ticks_of

EVERY = 20  # every 20th edge is disturbed
RUN_UP = {**RISING, "speed_fluctuation": 0.0, "tacho_jitter_us": 2.0, "tacho_noise_v": 0.0}
Codes = NDArray[np.int16]
Ticks = NDArray[np.int64]
Disturbance = Callable[[Codes, Ticks, Acquisition], Ticks]


def without(codes: Codes, ticks: Ticks, acquisition: Acquisition) -> Ticks:
    """Remove every `EVERY`-th edge from the waveform, and return the stamps without it."""
    row, chosen = acquisition.row(Role.TACHO), slice(EVERY, ticks.size - 1, EVERY)
    edges = ticks / acquisition.ticks_per_sample
    for edge, following in zip(edges[:-1][chosen], edges[1:][chosen], strict=False):
        codes[row, int(edge) - 3 : int(following - 0.25 * (following - edge))] = codes[row].min()
    return np.delete(ticks, chosen)


def doubled(codes: Codes, ticks: Ticks, acquisition: Acquisition) -> Ticks:
    """Interrupt the light briefly after every `EVERY`-th edge, and return the stamps with the additional edge."""
    row, more = acquisition.row(Role.TACHO), []
    channel, lag = acquisition.channels[row], row / acquisition.convert_rate * acquisition.rate
    edges = ticks / acquisition.ticks_per_sample
    for edge, following in zip(edges[EVERY:-1:EVERY], edges[EVERY + 1 :: EVERY], strict=False):
        back = int(edge + 0.2 * (following - edge))
        codes[row, back - 4 : back] = codes[row].min()
        dark, light = channel.volts(codes[row, back - 1 : back + 1])
        crossing = back - 1 + (acquisition.tacho.threshold - dark) / (light - dark) + lag
        more.append(round(crossing * acquisition.ticks_per_sample))
    return np.sort(np.concatenate([ticks, more])).astype(np.int64)


def doubled_at_the_counter_alone(codes: Codes, ticks: Ticks, acquisition: Acquisition) -> Ticks:
    """Return the stamps with additional edges that the waveform lacks."""
    return doubled(codes.copy(), ticks, acquisition)


def disturbed(items: list[SourceItem], acquisition: Acquisition, disturbance: Disturbance) -> list[SourceItem]:
    """Return a run's items with disturbed waveform and stamps, in the same blocks."""
    codes = np.concatenate([item.codes for item in items if isinstance(item, SampleBlock)], axis=1)
    ticks = disturbance(codes, ticks_of(items), acquisition)
    changed: list[SourceItem] = []
    for item in items:
        if isinstance(item, SampleBlock):
            low, high = item.first_sample * acquisition.ticks_per_sample, item.end * acquisition.ticks_per_sample
            own = np.ascontiguousarray(codes[:, item.first_sample : item.end])
            changed.append(replace(item, codes=own, ticks=ticks[(ticks >= low) & (ticks < high)]))
        else:
            changed.append(item)
    return changed


@pytest.mark.parametrize(("disturbance", "filled", "rejected"), [(without, 19, 0), (doubled, 0, 19)])
def test_counter_and_samples_agree_despite_missing_and_doubled_edges(
    rig: RigFactory, tmp_path: Path, disturbance: Disturbance, filled: int, rejected: int
) -> None:
    found = []
    for reference in ("counter", "samples"):
        chosen = counted(rig, reference, simulation=RUN_UP)
        header = header_of(chosen, tmp_path)
        found.append(analysed(header, disturbed(items_of(chosen), header.acquisition, disturbance)))
    for by_counter, by_samples in zip(*found, strict=True):
        assert by_counter.tacho.state is by_samples.tacho.state is TachoState.GOOD
        assert by_counter.speed == pytest.approx(by_samples.speed, rel=5e-4)
        assert (by_counter.frame is None) is (by_samples.frame is None)
        if by_counter.frame is not None and by_samples.frame is not None:
            np.testing.assert_allclose(by_counter.frame.vectors[0], by_samples.frame.vectors[0], rtol=1e-2)
    for snapshots in found:
        last = snapshots[-1]
        assert (last.tacho.pulses, last.tacho.filled, last.tacho.rejected) == (400 - filled, filled, rejected)
        assert last.counter is not None
        assert (last.counter.state, last.counter.recent_mismatches) == (CounterState.AGREES, 0)


def test_doubled_edges_of_the_counter_alone_are_rejected_and_reported(rig: RigFactory, tmp_path: Path) -> None:
    chosen = counted(rig, simulation=RUN_UP)
    header, items = header_of(chosen, tmp_path), items_of(chosen)
    last = analysed(header, disturbed(items, header.acquisition, doubled_at_the_counter_alone))[-1]
    clean = analysed(header, items)[-1]
    assert last.counter is not None
    assert (last.tacho.rejected, last.counter.extra, last.counter.missing) == (19, 16, 0)  # the last are compared later
    assert last.counter.recent_message.startswith("16 of ")
    assert last.speed == pytest.approx(clean.speed, rel=1e-9)
