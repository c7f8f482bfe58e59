"""Spectra and trajectories of chapter 6 of the thesis, Figures 6.4 to 6.21: two speeds of each case."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from analysis.signals.units import MICROMETRE
from model.dynamics.stability import FilmName
from model.studies.motion import MIN_AMPLITUDE
from model.studies.run_up import VISIBLE_RATIO, RunUp
from model.studies.study import Plot, Series, Style
from model.studies.thesis.report import Verdict


class Component(Enum):
    """A component of a spectrum in addition to 1X."""

    OUTER = "outer film's whirl"
    INNER = "inner film's whirl"
    HARMONIC = "1.3X"

    @property
    def film(self) -> FilmName | None:
        """The film of a whirl component; None for other components."""
        return {Component.OUTER: FilmName.OUTER, Component.INNER: FilmName.INNER}.get(self)


HARMONIC = (1.2, 1.4)  # orders of an additional component in Fig. 6.16


@dataclass(frozen=True, slots=True)
class Spectrum:
    """A spectrum and trajectory of the thesis, with the components stated in the text.

    Parameters
    ----------
    figure : str
        Figure in the thesis.
    speed : float
        rad/s.
    stated : tuple of Component
        Stated components in addition to 1X; empty if the motion is called periodic.
    order : float
        Stated order of the component; NaN if none is stated.
    """

    figure: str
    speed: float
    stated: tuple[Component, ...]
    order: float = math.nan

    @property
    def text(self) -> str:
        """The stated components as text."""
        seen = " and ".join(one.value for one in self.stated) or "1X alone"
        return f"{self.figure}, {self.speed:,.0f} rad/s: {seen}"

    def evaluate(self, run: RunUp) -> tuple[Verdict, str]:
        """Return whether a run-up shows exactly the stated components, and the computed components as text.

        Undecided if the motion without whirl is unstable and the run-up too short for the whirl to show.
        """
        row = self._row(run)
        # The thesis draws linear scales: next to a whirl of 130 µm its combinations of 3 µm are invisible.
        threshold = max(VISIBLE_RATIO * float(run.spectrum[row].max()), MIN_AMPLITUDE)
        sizes = {one: self.size(run, one) for one in Component}
        visible = {one: size > threshold for one, (_, size) in sizes.items()}
        parts = [f"{order:.2f}X {size / MICROMETRE:.3g} µm" for one, (order, size) in sizes.items() if visible[one]]
        computed = ", ".join([f"1X {run.first_order[row] / MICROMETRE:.3g} µm", *parts])
        if run.is_growing[row]:
            return Verdict.UNDECIDED, f"{computed}; unstable, growth too slow to show in the turns integrated"
        agrees = all(visible[one] == (one in self.stated) for one in Component)
        return Verdict.REPRODUCED if agrees else Verdict.DIFFERENT, computed

    def size(self, run: RunUp, component: Component) -> tuple[float, float]:
        """Return order and amplitude, m peak, of a component in a run-up."""
        film, row = component.film, self._row(run)
        order, size = run.component(HARMONIC) if film is None else run.whirl(film)
        return float(order[row]), float(size[row])

    def plots(self, run: RunUp, name: str) -> tuple[Plot, Plot]:
        """Return plots of spectrum and trajectory of a run-up."""
        row = self._row(run)
        at = f"at {self.speed:,.0f} rad/s, {name}"
        spectrum = Series("", run.orders, run.spectrum[row] / MICROMETRE)
        x, y = run.orbit[row] / MICROMETRE
        return (
            Plot(f"Spectrum {at}", "Frequency over the shaft's speed [X]", "Amplitude in X [µm peak]", (spectrum,)),
            Plot(f"Trajectory {at}", "X [µm]", "Y [µm]", (Series("", x, y, Style.LINE),), is_square=True),
        )

    def _row(self, run: RunUp) -> int:
        return int(np.argmin(np.abs(run.speeds - self.speed)))
