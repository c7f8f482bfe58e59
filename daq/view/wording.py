"""How quantities are written for the operator."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.live.alarms import Alarm, Watched
from daq.view.bode import phase_lag
from model.prediction.prediction import Prediction


def rpm(speed: float) -> str:
    """Return a speed, rad/s, in whole r/min."""
    return f"{speed * 30.0 / math.pi:,.0f}"


def clock(elapsed: float) -> str:
    """Return a time, s, as 02:41 or 1:02:41."""
    seconds = max(0, int(elapsed))
    minutes, seconds = divmod(seconds, 60)
    if minutes < 60:
        return f"{minutes:02d}:{seconds:02d}"
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}"


def worst_alarm(alarms: Sequence[Alarm]) -> str:
    """Return the alarm that passed the worst limit by most, as DANGER x 96 µm or ALARM 1X y 24 µm."""
    worst = max(alarms, key=lambda alarm: (alarm.severity.rank, alarm.largest / alarm.limit))
    word = worst.severity.value.upper()
    if worst.quantity is Watched.SPEED:
        return f"{word} {rpm(worst.largest)} r/min"
    which = "" if worst.quantity is Watched.OVERALL else f"{worst.quantity.value} "
    return f"{word} {which}{worst.probe} {worst.largest * 1e6:.0f} µm"


def hours(left: float) -> str:
    """Return how long the disk lasts, s, as 41 h or 25 min."""
    if not math.isfinite(left):
        return "not written"
    return f"{left / 3600.0:,.0f} h" if left >= 7200.0 else f"{left / 60.0:.0f} min"


def micrometres(length: float) -> str:
    """Return a length, m, in µm with as many digits as can be trusted at a glance."""
    return f"{length * 1e6:.0f} µm" if abs(length) >= 9.95e-6 else f"{length * 1e6:.1f} µm"


def basis(prediction: Prediction) -> str:
    """Return what a prediction is in a word: integrated at exactly its speed, or interpolated between others."""
    return f"exact at {rpm(prediction.speed)} r/min" if prediction.is_exact else "interpolated"


def sigma(value: float) -> str:
    """Return a standard deviation, any unit, with the one digit that counts."""
    return f"{float(f'{max(value, 0.001):.1g}'):g}"


def vector(value: complex) -> str:
    """Return a vector, m peak, as amplitude and phase lag."""
    return f"{micrometres(abs(value))}, {float(phase_lag(np.asarray(value))):.0f}°"


_LAST_LATIN = 0x24F


def legible(text: str) -> str:
    """Return the text with a question mark for every letter that the viewer's only fount lacks.

    The viewer may break down over such a letter, and names, notes and messages come from outside.
    """
    return "".join(c if c == "\n" or (c.isprintable() and ord(c) <= _LAST_LATIN) or c in "–—…" else "?" for c in text)
