"""When a recording starts or stops, as the operator writes it: "speed > 2000"."""

import re
from dataclasses import dataclass

SPEED, TIME = "speed", "time"
_NUMBER = r"[+-]?(?:[0-9]{1,3}(?:,[0-9]{3})+|[0-9][0-9_]*)(?:\.[0-9]+)?"  # a comma parts thousands, never decimals
_FORM = re.compile(rf"\s*([A-Za-z][A-Za-z0-9_-]{{0,31}})\s*([<>])\s*({_NUMBER})\s*")


@dataclass(frozen=True, slots=True)
class Condition:
    """A quantity above or below a value.

    Parameters
    ----------
    quantity : str
        "speed", "time", or the name of a channel.
    is_above : bool
        Whether it must be above the value; else below.
    value : float
        r/min of the speed, s of the time, V of a channel.
    """

    quantity: str
    is_above: bool
    value: float

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return {SPEED: "r/min", TIME: "s"}.get(self.quantity, "V")

    def __str__(self) -> str:
        """Return it as the operator writes it, with its unit."""
        return f"{self.quantity} {'>' if self.is_above else '<'} {self.value:g} {self.unit}"

    def holds(self, value: float) -> bool:
        """Return whether it holds for a value of its quantity; never for NaN."""
        return value > self.value if self.is_above else value < self.value


def read_condition(text: str) -> Condition | None:
    """Return the condition that a text says, None for an empty one.

    Raises
    ------
    ValueError
        The text says none; the message tells what is expected.
    """
    if not text.strip():
        return None
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError('expected a condition such as "speed > 2000" (r/min), "x > 4.5" (V) or "time > 10" (s)')
    quantity, sign, value = found.groups()
    return Condition(quantity, sign == ">", float(value.replace("_", "").replace(",", "")))
