"""How far long work on a recording is."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Told the part that is done, 0 to 1."""


def ignore_progress(_part: float) -> None:
    """Tell nobody."""
