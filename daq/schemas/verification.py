"""Whether a recording is whole, and what a recovery brought back, as documents."""

from daq.schemas.units import Schema
from recordings.integrity.checks import Check, Finding
from recordings.integrity.recover import Recovery
from recordings.integrity.verify import Verdict, Verification


class VerificationFindingSchema(Schema):
    """Something found in a recording's file."""

    check: Check
    location: str
    description: str
    is_fault: bool


class VerificationSchema(Schema):
    """What an inspection of a recording's file came to."""

    run: str
    path: str
    verdict: Verdict
    size_bytes: int
    chunks: int
    segments: int
    samples: int
    pulses: int
    findings: list[VerificationFindingSchema]


class MissingSamplesSchema(Schema):
    """Samples of a segment that a recovery did not bring back; null where nobody knows how far the segment went."""

    segment: int
    first_sample: int
    stop_sample: int | None
    samples: int | None


class RecoveredSegmentSchema(Schema):
    """A segment of the copy and where its samples lay in the damaged recording."""

    segment: int
    from_segment: int
    first_sample: int
    stop_sample: int


class RecoverySchema(Schema):
    """What a recovery brought back."""

    source: str
    target: str
    samples: int
    damaged_chunks: int
    segments: list[RecoveredSegmentSchema]
    missing: list[MissingSamplesSchema]


def verification_schema(verification: Verification) -> VerificationSchema:
    """Return an inspection as a document."""
    return VerificationSchema(
        run=verification.run,
        path=str(verification.path),
        verdict=verification.verdict,
        size_bytes=verification.size,
        chunks=verification.chunks,
        segments=verification.segments,
        samples=verification.samples,
        pulses=verification.pulses,
        findings=[_finding(finding) for finding in verification.findings],
    )


def recovery_schema(recovery: Recovery) -> RecoverySchema:
    """Return a recovery as a document."""
    return RecoverySchema(
        source=str(recovery.source),
        target=str(recovery.target),
        samples=recovery.samples,
        damaged_chunks=recovery.damaged_chunks,
        segments=[
            RecoveredSegmentSchema(
                segment=stretch.segment,
                from_segment=stretch.from_segment,
                first_sample=stretch.first,
                stop_sample=stretch.stop,
            )
            for stretch in recovery.stretches
        ],
        missing=[
            MissingSamplesSchema(segment=gap.segment, first_sample=gap.first, stop_sample=gap.stop, samples=gap.samples)
            for gap in recovery.missing
        ],
    )


def _finding(finding: Finding) -> VerificationFindingSchema:
    return VerificationFindingSchema(
        check=finding.check, location=finding.where, description=finding.what, is_fault=finding.is_fault
    )
