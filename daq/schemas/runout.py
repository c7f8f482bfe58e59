"""What was taken off as run-out, and where that is known from."""

from pydantic import Field

from analysis.signals.header import RunOutSettings
from analysis.signals.snapshot import RunOut
from daq.schemas.document import Document
from daq.schemas.units import rpm
from daq.schemas.vibration import ProbesDocument, probes_document


class RunOutDocument(Document):
    """What the probes see of the surface; what is called compensated is less by it, all else is as measured."""

    source: str = Field(description="Where it is known from", examples=["slow roll of this run", "rig.toml"])
    slow_roll_rpm: float | None = Field(
        description="Speed up to which the run tells it, r/min; null where it was known before", examples=[600.0]
    )
    is_known: bool = Field(description="Whether it is known: a slow roll must come first", examples=[True])
    from_orbit: bool = Field(description="Whether it is taken off the orbit too", examples=[False])
    order_1x: ProbesDocument | None = Field(description="The run-out at running speed; null until it is known")
    order_2x: ProbesDocument | None = Field(description="The run-out at twice running speed; null likewise")


def runout_document(settings: RunOutSettings, runout: RunOut | None) -> RunOutDocument | None:
    """Return what is taken off as a document; None where nothing is to be."""
    if not settings.is_asked:
        return None
    told_by_run = settings.slow_roll_speed > 0.0
    return RunOutDocument(
        source="slow roll of this run" if told_by_run else settings.source,
        slow_roll_rpm=rpm(settings.slow_roll_speed) if told_by_run else None,
        is_known=runout is not None,
        from_orbit=settings.from_orbit,
        order_1x=None if runout is None else probes_document(runout.vectors[0].tolist()),
        order_2x=None if runout is None else probes_document(runout.vectors[1].tolist()),
    )
