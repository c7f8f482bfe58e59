"""WAV: columns named "1", "2" …; 16-bit values are codes, others are scaled to -1 to 1."""

import warnings
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table


def read(path: Path) -> Table:
    """Return the table of a file."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        try:
            rate, values = wavfile.read(path)
        except wavfile.WavFileWarning as error:
            raise ForeignFormatError(f"is cut short: {error}") from error
    if values.ndim == 1:
        values = values[:, np.newaxis]
    if values.dtype != np.int16:
        values = _fractions(values)
    columns = [Column(str(k), "", np.ascontiguousarray(column)) for k, column in enumerate(values.T, start=1)]
    return Table(tuple(columns), float(rate))


def _fractions(
    values: np.ndarray[tuple[int, ...], np.dtype[np.generic]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return values scaled to -1 to 1; 8-bit values are unsigned, 24-bit values are the upper bits of 32."""
    if values.dtype == np.uint8:
        return (values.astype(np.float64) - 128) / 128
    if values.dtype == np.int32:
        return values.astype(np.float64) / 2**31
    return values.astype(np.float64)
