"""A recording that does not tell what was asked of it."""

from collections.abc import Iterator
from contextlib import contextmanager

from analysis.signals.errors import AnalysisError
from daq.errors import RigError


class NotToldError(RigError):
    """The samples do not tell what was asked: too few revolutions, no tacho, an order out of reach."""


@contextmanager
def told_or_refused(where: str) -> Iterator[None]:
    """Say where the samples do not tell; a ValueError of the analysis is about what was asked for."""
    try:
        yield
    except (AnalysisError, ValueError) as error:
        raise NotToldError(f"{where}: {error}") from error
