"""Remarks on the vectors of an order."""

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.probes import ProbePair
from analysis.signals.units import MICROMETRE
from analysis.vectors.order_track import track_order
from daq.reports.kinds.vectors import neighbour_remarks


def record_beside(size: float) -> AngularRecord:
    """Return 1X of 20 µm beside a component at 0.95X, µm peak."""
    turns = np.arange(200 * 64) / 64
    z = 20.0 * np.exp(2j * np.pi * turns) + size * np.exp(1.9j * np.pi * turns)
    motion = np.stack([z.real, z.imag]).reshape(2, 200, 64)
    motion += 0.5 * np.random.default_rng(0).standard_normal(motion.shape)
    times = np.arange(201) / 100.0
    return AngularRecord(motion * MICROMETRE, 0, times, ProbePair(0.0, np.pi / 2), 0.0, np.zeros(201))


def test_unresolved_neighbour_is_named_with_the_revolutions_that_resolve_it() -> None:
    (remark,) = neighbour_remarks(track_order(record_beside(3.0), 1.0))
    assert "0.950X" in remark
    assert "40 revolutions resolve it" in remark
    assert neighbour_remarks(track_order(record_beside(0.0), 1.0)) == []
