"""Data types that all packages share: arrays, run header, sample blocks, snapshots, probes, uncertainty, errors."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
CodeArray = NDArray[np.int16]  # converter codes
