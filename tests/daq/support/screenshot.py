"""Take a screenshot of a page: `python tests/daq/support/screenshot.py URL IMAGE.png [SECONDS]`.

Starts a virtual display (Xvfb) with Chromium, waits, and takes the screenshot with ImageMagick. Needs xvfb, chromium
and imagemagick, but no graphics card.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

SIZE = (1920, 1080)
_PROGRAMS = ("Xvfb", "chromium", "import")


def missing_programs() -> list[str]:
    """Return the required programs that are not installed."""
    return [program for program in _PROGRAMS if shutil.which(program) is None]


def take_screenshot(url: str, image: Path, wait: float = 40.0) -> None:
    """Write a screenshot of the page at ``url``, ``wait`` s after the start of the browser."""
    width, height = SIZE
    with ExitStack() as stack:
        profile = stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        read, write = os.pipe()
        with os.fdopen(read) as answer:
            server = subprocess.Popen(
                ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp"],
                pass_fds=[write],
                stderr=subprocess.DEVNULL,
            )
            stack.callback(_end, server)
            os.close(write)
            display = f":{answer.readline().strip()}"
        browser = subprocess.Popen(
            [
                "chromium",
                "--no-sandbox",
                "--no-first-run",
                "--disable-sync",
                "--disable-background-networking",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--ignore-gpu-blocklist",
                f"--window-size={width},{height}",
                "--window-position=0,0",
                "--kiosk",
                f"--user-data-dir={profile}",
                url,
            ],
            env={**os.environ, "DISPLAY": display},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        stack.callback(_end, browser)
        time.sleep(wait)
        subprocess.run(
            ["import", "-display", display, "-window", "root", "-depth", "8", "-strip", str(image)],
            check=True,
            timeout=60.0,
        )


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


if __name__ == "__main__":
    if absent := missing_programs():
        sys.exit(f"not installed: {', '.join(absent)}")
    take_screenshot(sys.argv[1], Path(sys.argv[2]), *(float(seconds) for seconds in sys.argv[3:4]))
