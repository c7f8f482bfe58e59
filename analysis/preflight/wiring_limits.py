"""From where on a check of the wiring warns or fails, where that is a matter of the rig and not of physics."""

from dataclasses import dataclass

MICRO = 1e-6


@dataclass(frozen=True, slots=True)
class WiringLimits:
    """What is still good at a rig.

    Parameters
    ----------
    hum_warn, hum_fail : float
        Mains hum of a probe, m peak: above the first it is said, above the second it stands against a run.
    tacho_scatter : float
        Scatter of the tacho's periods about their slow course, relative.
    mark_tolerance : float
        How far the mark may be from its stated part of the turn: response and sensitivity shift light against dark.

    Raises
    ------
    ValueError
        A limit is negative, or hum fails before it warns.
    """

    hum_warn: float = 1.0 * MICRO
    hum_fail: float = 5.0 * MICRO
    tacho_scatter: float = 0.05
    mark_tolerance: float = 0.15

    def __post_init__(self) -> None:
        if not 0.0 <= self.hum_warn <= self.hum_fail:
            raise ValueError(
                f"hum_warn, hum_fail: {self.hum_warn}, {self.hum_fail} m, expected 0 <= hum_warn <= hum_fail"
            )
        if not (self.tacho_scatter > 0.0 and 0.0 < self.mark_tolerance < 1.0):
            raise ValueError(
                f"tacho_scatter, mark_tolerance: {self.tacho_scatter}, {self.mark_tolerance}, expected more than 0, "
                "the second less than 1"
            )
