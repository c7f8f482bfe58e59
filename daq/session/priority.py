"""Work that nobody waits for gives way to work that somebody does."""

import ctypes
import os
import sys

BELOW_NORMAL = 0x4000  # Windows' BELOW_NORMAL_PRIORITY_CLASS


def give_way() -> None:
    """Lower the priority of this process."""
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.SetPriorityClass(kernel.GetCurrentProcess(), BELOW_NORMAL)
    else:
        os.nice(5)
