"""Errors of the analysis of a whole record, for callers that can handle them.

AnalysisError
├── TachoRefusedError    the shaft angle is ambiguous from the pulses, and repairing them would be guessing
└── RecordTooShortError  fewer whole revolutions or samples than the analysis needs
"""


class AnalysisError(Exception):
    """The record does not allow the requested analysis."""


class TachoRefusedError(AnalysisError):
    """The shaft angle is ambiguous from the tacho pulses."""


class RecordTooShortError(AnalysisError):
    """The record holds fewer whole revolutions or samples than the analysis needs."""
