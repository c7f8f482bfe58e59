"""Memory that a process shares with those that it starts, and with nobody else.

It has no name: the system takes it back with the last process that holds it, however that one ends.
"""

from ctypes import Array, c_char
from multiprocessing import get_context
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

SharedBytes: TypeAlias = "Array[c_char]"
"""Given to a process when it is started, and in no other way."""


def shared_bytes(size: int) -> SharedBytes:
    """Return so many zeroed bytes, aligned to words."""
    return get_context("spawn").RawArray(c_char, size)


def bytes_of(memory: SharedBytes) -> NDArray[np.uint8]:
    """Return shared memory as it is, not a copy."""
    return np.frombuffer(memoryview(memory), dtype=np.uint8)
