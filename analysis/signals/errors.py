"""What the analysis of a whole record may refuse, for callers who can do something about it.

AnalysisError
├── TachoRefusedError    the pulses do not tell the angle, and repairing them would be guessing
└── RecordTooShortError  fewer whole revolutions or samples than the question needs
"""


class AnalysisError(Exception):
    """A record that cannot give what was asked."""


class TachoRefusedError(AnalysisError):
    """The tacho's pulses do not tell the angle of the shaft."""


class RecordTooShortError(AnalysisError):
    """The record holds fewer whole revolutions or samples than the question needs."""
