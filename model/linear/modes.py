"""Natural frequencies and mode shapes of the free rotor, critical speeds and critical speed map (thesis, chapter 5)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, eigh

from analysis.signals import ComplexArray, FloatArray
from model.errors import ParameterError
from model.linear.linear_system import EQUALITY_TOLERANCE, LinearSystem, forward_share, linear_system
from model.rotor.rotor import Rotor, require_positive
from model.rotor.supports import Support, SupportCoefficients


@dataclass(frozen=True, slots=True, eq=False)
class FreeModes:
    """Modes of the unsupported rotor at standstill, normalised to ``shapes.T @ M @ shapes = 1``.

    Parameters
    ----------
    frequencies : ndarray of float64, shape (n_modes,)
        Rising, rad/s; the first two are the rigid-body modes at 0.
    shapes : ndarray of float64, shape (n_dofs, n_modes)
        Displacements, kg^-1/2, and slopes, kg^-1/2 / m, of the stations.
    """

    frequencies: FloatArray
    shapes: FloatArray


@dataclass(frozen=True, slots=True)
class CriticalSpeeds:
    """Critical speeds, rad/s, rising.

    Parameters
    ----------
    forward, reverse : tuple of float
        Of forward and of reverse whirl modes.
    """

    forward: tuple[float, ...]
    reverse: tuple[float, ...]


def free_modes(rotor: Rotor, count: int | None = None) -> FreeModes:
    """Return the lowest modes of the free rotor.

    Parameters
    ----------
    rotor : Rotor
        With n stations.
    count : int, optional
        Number of modes, 2 to 2 n; default all.

    Returns
    -------
    FreeModes
        Two rigid-body modes, then bending modes.
    """
    n_dofs = 2 * rotor.stations
    count = n_dofs if count is None else count
    if not 2 <= count <= n_dofs:
        raise ParameterError(f"count: {count} modes, expected 2 to {n_dofs}")
    squares, shapes = eigh(rotor.stiffness_matrix(), rotor.mass_matrix())
    squares[:2] = 0.0  # two rigid-body modes: eigh leaves rounding errors
    shapes[:, :2] = _rigid_shapes(rotor)
    return FreeModes(np.sqrt(squares[:count]), shapes[:, :count])


def _rigid_shapes(rotor: Rotor) -> FloatArray:
    mass, translation, rotation = rotor.mass_matrix(), rotor.translation, np.ones(2 * rotor.stations)
    rotation[0::2] = rotor.positions
    centre = (translation @ mass @ rotation) / (translation @ mass @ translation)
    shapes = np.column_stack((translation, rotation - centre * translation))
    return np.asarray(shapes / np.sqrt(np.diag(shapes.T @ mass @ shapes)), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class CriticalSpeedMap:
    """Undamped critical speeds over the stiffness of the supports.

    Parameters
    ----------
    stiffnesses : ndarray of float64, shape (n,)
        Of each support, N/m.
    forward, reverse : ndarray of float64, shape (n_critical, n)
        rad/s, rising along the first axis.
    """

    stiffnesses: FloatArray
    forward: FloatArray
    reverse: FloatArray


def critical_speeds(system: LinearSystem, highest: float) -> CriticalSpeeds:
    """Return the undamped critical speeds of a rotor on supports, without a search over speed.

    Parameters
    ----------
    system : LinearSystem
        Damping and the antisymmetric part of the stiffness are ignored.
    highest : float
        Largest speed returned, rad/s.

    Returns
    -------
    CriticalSpeeds
        On anisotropic supports each is assigned to the whirl direction of the larger part of its motion.

    Raises
    ------
    ParameterError
        If the supports leave the rotor free to move.
    """
    require_positive("highest", highest, "rad/s")
    if system.is_undamped_isotropic:
        M, J, K = system.plane
        forward, reverse = _speeds(M - J, K)[0], _speeds(M + J, K)[0]
    else:
        stiffness = (system.stiffness + system.stiffness.T) / 2
        # U = q exp(i Omega t): det(K - Omega² (M - i G)) = 0
        speeds, vectors = _speeds(system.mass - 1j * system.gyroscopic, stiffness)
        is_reverse = forward_share(np.asarray(system.displacements(vectors.T))) < -EQUALITY_TOLERANCE
        forward, reverse = speeds[~is_reverse], speeds[is_reverse]
    return CriticalSpeeds(
        forward=tuple(float(speed) for speed in forward if speed <= highest),
        reverse=tuple(float(speed) for speed in reverse if speed <= highest),
    )


def critical_speed_map(
    rotor: Rotor, stiffnesses: Sequence[float] | FloatArray, stations: Sequence[int] | None = None
) -> CriticalSpeedMap:
    """Return the undamped critical speeds on equal springs, for each stiffness.

    Parameters
    ----------
    rotor : Rotor
        The rotor.
    stiffnesses : sequence of float
        N/m, above 0.
    stations : sequence of int, optional
        Stations of the springs; default the journals.

    Returns
    -------
    CriticalSpeedMap
        All critical speeds: a discretised shaft has a finite number.
    """
    wanted = np.asarray(stiffnesses, np.float64)
    if wanted.ndim != 1 or wanted.size == 0:
        raise ParameterError(f"stiffnesses: {wanted}, N/m, expected a list of one or more")
    places = rotor.journal_stations if stations is None else stations
    forward, reverse = [], []
    for stiffness in wanted:
        springs = [Support(station, SupportCoefficients.isotropic(float(stiffness))) for station in places]
        M, J, K = linear_system(rotor, springs).plane
        forward.append(_speeds(M - J, K)[0])
        reverse.append(_speeds(M + J, K)[0])
    return CriticalSpeedMap(wanted, np.stack(forward, axis=1), np.stack(reverse, axis=1))


def _speeds(inertia: FloatArray | ComplexArray, stiffness: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Return the rising speeds at which det(K - Omega² inertia) = 0, and their shapes as columns."""
    try:
        values, columns = eigh(inertia, stiffness)
    except LinAlgError as error:
        raise ParameterError(
            "supports: they leave the rotor free to move, expected a stiffness that holds it"
        ) from error
    inverse_squares, vectors = np.asarray(values, np.float64), np.asarray(columns, np.complex128)
    real = inverse_squares > 0  # a negative effective inertia, as of a thin disc, has no critical speed
    return 1 / np.sqrt(inverse_squares[real][::-1]), vectors[:, real][:, ::-1]
