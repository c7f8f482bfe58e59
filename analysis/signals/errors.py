"""Errors of the analysis of measured data, for callers that can handle them.

AnalysisError
├── AmbiguousTachoError  the shaft angle is ambiguous from the pulses, and repairing them would be guessing
├── RecordTooShortError  fewer whole revolutions or samples than the analysis needs
├── BandLimitError       an order, bandwidth or line spacing that the record's sample rate does not allow
└── CalibrationFitError  the points do not determine a calibration

Misuse (wrong shapes, settings that no record allows) is a ``ValueError``.
"""


class AnalysisError(Exception):
    """The data do not allow the requested analysis."""


class AmbiguousTachoError(AnalysisError):
    """The shaft angle is ambiguous from the tacho pulses."""


class RecordTooShortError(AnalysisError):
    """The record holds fewer whole revolutions or samples than the analysis needs."""


class BandLimitError(AnalysisError):
    """An order, bandwidth or line spacing is not possible at the record's sample rate and speed."""


class CalibrationFitError(AnalysisError):
    """The points do not determine a calibration whose voltage rises with the gap."""
