"""Spectra and trajectories of chapter 6 of the thesis, Figures 6.4 to 6.21: what is seen at two speeds of each case."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from model.dynamics.whirl import FilmName
from model.studies.run_up import MIN_AMPLITUDE, VISIBLE_RATIO, RunUp
from model.studies.study import Plot, Series, Style


class Component(Enum):
    """What a spectrum may show besides 1X."""

    OUTER = "outer film's whirl"
    INNER = "inner film's whirl"
    HARMONIC = "1.3X"

    @property
    def film(self) -> FilmName | None:
        """The film whose whirl it is."""
        return {Component.OUTER: FilmName.OUTER, Component.INNER: FilmName.INNER}.get(self)


HARMONIC = (1.2, 1.4)  # orders at which Fig. 6.16 has a component of its own


@dataclass(frozen=True, slots=True)
class Spectrum:
    """A spectrum with its trajectory, and what the text says of it.

    Parameters
    ----------
    figure : str
        In the thesis.
    speed : float
        rad/s.
    stated : tuple of Component
        What the text sees besides 1X; none where it calls the motion periodic.
    order : float
        Of the one that is stated, where its order is stated too; NaN where not.
    """

    figure: str
    speed: float
    stated: tuple[Component, ...]
    order: float = math.nan

    @property
    def text(self) -> str:
        """What is stated."""
        seen = " and ".join(one.value for one in self.stated) or "1X alone"
        return f"{self.figure}, {self.speed:,.0f} rad/s: {seen}"

    def evaluate(self, found: RunUp) -> tuple[bool, str]:
        """Return whether a run-up shows what is stated and no more, and what it shows."""
        row = self._row(found)
        # as on a linear scale, as the thesis draws it: beside a whirl of 130 µm nobody sees its combinations of 3 µm
        least = max(VISIBLE_RATIO * float(found.spectrum[row].max()), MIN_AMPLITUDE)
        sizes = {one: self.size(found, one) for one in Component}
        visible = {one: size > least for one, (_, size) in sizes.items()}
        parts = [f"{order:.2f}X {size * 1e6:.3g} µm" for one, (order, size) in sizes.items() if visible[one]]
        reference_equilibrium = ", ".join([f"1X {found.first_order[row] * 1e6:.3g} µm", *parts])
        return all(visible[one] == (one in self.stated) for one in Component), reference_equilibrium

    def size(self, found: RunUp, component: Component) -> tuple[float, float]:
        """Return a component's order and size, m peak, as a run-up shows them."""
        film, row = component.film, self._row(found)
        order, size = found.component(HARMONIC) if film is None else found.whirl(film)
        return float(order[row]), float(size[row])

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
