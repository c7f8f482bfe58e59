"""What a preflight found."""

from pydantic import Field

from analysis.preflight.verdict import Check, Finding, Verdict
from daq.schemas.document import Document
from daq.schemas.header import DeviceDocument, device_document
from daq.session.preflight.preflight import Preflight


class CheckDocument(Document):
    """One line of the table."""

    name: str = Field(description="What was looked at", examples=["probe y gap"])
    verdict: Verdict = Field(description="How it came out")
    finding: Finding | None = Field(description="What is wrong; null where the check passed")
    value: str = Field(description="What was seen, with its unit", examples=["0.02 V"])
    limit: str = Field(description="What was expected, with its unit", examples=["1.5 to 8.5 V"])
    advice: str = Field(description="What it means at the bench and what to do; empty where nothing is to be done")


class PreflightDocument(Document):
    """Whether a rig is ready."""

    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    verdict: Verdict = Field(description="The worst of all checks; FAIL stands against a run")
    device: DeviceDocument | None = Field(description="What delivered the samples; null where nothing did")
    sample_rate_hz: float | None = Field(description="Samples per channel and second as the card does it, Hz")
    convert_rate_hz: float | None = Field(description="Clock of the multiplexer between channels, Hz")
    checks: tuple[CheckDocument, ...] = Field(description="In the order in which an operator would look")


def preflight_document(rig: str, found: Preflight) -> PreflightDocument:
    """Return what was found as a document."""
    acquisition = found.acquisition
    return PreflightDocument(
        rig=rig,
        verdict=found.verdict,
        device=None if acquisition is None else device_document(acquisition.device),
        sample_rate_hz=None if acquisition is None else acquisition.rate,
        convert_rate_hz=None if acquisition is None else acquisition.convert_rate,
        checks=tuple(_check_document(check) for check in found.checks),
    )


def _check_document(check: Check) -> CheckDocument:
    return CheckDocument(
        name=check.name,
        verdict=check.verdict,
        finding=check.finding,
        value=check.value,
        limit=check.limit,
        advice=check.advice,
    )
