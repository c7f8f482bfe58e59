"""Compilation of the double of NI's C library."""

import subprocess
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "drivers" / "ni" / "nidaqmx_double.c"
TOOLS = ("cc", "ld", "objdump")  # needed to compile and load it


def build(library: Path, source: Path, *options: str | Path) -> None:
    """Compile a source file to a shared library."""
    command = ["cc", "-shared", "-fPIC", "-O1", f"-Wl,-soname,{library.name}", "-o", library, source, *options]
    subprocess.run(command, check=True, timeout=60)
