"""Recorded runs: MCAP writer and reader, verification and recovery, run catalogue, import and export."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recordings.mcap.reader import RunReader

__all__ = ["open_run"]


def open_run(path: Path | str) -> "RunReader":
    """Open a recorded run.

    Parameters
    ----------
    path : Path or str
        The run's file.

    Returns
    -------
    RunReader
        The run, a context manager that closes its file.

    Raises
    ------
    RecordingError
        If there is no such file, or it is no run, damaged before its first samples, or not readable.

    Examples
    --------
    >>> with open_run("recordings/2026-11-24T09-00-00-gj90c.mcap") as run:  # doctest: +SKIP
    ...     print(run.header.run, run.duration, run.samples(0, 0, 1000).shape)
    """
    from recordings.mcap.reader import RunReader  # noqa: PLC0415 - so that commands that open no run start fast

    return RunReader(Path(path))
