"""Whether a recording is whole, and what a recovery brought back, as documents."""

from daq.schemas.units import Document
from recordings.integrity.checks import Check, Finding
from recordings.integrity.recover import Recovery
from recordings.integrity.verify import Verdict, Verification


class FindingDocument(Document):
    """Something found in a recording's file."""

    check: Check
    where: str
    what: str
    is_fault: bool


class VerificationDocument(Document):
    """What an inspection of a recording's file came to."""

    run: str
    path: str
    verdict: Verdict
    size_bytes: int
    chunks: int
    segments: int
    samples: int
    pulses: int
    findings: list[FindingDocument]


class MissingDocument(Document):
    """Samples of a segment that a recovery did not bring back; null where nobody knows how far the segment went."""

    segment: int
    first_sample: int
    stop_sample: int | None
    samples: int | None


class StretchDocument(Document):
    """A segment of the copy and where its samples lay in the damaged recording."""

    segment: int
    from_segment: int
    first_sample: int
    stop_sample: int


class RecoveryDocument(Document):
    """What a recovery brought back."""

    source: str
    target: str
    samples: int
    damaged_chunks: int
    segments: list[StretchDocument]
    missing: list[MissingDocument]


def verification_document(verification: Verification) -> VerificationDocument:
    """Return an inspection as a document."""
    return VerificationDocument(
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


def recovery_document(recovery: Recovery) -> RecoveryDocument:
    """Return a recovery as a document."""
    return RecoveryDocument(
        source=str(recovery.source),
        target=str(recovery.target),
        samples=recovery.samples,
        damaged_chunks=recovery.damaged_chunks,
        segments=[
            StretchDocument(
                segment=stretch.segment,
                from_segment=stretch.from_segment,
                first_sample=stretch.first,
                stop_sample=stretch.stop,
            )
            for stretch in recovery.stretches
        ],
        missing=[
            MissingDocument(segment=gap.segment, first_sample=gap.first, stop_sample=gap.stop, samples=gap.samples)
            for gap in recovery.missing
        ],
    )


def _finding(finding: Finding) -> FindingDocument:
    return FindingDocument(check=finding.check, where=finding.where, what=finding.what, is_fault=finding.is_fault)
