"""Spectra and trajectories of chapter 6 of the thesis, Figures 6.4 to 6.21: what is seen at two speeds of each case."""

from dataclasses import dataclass

import numpy as np

from model.studies.run_up import INNER, LEAST, OUTER, VISIBLE, RunUp
from model.studies.study import Plot, Series, Style

Band = tuple[float, float]

HARMONIC = (1.2, 1.4)  # orders at which Fig. 6.16 has a component of its own
NAMES = {OUTER: "outer film's whirl", INNER: "inner film's whirl", HARMONIC: "1.3X"}


@dataclass(frozen=True, slots=True)
class Look:
    """A spectrum with its trajectory, and what the text says of it.

    Parameters
    ----------
    figure : str
        In the thesis.
    speed : float
        rad/s.
    stated : tuple of pairs of float
        The bands of orders in which the text sees something besides 1X; none where it calls the motion periodic.
    """

    figure: str
    speed: float
    stated: tuple[Band, ...]

    @property
    def text(self) -> str:
        """What is stated."""
        seen = " and ".join(NAMES[band] for band in self.stated) or "1X alone"
        return f"{self.figure}, {self.speed:,.0f} rad/s: {seen}"

    def judged(self, found: RunUp) -> tuple[bool, str]:
        """Return whether a run-up shows what is stated and no more, and what it shows."""
        row = self._row(found)
        visible = {band: _is_visible(found, row, band) for band in NAMES}
        parts = [f"{order:.2f}X {size * 1e6:.3g} µm" for order, size in (_strongest(found, row, b) for b in NAMES)]
        seen = [part for part, band in zip(parts, NAMES, strict=True) if visible[band]]
        shown = ", ".join([f"1X {found.first_order[row] * 1e6:.3g} µm", *seen])
        return all(visible[band] == (band in self.stated) for band in NAMES), shown

    def plots(self, found: RunUp, name: str) -> tuple[Plot, Plot]:
        """Return the spectrum and the trajectory of a run-up."""
        row = self._row(found)
        at = f"at {self.speed:,.0f} rad/s, {name}"
        spectrum = Series("", found.orders, found.spectrum[row] * 1e6)
        x, y = found.orbit[row] * 1e6
        return (
            Plot(f"Spectrum {at}", "Frequency over the shaft's speed [X]", "Amplitude in X [µm peak]", (spectrum,)),
            Plot(f"Trajectory {at}", "X [µm]", "Y [µm]", (Series("", x, y, Style.LINE),), is_square=True),
        )

    def _row(self, found: RunUp) -> int:
        return int(np.argmin(np.abs(found.speeds - self.speed)))


def _is_visible(found: RunUp, row: int, band: Band) -> bool:
    # as on a linear scale, as the thesis draws it: beside a whirl of 130 µm nobody sees its combinations of 3 µm
    _, size = _strongest(found, row, band)
    return size > max(VISIBLE * float(found.spectrum[row].max()), LEAST)


def _strongest(found: RunUp, row: int, band: Band) -> tuple[float, float]:
    inside = (found.orders >= band[0]) & (found.orders < band[1])
    place = int(np.argmax(found.spectrum[row][inside]))
    return float(found.orders[inside][place]), float(found.spectrum[row][inside][place])
