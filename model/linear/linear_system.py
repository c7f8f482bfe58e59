"""Rotor on linear supports: system matrices in both planes and whirl modes at a speed.

Coordinates are ``U1 = (x, theta_y, ...)``, followed by x of the rings, then ``U2 = (y, -theta_x, ...)``, followed by y
of the rings: ``M U'' + (C + Omega G) U' + K U = F``. If all supports are undamped and isotropic, ``z = U1 + i U2``
halves the problem and makes it symmetric.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals import ComplexArray, FloatArray
from model.errors import ParameterError
from model.rotor.rotor import Rotor
from model.rotor.supports import Support

IntArray = NDArray[np.intp]

OVERDAMPED_TOLERANCE = 1e-9  # relative imaginary part of an eigenvalue below which it is rounding
EQUALITY_TOLERANCE = 1e-9  # relative difference of two eigenvalues below which it is rounding
ROUNDING_TOLERANCE = 1e-11  # rounding of all eigenvalues, relative to the largest


@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """Matrices of a rotor on linear supports.

    Parameters
    ----------
    stations : int
        Number of stations of the rotor, n.
    coordinates : int
        Number of coordinates of one plane, N: 2 n and one for each ring.
    mass, damping, gyroscopic, stiffness : ndarray of float64, shape (2 N, 2 N)
        M, C, G, K in kg, N s/m, kg m² and N/m, and the corresponding units for slopes.
    is_undamped_isotropic : bool
        Whether all supports are undamped and isotropic.
    """

    stations: int
    coordinates: int
    mass: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    stiffness: FloatArray
    is_undamped_isotropic: bool

    @property
    def plane(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Matrices M, J and K of one plane, (N, N) each."""
        n = self.coordinates
        return self.mass[:n, :n], self.gyroscopic[:n, n:], self.stiffness[:n, :n]

    @property
    def is_fully_supported(self) -> bool:
        """Whether the supports leave no rigid-body motion."""
        return bool(np.linalg.matrix_rank(self.stiffness) == 2 * self.coordinates)

    def displacements(self, vectors: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return displacements in X and Y, (..., 2, n), of coordinates, (..., 2 N)."""
        n, last = self.coordinates, 2 * self.stations
        return np.stack((vectors[..., 0:last:2], vectors[..., n : n + last : 2]), axis=-2)


@dataclass(frozen=True, slots=True, eq=False)
class WhirlModes:
    """Modes of the rotating rotor, by rising frequency.

    Parameters
    ----------
    speed : float
        rad/s.
    frequencies : ndarray of float64, shape (n_modes,)
        Damped natural frequencies, rad/s: positive for forward whirl, negative for reverse whirl.
    growth_rates : ndarray of float64, shape (n_modes,)
        1/s; negative if the mode decays.
    shapes : ndarray of complex128, shape (n_modes, 2, n_stations)
        Displacement in X and Y, scaled to a largest semi-axis of 1: ``x(t) = Re[X exp(i |frequency| t)]``.
    forward : ndarray of float64, shape (n_modes, n_stations)
        (forward - reverse) / (forward + reverse) amplitude at each station: 1 forward circle, 0 line, -1 reverse
        circle.
    vectors : ndarray of complex128, shape (n_modes, size)
        Eigenvectors of unit length, in the coordinates used for mode tracking.
    """

    speed: float
    frequencies: FloatArray
    growth_rates: FloatArray
    shapes: ComplexArray
    forward: FloatArray
    vectors: ComplexArray


def linear_system(rotor: Rotor, supports: Sequence[Support]) -> LinearSystem:
    """Return the system of a rotor on supports; ParameterError if a support is at no station."""
    n_dofs = 2 * rotor.stations
    rings = [support for support in supports if support.outer is not None]
    n = n_dofs + len(rings)
    mass, gyroscopic, shaft = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    mass[:n_dofs, :n_dofs] = rotor.mass_matrix()
    gyroscopic[:n_dofs, :n_dofs] = rotor.gyroscopic_matrix()
    shaft[:n_dofs, :n_dofs] = rotor.stiffness_matrix()
    for number, ring in enumerate(rings):
        mass[n_dofs + number, n_dofs + number] = ring.ring_mass
    zero = np.zeros((n, n))
    stiffness = np.block([[shaft, zero], [zero, shaft]])
    damping = np.zeros((2 * n, 2 * n))
    for support in supports:
        if not 1 <= support.station <= rotor.stations:
            raise ParameterError(f"support: station {support.station}, expected 1 to {rotor.stations}")
        between = np.zeros(n)
        between[rotor.displacement(support.station)] = 1
        if support.outer is not None:
            ring_vector = np.eye(n)[n_dofs + rings.index(support)]
            between -= ring_vector
            stiffness += np.kron(support.outer.stiffness, np.outer(ring_vector, ring_vector))
            damping += np.kron(support.outer.damping, np.outer(ring_vector, ring_vector))
        stiffness += np.kron(support.inner.stiffness, np.outer(between, between))
        damping += np.kron(support.inner.damping, np.outer(between, between))
    return LinearSystem(
        stations=rotor.stations,
        coordinates=n,
        mass=np.block([[mass, zero], [zero, mass]]),
        damping=damping,
        gyroscopic=np.block([[zero, gyroscopic], [-gyroscopic, zero]]),
        stiffness=stiffness,
        is_undamped_isotropic=all(support.is_undamped_isotropic for support in supports),
    )


def whirl_modes(system: LinearSystem, speeds: Sequence[float] | FloatArray) -> list[WhirlModes]:
    """Return the whirl modes at each speed, rad/s, without overdamped ones."""
    wanted = np.asarray(speeds, np.float64)
    if wanted.ndim != 1 or not np.isfinite(wanted).all():
        raise ParameterError(f"speeds: {wanted}, rad/s, expected a list of finite values")
    if system.is_undamped_isotropic:
        return _undamped_isotropic_modes(system, wanted)
    return [_general_modes(system, float(speed)) for speed in wanted]


def undamped_isotropic_states(system: LinearSystem, speeds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the modes of a rotor on undamped isotropic supports.

    Parameters
    ----------
    system : LinearSystem
        A system with ``is_undamped_isotropic``.
    speeds : ndarray of float64, shape (n,)
        rad/s.

    Returns
    -------
    frequencies : ndarray of float64, shape (n, 2 N)
        Sorted by absolute value, rad/s, negative for reverse modes; at equal size the reverse mode first, which is the
        order just above standstill.
    states : ndarray of float64, shape (n, 2 N, 2 N)
        Orthonormal state vectors in rows.
    to_displacements : ndarray of float64, shape (2 N, N)
        ``states @ to_displacements`` are displacements and slopes, times the frequency.
    """
    M, J, K = system.plane
    n = system.coordinates
    stiffnesses = np.diag(K)
    # Scale slopes and displacements alike: otherwise the lowest modes lose five digits to rounding.
    scale = np.sqrt(np.where(stiffnesses > 0, stiffnesses, 1.0))
    squares, vectors = np.linalg.eigh(K / np.outer(scale, scale))
    squares[squares < n * np.finfo(np.float64).eps * squares.max()] = 0  # rounding error of rigid-body modes
    root = scale[:, None] * vectors * np.sqrt(squares)  # K = root root^T
    to_unit = np.linalg.inv(np.linalg.cholesky(M))
    # (K + w Omega J - w² M) Z = 0 with a = root^T Z, b = w L^T Z, M = L L^T, is one symmetric eigenproblem:
    matrix = np.zeros((speeds.size, 2 * n, 2 * n))
    matrix[:, :n, n:] = root.T @ to_unit.T
    matrix[:, n:, :n] = to_unit @ root
    matrix[:, n:, n:] = speeds[:, None, None] * (to_unit @ J @ to_unit.T)
    frequencies, columns = np.linalg.eigh(matrix)
    sizes = np.abs(frequencies)
    frequencies[sizes <= ROUNDING_TOLERANCE * sizes.max(axis=1, keepdims=True)] = 0.0  # rigid-body modes
    states = np.array(np.swapaxes(columns, 1, 2))
    slope = np.zeros((2 * n, 2 * n))  # derivative of the matrix with respect to speed
    slope[n:, n:] = to_unit @ J @ to_unit.T
    for signed, rows in zip(frequencies, states, strict=True):
        _separate_equal(signed, rows, slope)
        order = _by_size(signed, np.abs(signed), np.sign(signed))
        signed[:], rows[:] = signed[order], rows[order]
    return frequencies, states, np.concatenate((np.zeros((n, n)), to_unit))


def _groups(values: FloatArray | ComplexArray) -> list[IntArray]:
    """Return index groups of neighbouring values that are equal within rounding."""
    sizes = np.abs(values)
    apart = np.abs(np.diff(values)) > EQUALITY_TOLERANCE * sizes[1:] + ROUNDING_TOLERANCE * sizes.max(initial=0.0)
    return np.split(np.arange(values.size), np.flatnonzero(apart) + 1)


def _by_size(values: FloatArray, sizes: FloatArray, sense: FloatArray) -> IntArray:
    """Return the sort order by size; equal sizes are sorted by direction, reverse first, then by value."""
    order = np.argsort(sizes, kind="stable")
    rank = np.empty(sizes.size, np.intp)
    for number, group in enumerate(_groups(sizes[order])):
        rank[order[group]] = number
    return np.lexsort((values, sense, rank))


def _separate_equal(
    values: FloatArray | ComplexArray, rows: FloatArray | ComplexArray, form: FloatArray | ComplexArray
) -> None:
    """Rotate eigenvectors of equal values in place so that a Hermitian form is diagonal and rising.

    Any combination of them is an eigenvector too; which ones LAPACK returns depends on the processor.
    """
    for group in _groups(values):
        if group.size > 1:
            basis = rows[group]
            rows[group] = np.linalg.eigh(basis.conj() @ form @ basis.T)[1].T @ basis


def _undamped_isotropic_modes(system: LinearSystem, speeds: FloatArray) -> list[WhirlModes]:
    found = []
    frequencies, states, to_displacements = undamped_isotropic_states(system, speeds)
    for speed, signed, rows in zip(speeds, frequencies, states, strict=True):
        displacements = rows @ to_displacements
        sense = np.where(signed < 0, -1.0, 1.0)
        both_planes = np.concatenate((displacements, -1j * sense[:, None] * displacements), axis=1)
        found.append(_modes(system, float(speed), signed, np.zeros(signed.size), both_planes, rows + 0j))
    return found


def _general_modes(system: LinearSystem, speed: float) -> WhirlModes:
    size = 2 * system.coordinates
    to_unit = np.linalg.inv(np.linalg.cholesky(system.mass))
    K = to_unit @ system.stiffness @ to_unit.T
    C = to_unit @ (system.damping + speed * system.gyroscopic) @ to_unit.T
    state = np.block([[np.zeros((size, size)), np.eye(size)], [-K, -C]])
    values, vectors = np.linalg.eig(state)
    is_oscillating = values.imag > OVERDAMPED_TOLERANCE * np.maximum(np.abs(values), 1e-300)
    values, unit = values[is_oscillating], vectors[:size, is_oscillating].T
    order = _by_size(values.real, values.imag, np.zeros(values.size))
    values, unit = values[order], unit[order] / np.linalg.norm(unit[order], axis=1, keepdims=True)
    for group in _groups(values):
        if group.size > 1:
            unit[group] = np.linalg.qr(unit[group].T)[0].T
    _separate_equal(values, unit, _forward_power(system, to_unit))
    displacements = unit @ to_unit
    signed = np.where(
        forward_share(np.asarray(system.displacements(displacements))) < -EQUALITY_TOLERANCE, -values.imag, values.imag
    )
    order = _by_size(values.real, values.imag, np.sign(signed))
    return _modes(system, speed, signed[order], values.real[order], displacements[order], unit[order])


def forward_share(displacements: NDArray[np.generic]) -> FloatArray:
    """Return (forward - reverse) / total power of displacements (..., 2, n): -1 to 1, about 0 for lines."""
    x, y = np.asarray(displacements[..., 0, :], np.complex128), np.asarray(displacements[..., 1, :], np.complex128)
    with_shaft, against = (np.abs(x + 1j * y) ** 2).sum(axis=-1), (np.abs(x - 1j * y) ** 2).sum(axis=-1)
    total = with_shaft + against
    return np.asarray((with_shaft - against) / np.where(total > 0, total, 1.0), np.float64)


def _forward_power(system: LinearSystem, to_displacements: FloatArray) -> ComplexArray:
    """Return the Hermitian form of forward minus reverse power of ``vectors @ to_displacements``, (2 N, 2 N)."""
    x, y = np.moveaxis(np.asarray(system.displacements(to_displacements)), -2, 0)
    return np.asarray(0.5j * (x @ y.T - y @ x.T), np.complex128)


def _modes(
    system: LinearSystem,
    speed: float,
    frequencies: FloatArray,
    growth_rates: FloatArray,
    displacements: ComplexArray,
    vectors: ComplexArray,
) -> WhirlModes:
    shapes = np.asarray(system.displacements(displacements), np.complex128)
    x, y = shapes[:, 0], shapes[:, 1]
    # x(t) + i y(t) = (X + i Y)/2 exp(i w t) + (conj X + i conj Y)/2 exp(-i w t)
    with_shaft, against = np.abs(x + 1j * y) / 2, np.abs(x - 1j * y) / 2
    largest = (with_shaft + against).max(axis=1)
    return WhirlModes(
        speed=speed,
        frequencies=frequencies,
        growth_rates=growth_rates,
        shapes=shapes / np.where(largest > 0, largest, 1.0)[:, None, None],
        forward=(with_shaft - against) / np.where(with_shaft + against > 0, with_shaft + against, 1.0),
        vectors=vectors,
    )
