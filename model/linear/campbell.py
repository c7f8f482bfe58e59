"""Campbell diagram: natural frequencies over speed, each branch tracked by its mode shape."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from analysis.signals import ComplexArray, FloatArray
from model.errors import ParameterError
from model.linear.linear_system import LinearSystem, undamped_isotropic_states, whirl_modes

IntArray = NDArray[np.intp]

MIN_MAC = 0.1  # modal assurance criterion between neighbouring speeds of one branch


@dataclass(frozen=True, slots=True, eq=False)
class Campbell:
    """Branches of natural frequencies over speed.

    Parameters
    ----------
    speeds : ndarray of float64, shape (n_speeds,)
        rad/s.
    frequencies : ndarray of float64, shape (n_branches, n_speeds)
        rad/s, sorted at the first speed: positive forward, negative reverse; NaN where a branch has ended, for example
        because it becomes overdamped.
    growth_rates : ndarray of float64, shape (n_branches, n_speeds)
        1/s.
    """

    speeds: FloatArray
    frequencies: FloatArray
    growth_rates: FloatArray


def campbell(system: LinearSystem, speeds: Sequence[float] | FloatArray, branches: int | None = None) -> Campbell:
    """Return the Campbell diagram.

    Parameters
    ----------
    system : LinearSystem
        Rotor on supports.
    speeds : sequence of float
        Rising, rad/s. In a veering region two branches exchange their shapes. With steps much shorter than the region a
        branch veers; with longer steps it keeps its shape and crosses the other.
    branches : int, optional
        Number of branches, from the lowest; default all.

    Returns
    -------
    Campbell
        Branches matched from speed to speed by the largest total modal assurance criterion.

    Raises
    ------
    ParameterError
        If there are no speeds, they do not rise, or there are fewer branches.
    """
    wanted = np.asarray(speeds, np.float64)
    if wanted.size == 0 or np.any(np.diff(wanted) <= 0):
        raise ParameterError(f"speeds: {wanted}, rad/s, expected one or more, rising")
    frequencies, growth_rates, vectors = _spectra(system, wanted)
    maximum = frequencies[0].size
    count = maximum if branches is None else branches
    if not 1 <= count <= maximum:
        raise ParameterError(f"branches: {count}, expected 1 to {maximum}")
    tracked = np.full((2, count, wanted.size), np.nan)
    here: IntArray = np.arange(count)
    alive: IntArray = np.arange(count)
    tracked[:, :, 0] = frequencies[0][:count], growth_rates[0][:count]
    for step in range(1, wanted.size):
        continued, here = _match(vectors[step - 1][here], vectors[step])
        alive = alive[continued]
        tracked[0, alive, step] = frequencies[step][here]
        tracked[1, alive, step] = growth_rates[step][here]
    return Campbell(wanted, tracked[0], tracked[1])


def _spectra(
    system: LinearSystem, speeds: FloatArray
) -> tuple[Sequence[FloatArray], Sequence[FloatArray], Sequence[FloatArray | ComplexArray]]:
    """Return frequencies, growth rates and eigenvectors at each speed."""
    if system.is_undamped_isotropic and np.isfinite(speeds).all():
        frequencies, states, _ = undamped_isotropic_states(system, speeds)
        return list(frequencies), list(np.zeros_like(frequencies)), list(states)
    modes = whirl_modes(system, speeds)
    return (
        [one.frequencies for one in modes],
        [one.growth_rates for one in modes],
        [one.vectors for one in modes],
    )


def _match(last: FloatArray | ComplexArray, following: FloatArray | ComplexArray) -> tuple[IntArray, IntArray]:
    """Return the indices of the modes that continue, and those of the modes they continue as."""
    alike = np.abs(last.conj() @ following.T) ** 2
    best = np.argmax(alike, axis=1)
    if np.unique(best).size == best.size and np.all(alike[np.arange(best.size), best] > MIN_MAC):
        return np.arange(best.size), best  # nearly always
    rows, columns = linear_sum_assignment(-alike)
    good = alike[rows, columns] > MIN_MAC
    return np.asarray(rows[good], np.intp), np.asarray(columns[good], np.intp)
