"""Progress callback of operations on large recordings."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Called with the fraction done, 0 to 1."""


def ignore_progress(_fraction: float) -> None:
    """Do nothing: the default progress callback."""
