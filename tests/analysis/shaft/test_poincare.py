"""Poincaré sections and bifurcation diagrams."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.shaft.poincare import Pattern, bifurcation_diagram, poincare_section
from analysis.signals.errors import RecordTooShortError

Maker = Callable[..., AngularRecord]


@pytest.mark.parametrize("revolutions", [64, 128])
@pytest.mark.parametrize(
    ("order", "pattern", "period"),
    [
        (2.0, Pattern.POINT, 1),
        (0.5, Pattern.CLUSTERS, 2),
        (1 / 3, Pattern.CLUSTERS, 3),
        (1.5, Pattern.CLUSTERS, 2),
        (3 / 7, Pattern.CLUSTERS, 7),
        (1 / 8, Pattern.CLUSTERS, 8),
        (0.4631, Pattern.CURVE, 0),
        (0.49, Pattern.CURVE, 0),
        (0.499, Pattern.CURVE, 0),
        (0.17, Pattern.CURVE, 0),
        (0.43, Pattern.CURVE, 0),
        (0.333, Pattern.CURVE, 0),
    ],
)
def test_locked_components_are_clusters_and_whirl_is_a_curve(
    make_angular: Maker, order: float, pattern: Pattern, period: int, revolutions: int
) -> None:
    record = make_angular((20.0, 1.0, 0.4), (8.0, order, 0.3), (3.0, -order, 0.0), noise=0.1, revolutions=revolutions)
    section = poincare_section(record, noise=0.1)
    assert (section.pattern, section.period, section.revolutions_needed) == (pattern, period, 0)
    assert section.points.shape == (2, revolutions)
    if pattern is Pattern.CLUSTERS:
        assert section.scatter < 0.25
    if pattern is not Pattern.POINT:
        assert section.order == pytest.approx(order, abs=4.0 * section.order_sigma)
        assert section.order_sigma < 2e-5


def test_unresolved_whirl_is_unknown_with_the_revolutions_that_decide(make_angular: Maker) -> None:
    circles = ((20.0, 1.0, 0.4), (2.0, 0.5, 0.3))
    section = poincare_section(make_angular(*circles, noise=4.0, revolutions=48, points=16), noise=4.0)
    assert (section.pattern, section.period) == (Pattern.UNKNOWN, 0)
    assert 3.0 * section.order_sigma > 1e-3
    assert 48 < section.revolutions_needed < 400
    longer = make_angular(*circles, noise=4.0, revolutions=2 * section.revolutions_needed, points=16)
    assert poincare_section(longer, noise=4.0).pattern is Pattern.CLUSTERS


def test_chaos_is_a_cloud_and_few_revolutions_are_unknown(make_angular: Maker) -> None:
    assert poincare_section(make_angular(noise=5.0, revolutions=128), noise=0.1).pattern is Pattern.CLOUD
    assert poincare_section(make_angular((8.0, 0.5, 0.0), revolutions=40)).pattern is Pattern.UNKNOWN
    assert poincare_section(make_angular((8.0, 0.5, 0.0), revolutions=40)).revolutions_needed == 48
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
