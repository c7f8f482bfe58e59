"""Which errors of an analysis become messages about the data."""

import pytest

from analysis.signals.errors import AmbiguousTachoError, AnalysisError, BandLimitError, RecordTooShortError
from daq.reports.errors import InsufficientDataError, translated_errors


@pytest.mark.parametrize("error", [AnalysisError, BandLimitError, RecordTooShortError, AmbiguousTachoError])
def test_analysis_error_becomes_insufficient_data(error: type[AnalysisError]) -> None:
    with pytest.raises(InsufficientDataError, match=r"^run r: 3 samples$"), translated_errors("run r"):
        raise error("3 samples")


@pytest.mark.parametrize("error", [ValueError, TypeError, KeyError, ZeroDivisionError])
def test_defect_is_not_reported_as_insufficient_data(error: type[Exception]) -> None:
    with pytest.raises(error, match="a defect"), translated_errors("run r"):
        raise error("a defect")
