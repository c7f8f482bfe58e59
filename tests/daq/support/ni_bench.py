"""A rig whose card is at a device server, and helpers that read its source."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Calibration, Role
from daq.config.rig import Rig
from daq.config.schema import (
    Backend,
    ChannelSection,
    CounterSection,
    DeviceSection,
    ProfilePoint,
    RigConfig,
    SimulationSection,
    TachoSection,
    TimingSection,
)
from daq.drivers.ni import NiSource, open_ni_source
from daq.errors import DeviceError

RATE = 30_000.0  # coerced to 29,985 by the card's 20 MHz
CALIBRATION = Calibration((0.0, 1e-4), 0.0, 10.0)


def bench(
    target: str = "",
    *,
    rate: float = RATE,
    tacho_input: str = "ai2",
    counter: CounterSection | None = None,
    profile: tuple[tuple[float, float], ...] = ((0, 3000), (8, 6000)),
    **device: Any,
) -> Rig:
    config = RigConfig(
        device=DeviceSection.model_validate({"backend": Backend.NIDAQMX, "target": target, "deadline_s": 1.2} | device),
        timing=TimingSection(rate_hz=rate, block_s=0.05, buffer_s=4),
        channel=(
            ChannelSection(name="x", role=Role.PROBE_X, physical="ai0", range_v=10.0),
            ChannelSection(name="y", role=Role.PROBE_Y, physical="ai1", range_v=10.0, angle_deg=90),
            ChannelSection(name="tacho", role=Role.TACHO, physical=tacho_input, range_v=5.0, terminal="rse"),
        ),
        tacho=TachoSection(counter=counter),
        simulation=SimulationSection(profile=tuple(ProfilePoint(time_s=time, speed_rpm=rpm) for time, rpm in profile)),
    )
    return Rig(Path("rig.toml"), config, {"x": CALIBRATION, "y": CALIBRATION})


def take(source: NiSource, blocks: int) -> list[SourceItem]:
    """Return the items of a source that is stopped after a number of blocks."""
    items: list[SourceItem] = []
    for item in source.blocks():
        items.append(item)
        if sum(isinstance(item, SampleBlock) for item in items) == blocks:
            source.stop()
    return items


def codes_of(items: list[SourceItem]) -> NDArray[np.int16]:
    return np.concatenate([item.codes for item in items if isinstance(item, SampleBlock)], axis=1)


def ends_of(items: list[SourceItem]) -> list[SegmentEnd]:
    return [item for item in items if isinstance(item, SegmentEnd)]


def refused(rig: Rig) -> DeviceError:
    with pytest.raises(DeviceError) as caught:
        open_ni_source(rig)
    return caught.value
