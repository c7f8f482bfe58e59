"""Errors of the reports.

::

    RigError
    ├── InsufficientDataError     the samples do not contain what the analysis needs             exit 1
    ├── DataNotFoundError         the run has nothing at the requested segment, time or speed    exit 2
    ├── RequestTooLargeError      the result would exceed a size limit                           exit 2
    └── ArrowUnavailableError     pyarrow is not installed                                       exit 2
"""

from collections.abc import Iterator
from contextlib import contextmanager

from analysis.signals.errors import AnalysisError
from daq.errors import RigError


class InsufficientDataError(RigError):
    """The samples do not contain what the analysis needs: too few revolutions, no tacho, an order out of range."""


class DataNotFoundError(RigError):
    """The run has nothing at the requested segment, time or speed."""

    exit_code = 2


class RequestTooLargeError(RigError):
    """The result would exceed a size limit."""

    exit_code = 2


class ArrowUnavailableError(RigError):
    """Arrow needs pyarrow, which is not installed."""

    exit_code = 2


@contextmanager
def translated_errors(where: str) -> Iterator[None]:
    """Raise an AnalysisError of the block as `InsufficientDataError`; ``where`` starts the message."""
    try:
        yield
    except AnalysisError as error:
        raise InsufficientDataError(f"{where}: {error}") from error
