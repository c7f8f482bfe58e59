"""Errors of the reports.

::

    RigError
      InsufficientDataError     the samples do not contain what the analysis needs
    LookupError
      DataNotFoundError         the run has nothing at the requested segment, time or speed
    ValueError
      RequestTooLargeError      the result would exceed a size limit
      ArrowUnavailableError     pyarrow is not installed
      PngUnavailableError       matplotlib is not installed
"""

from collections.abc import Iterator
from contextlib import contextmanager

from analysis.signals.errors import AnalysisError
from daq.errors import RigError


class InsufficientDataError(RigError):
    """The samples do not contain what the analysis needs: too few revolutions, no tacho, an order out of range."""


class DataNotFoundError(LookupError):
    """The run has nothing at the requested segment, time or speed."""


class RequestTooLargeError(ValueError):
    """The result would exceed a size limit."""


class ArrowUnavailableError(ValueError):
    """Arrow needs pyarrow, which is not installed."""


class PngUnavailableError(ValueError):
    """PNG needs matplotlib, which is not installed."""


@contextmanager
def translated_errors(where: str) -> Iterator[None]:
    """Raise analysis errors of the block as `InsufficientDataError`; ``where`` starts the message."""
    try:
        yield
    except (AnalysisError, ValueError) as error:  # a ValueError of the analysis is about the parameters
        raise InsufficientDataError(f"{where}: {error}") from error
