"""Schema of the service's health."""

from enum import StrEnum

from pydantic import Field

from daq.schemas.units import Schema
from daq.session.live_update import LiveUpdate, RunState


class Health(StrEnum):
    """Overall health of the service."""

    GOOD = "good"
    TROUBLE = "trouble"  # the data folder cannot be read, or the current run has failed


class HealthSchema(Schema):
    """Health of the service."""

    health: Health = Field(description="good, or trouble with the reason in `detail`", examples=["good"])
    detail: str = Field(description="Cause of the trouble; empty if there is none", examples=[""])
    version: str = Field(description="Version of the service", examples=["0.1.0"])
    uptime_s: float = Field(description="Time since the start of the service, s", examples=[162.4])
    runs: int | None = Field(
        description="Number of runs in the data folder; null if it cannot be read", examples=[12], ge=0
    )
    live_run: str | None = Field(
        description="Id of the run in progress; null if there is none", examples=["2026-11-24T09-12-07-gj90c"]
    )


def health_schema(
    version: str, uptime: float, runs: int | None, update: LiveUpdate | None, trouble: str = ""
) -> HealthSchema:
    """Return the health of the service.

    Parameters
    ----------
    version : str
        Version of the service.
    uptime : float
        Time since its start, s.
    runs : int or None
        Number of runs in the data folder; None if it cannot be read.
    update : LiveUpdate or None
        The latest of the live run.
    trouble : str
        Error of the data folder; empty if there is none.

    Returns
    -------
    HealthSchema
        Trouble if the folder cannot be read or the current run has failed.
    """
    failed = update is not None and update.status.state is RunState.FAILED
    reasons = [trouble] if trouble else []
    if update is not None and failed:
        reasons.append(f"run {update.header.run} failed: {update.status.detail or 'no reason was given'}")
    return HealthSchema(
        health=Health.TROUBLE if reasons else Health.GOOD,
        detail="; ".join(reasons),
        version=version,
        uptime_s=round(uptime, 3),
        runs=runs,
        live_run=update.header.run if update is not None and update.status.state.is_active else None,
    )
