"""What the driver warns of, kept for the operator: Python would print it across the screen, at every read anew."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TextIO

from nidaqmx.errors import DaqWarning

from daq.drivers.ni.error_codes import driver_words

_heard_by: ContextVar["Warned | None"] = ContextVar("heard_by", default=None)
_passed_on = warnings.showwarning


class Warned:
    """The driver's warnings, each once."""

    def __init__(self) -> None:
        self._texts: dict[int, str] = {}
        self._told = 0

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """Keep what the driver warns of in this block and thread."""
        _listen()
        token = _heard_by.set(self)
        try:
            yield
        finally:
            _heard_by.reset(token)

    def add(self, warning: DaqWarning) -> None:
        """Keep a warning."""
        code = int(warning.error_code)
        text = str(warning).removeprefix(f"\nWarning {code} occurred.\n\n")
        self._texts.setdefault(code, f"the driver warns: {driver_words(text)} (driver code {code})")

    def news(self) -> list[str]:
        """Return the warnings that have come since this was last asked."""
        texts = list(self._texts.values())[self._told :]
        self._told += len(texts)
        return texts


def _listen() -> None:
    """See to it that this file is shown every warning first, whoever else has come to show them since."""
    global _passed_on  # noqa: PLW0603 - Python has one place where warnings are shown
    if warnings.showwarning is not _show:
        _passed_on = warnings.showwarning
        warnings.showwarning = _show


def _show(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    warned = _heard_by.get()
    if warned is not None and isinstance(message, DaqWarning):
        warned.add(message)
    else:
        _passed_on(message, category, filename, lineno, file, line)
