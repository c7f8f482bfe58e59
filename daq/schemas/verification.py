"""Schemas of the verification and recovery of recordings."""

from daq.schemas.units import Schema
from recordings.integrity.file_checks import Check, Finding
from recordings.integrity.recover import Recovery
from recordings.integrity.verify import Verdict, Verification


class VerificationFindingSchema(Schema):
    """A finding of a verification."""

    check: Check
    location: str
    description: str
    is_fault: bool


class VerificationSchema(Schema):
    """Result of verifying a recording's file."""

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
    """Samples of a segment that were not recovered; null where the end of the segment is unknown."""

    segment: int
    first_sample: int
    stop_sample: int | None
    samples: int | None


class RecoveredSegmentSchema(Schema):
    """A segment of the copy and the position of its samples in the damaged recording."""

    segment: int
    from_segment: int
    first_sample: int
    stop_sample: int


class RecoverySchema(Schema):
    """Result of a recovery."""

    source: str
    target: str
    samples: int
    damaged_chunks: int
    segments: list[RecoveredSegmentSchema]
    missing: list[MissingSamplesSchema]


def verification_schema(verification: Verification) -> VerificationSchema:
    """Return the schema of a verification."""
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
    """Return the schema of a recovery."""
    return RecoverySchema(
        source=str(recovery.source),
        target=str(recovery.target),
        samples=recovery.samples,
        damaged_chunks=recovery.damaged_chunks,
        segments=[
            RecoveredSegmentSchema(
                segment=segment.segment,
                from_segment=segment.from_segment,
                first_sample=segment.first,
                stop_sample=segment.stop,
            )
            for segment in recovery.segments
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
