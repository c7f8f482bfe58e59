"""Backlog statistics of a run."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.live.delivery import DeliveryMonitor, DeliveryStatistics
from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, RunHeader

START = 1_795_000_000_000_000_000


def statistics(acquisition: Acquisition, *backlogs: tuple[int, int]) -> DeliveryStatistics:
    """Return the statistics of one block for each pair of segment and backlog."""
    monitor = DeliveryMonitor(acquisition)
    for segment, backlog in backlogs:
        monitor.add_block(SampleBlock(np.zeros((3, 100), np.int16), segment, 0, START, backlog))
    return monitor.statistics()


def test_statistics_contain_the_largest_backlog_of_all_segments(header: RunHeader) -> None:
    card = replace(header.acquisition, buffer=round(4 * header.acquisition.rate))
    found = statistics(card, (0, 10), (0, 700), (1, 300))
    assert found.backlog == pytest.approx(700 / card.rate)
    assert found.buffer == pytest.approx(4.0)


def test_backlog_of_a_device_without_a_buffer_is_unknown(header: RunHeader) -> None:
    assert statistics(replace(header.acquisition, buffer=0), (0, 700)) == DeliveryStatistics()
