"""Work that nobody waits for gives way to work that somebody does."""

import ctypes
import os
import sys

BELOW_NORMAL = 0x4000  # Windows' BELOW_NORMAL_PRIORITY_CLASS


def give_way(steps: int = 5) -> None:
    """Lower the priority of this process.

    Parameters
    ----------
    steps : int
        How far, 1 to 19, where the system knows steps; Windows knows one.
    """
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), BELOW_NORMAL)
    else:
        os.nice(steps)
