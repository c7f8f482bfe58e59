"""Whether the service answers, and what it stands on."""

from enum import StrEnum

from pydantic import Field

from daq.schemas.units import Schema
from daq.session.live_update import LiveUpdate, RunState


class Health(StrEnum):
    """How the service is."""

    GOOD = "good"
    TROUBLE = "trouble"  # it answers, but the data folder cannot be read or the run has failed


class HealthSchema(Schema):
    """The service's own state."""

    health: Health = Field(description="good, or trouble with the reason in `detail`", examples=["good"])
    detail: str = Field(description="What is wrong; empty where nothing is", examples=[""])
    version: str = Field(description="Version of the service", examples=["0.1.0"])
    uptime_s: float = Field(description="Time since the service was made, s", examples=[162.4])
    runs: int | None = Field(description="Runs in the data folder; null where it cannot be read", examples=[12], ge=0)
    live_run: str | None = Field(
        description="Id of the run that is under way; null where none is", examples=["2026-11-24T09-12-07-gj90c"]
    )


def health_schema(
    version: str, uptime: float, runs: int | None, frame: LiveUpdate | None, trouble: str = ""
) -> HealthSchema:
    """Return the state of a service.

    Parameters
    ----------
    version : str
        Of the service.
    uptime : float
        Since it was made, s.
    runs : int or None
        Runs in the data folder, None where it cannot be read.
    frame : LiveUpdate or None
        The latest of the live run.
    trouble : str
        What is wrong with the data folder; empty where nothing is.

    Returns
    -------
    HealthSchema
        Trouble where the folder cannot be read or the live run has failed.
    """
    failed = frame is not None and frame.status.state is RunState.FAILED
    reasons = [trouble] if trouble else []
    if frame is not None and failed:
        reasons.append(f"run {frame.header.run} failed: {frame.status.detail or 'no reason was given'}")
    return HealthSchema(
        health=Health.TROUBLE if reasons else Health.GOOD,
        detail="; ".join(reasons),
        version=version,
        uptime_s=round(uptime, 3),
        runs=runs,
        live_run=frame.header.run if frame is not None and frame.status.state.is_under_way else None,
    )
