"""Poincaré sections and bifurcation diagrams."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.shaft.poincare import Pattern, bifurcation_diagram, poincare_section
from analysis.signals.errors import RecordTooShortError

Maker = Callable[..., AngularRecord]


@pytest.mark.parametrize(
    ("order", "pattern", "period"),
    [(2.0, Pattern.POINT, 1), (0.5, Pattern.CLUSTERS, 2), (1 / 3, Pattern.CLUSTERS, 3), (0.4631, Pattern.CURVE, 0)],
)
def test_subharmonics_are_clusters_and_whirl_is_a_curve(
    make_angular: Maker, order: float, pattern: Pattern, period: int
) -> None:
    record = make_angular((20.0, 1.0, 0.4), (8.0, order, 0.3), (3.0, -order, 0.0), noise=0.1, revolutions=128)
    section = poincare_section(record, noise=0.1)
    assert (section.pattern, section.period) == (pattern, period)
    assert section.points.shape == (2, 128)
    if pattern is not Pattern.CURVE:
        assert section.scatter < 0.25


def test_chaos_is_a_cloud_and_few_revolutions_are_unknown(make_angular: Maker) -> None:
    assert poincare_section(make_angular(noise=5.0, revolutions=128), noise=0.1).pattern is Pattern.CLOUD
    assert poincare_section(make_angular((8.0, 0.5, 0.0), revolutions=40)).pattern is Pattern.UNKNOWN
    assert poincare_section(make_angular((8.0, 1.0, 0.0), revolutions=128)).pattern is Pattern.POINT


def test_bifurcation_diagram_is_free_of_the_centreline_motion(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.0), (8.0, 0.5, 0.0), revolutions=400)
    wandering = record.with_waveform(record.waveform + 0.5 * np.arange(400)[None, :, None])
    speeds, positions = bifurcation_diagram(wandering)
    assert speeds.shape == (400,)
    inner = positions[0, 64:-64]
    np.testing.assert_allclose(np.sort(np.unique(np.round(inner))), [12.0, 28.0])
    with pytest.raises(RecordTooShortError):
        bifurcation_diagram(make_angular(revolutions=20))
    with pytest.raises(ValueError, match="averaged"):
        bifurcation_diagram(record, averaging_revolutions=1)
