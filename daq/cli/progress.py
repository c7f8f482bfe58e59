"""Progress output: the status line of a run, rewritten on a terminal and repeated every 5 s in a file."""

import math
import sys
import time
from contextlib import suppress
from typing import TextIO

from analysis.signals.header import Severity
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import MICROMETRE, RPM
from daq.cli.terminal import fit_to_width, terminal_width, wrap_line
from daq.session.live_update import LiveUpdate, Status

_FILE_INTERVAL = 5.0  # s between progress lines where the output is no terminal
_MAX_STEADY_ACCELERATION = 20 * RPM  # rad/s²; up to it the speed is shown as steady


class TerminalOutput:
    """Prints lines and progress to a stream.

    Parameters
    ----------
    stream : TextIO
        Output; by default standard error, because `--json` prints on standard output.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._rewrites = self._stream.isatty()
        self._last = -math.inf
        self._width = 0

    def line(self, text: str) -> None:
        """Print lines that progress does not overwrite."""
        self.clear()
        width = terminal_width(self._stream)
        self._print("\n".join(wrap_line(line, width) for line in text.split("\n")))

    def progress(self, text: str, part: float | None = None) -> None:
        """Show progress, with the fraction done, 0 to 1; on a terminal it replaces the last progress line."""
        if part is not None:
            text = f"{text}: {100 * part:.0f} %"
        now = time.monotonic()
        if self._rewrites:
            text = fit_to_width(text, terminal_width(self._stream))
            self._print("\r" + text.ljust(self._width), end="")
            self._width = len(text)
        elif (part is None or part >= 0.01) and now - self._last >= _FILE_INTERVAL:
            self._last = now
            self._print(text)

    def done(self) -> None:
        """Finish the progress line; it stays on the terminal."""
        if self._width:
            self._print("")
            self._width = 0

    def clear(self) -> None:
        """Erase the progress line."""
        if self._width:
            self._print("\r" + " " * self._width + "\r", end="")
            self._width = 0

    def _print(self, text: str, end: str = "\n") -> None:
        with suppress(OSError, ValueError):  # the terminal was closed; the run continues
            print(text, end=end, file=self._stream, flush=True)


def status_line(update: LiveUpdate) -> str:
    """Return a live update as one line, most important parts first, because narrow terminals cut off the rest."""
    status, snapshot = update.status, update.snapshot
    minutes, seconds = divmod(int(status.elapsed), 60)
    parts = [f"{minutes:02d}:{seconds:02d}"]
    if snapshot is None:
        parts.append("waiting for the first samples")
    else:
        parts.append(_speed(update))
        x, y = snapshot.peak_to_peak / MICROMETRE
        parts.append(f"x {x:.0f} µm  y {y:.0f} µm pp{_alarms(status)}")
    parts += [f"{each.channel} CLIPPED {each.samples:,} in {each.blocks:,} blocks" for each in status.clipped]
    parts.append(f"lost {'' if status.lost_is_exact else '≥ '}{status.lost:,}")
    parts.append(status.detail)
    if snapshot is not None:
        parts += [_counter(snapshot), *_whirl(update)]
    if status.skipped:
        parts.append(f"live analysis skipped {status.skipped:,}")
    parts.append(f"backlog {status.backlog:.1f} s")
    if math.isfinite(status.disk_left):
        parts.append(f"disk {format_duration(status.disk_left)}")
    if status.model != "ready":
        parts.append(f"model {status.model}")
    return "  ".join(part for part in parts if part)


def _counter(snapshot: Snapshot) -> str:
    """Return how the tacho counter disagrees with the samples; empty where it agrees."""
    counter = snapshot.counter
    if counter is None or not counter.message:
        return ""
    return f"tacho counter: {', '.join(filter(None, (counter.state.value, counter.recent_message)))}"


def _alarms(status: Status) -> str:
    """Return the worst alarm severity shown and the quantities at it."""
    if status.latched is Severity.NORMAL:
        return ""
    worst = dict.fromkeys(alarm.quantity.value for alarm in status.alarms if alarm.severity is status.latched)
    return f"  {status.latched.value.upper()} {', '.join(worst)}"


def _speed(update: LiveUpdate) -> str:
    snapshot = update.snapshot
    if snapshot is None or math.isnan(snapshot.speed):
        state = "" if snapshot is None else snapshot.tacho.state.value
        return f"speed ? ({state})"
    trend = " "
    if snapshot.frame is not None and abs(snapshot.frame.acceleration) > _MAX_STEADY_ACCELERATION:
        trend = "▲" if snapshot.frame.acceleration > 0 else "▼"
    return f"{snapshot.speed / RPM:6,.0f} r/min {trend}"


def _whirl(update: LiveUpdate) -> list[str]:
    """Return the strongest component below 1X, measured and predicted."""
    snapshot, prediction = update.snapshot, update.prediction
    whirl = None if snapshot is None or snapshot.frame is None else snapshot.frame.whirl
    parts = [] if whirl is None else [f"{whirl.order:.2f}X {whirl.amplitude / MICROMETRE:.0f} µm"]
    if prediction is not None and not math.isnan(prediction.whirl_order):
        parts.append(f"(model {prediction.whirl_order:.2f}X {prediction.whirl_amplitude / MICROMETRE:.0f} µm)")
    return parts


def format_duration(seconds: float) -> str:
    """Return a duration with a suitable unit, such as "41 h"."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h"
