"""Windowed-sinc interpolation between samples, accurate to 1e-3 up to 0.42 of the sample rate."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

HALF_WIDTH = 16  # samples used on each side
_PHASES = 512  # rows of the kernel table between two samples
_BETA = 7.7  # of the Kaiser window: error below 1e-3 up to 0.42 of the sample rate


def _kernel_table() -> FloatArray:
    """Return the weights of the neighbours for the phases from 0 to 1, shape (_PHASES + 1, 2 * HALF_WIDTH)."""
    fraction = np.arange(_PHASES + 1)[:, None] / _PHASES
    distance = fraction - np.arange(1 - HALF_WIDTH, HALF_WIDTH + 1)
    window = np.i0(_BETA * np.sqrt(np.maximum(1.0 - (distance / HALF_WIDTH) ** 2, 0.0)))
    weights = np.sinc(distance) * window
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float64)


_TABLE = _kernel_table()
_SLOPE = np.diff(_TABLE, axis=0)
_BLOCK = 512  # positions whose weights and neighbours fit the cache of a core


def interpolate(samples: FloatArray, positions: FloatArray) -> FloatArray:
    """Return the values of each channel at its own positions.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_channels, n)
        Uniform samples.
    positions : ndarray of float64, shape (n_channels, m)
        Positions in samples from the first, each from ``HALF_WIDTH - 1`` to below ``n - HALF_WIDTH``.

    Returns
    -------
    ndarray of float64, shape (n_channels, m)
        Interpolated values; the error of amplitudes is below 0.01 % up to 0.4 of the sample rate.

    Raises
    ------
    ValueError
        Positions are too near the ends.

    Notes
    -----
    R. Schafer and L. Rabiner, A digital signal processing approach to interpolation, Proc. IEEE 61, 1973; Kaiser's
    window, weights interpolated linearly between 512 phases.
    """
    whole = np.floor(positions).astype(np.int64)
    if positions.size and (whole.min() < HALF_WIDTH - 1 or whole.max() + HALF_WIDTH > samples.shape[-1] - 1):
        raise ValueError(
            f"positions: {positions.min():.1f} to {positions.max():.1f} samples, expected {HALF_WIDTH - 1} to "
            f"below {samples.shape[-1] - HALF_WIDTH}"
        )
    fine = (positions - whole) * _PHASES
    row = np.minimum(fine.astype(np.int64), _PHASES - 1)
    fraction = fine - row
    values = np.empty(positions.shape)
    for channel, channel_samples in enumerate(samples):
        neighbours = np.lib.stride_tricks.sliding_window_view(channel_samples, 2 * HALF_WIDTH)
        for begin in range(0, positions.shape[1], _BLOCK):
            here = np.s_[channel, begin : begin + _BLOCK]
            weights = _SLOPE[row[here]]
            weights *= fraction[here][:, None]
            weights += _TABLE[row[here]]
            np.einsum("mk,mk->m", weights, neighbours[whole[here] - (HALF_WIDTH - 1)], out=values[here])
    return values
