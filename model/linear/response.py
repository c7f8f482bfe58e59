"""Response of a rotor on linear supports: to imbalance, and static to weight and loads."""

from collections.abc import Sequence

import numpy as np

from analysis.signals import ComplexArray, FloatArray
from model.errors import ParameterError
from model.linear.linear_system import LinearSystem
from model.rotor.parameters import Imbalance
from model.rotor.supports import StaticLoad


def imbalance_response(
    system: LinearSystem, imbalances: Sequence[Imbalance], speeds: Sequence[float] | FloatArray
) -> ComplexArray:
    """Return the linear imbalance response.

    Parameters
    ----------
    system : LinearSystem
        Rotor on supports.
    imbalances : sequence of Imbalance
        Imbalances at any stations.
    speeds : sequence of float
        rad/s.

    Returns
    -------
    ndarray of complex128, shape (n_speeds, 2, n_stations)
        1X in X and Y at every station, m peak, x(t) = Re[X exp(i theta)].

    Raises
    ------
    ParameterError
        If an imbalance is at no station, or a speed is an undamped critical speed.
    """
    n = system.coordinates
    excitation = np.zeros(2 * n, np.complex128)
    for one in imbalances:
        heavy_spot = one.magnitude * np.exp(1j * one.phase)
        dof = _displacement_dof(system, one.station, "imbalance")
        excitation[dof] += heavy_spot
        excitation[n + dof] += -1j * heavy_spot  # lags by 90°
    speeds = np.asarray(speeds, np.float64)
    squares = speeds[:, None, None] ** 2
    # U = q exp(i Omega t): (K - Omega² M + i Omega (C + Omega G)) q = Omega² u
    dynamic = system.stiffness - squares * (system.mass - 1j * system.gyroscopic)
    dynamic = dynamic + 1j * speeds[:, None, None] * system.damping
    try:
        vectors = np.linalg.solve(dynamic, (squares[:, 0] * excitation)[..., None])[..., 0]
    except np.linalg.LinAlgError as error:
        raise ParameterError("speeds: one is a critical speed without damping, expected others, rad/s") from error
    return np.asarray(system.displacements(vectors), np.complex128)


def static_deflection(system: LinearSystem, loads: Sequence[StaticLoad] = (), gravity: float = 0.0) -> FloatArray:
    """Return the static deflection of the rotor under weight and loads.

    Parameters
    ----------
    system : LinearSystem
        Rotor on supports.
    loads : sequence of StaticLoad
        Forces at stations.
    gravity : float
        Towards -Y, m/s².

    Returns
    -------
    ndarray of float64, shape (2, n_stations)
        Displacement in X and Y, m.

    Raises
    ------
    ParameterError
        If a load is at no station or the supports leave the rotor free to move.
    """
    n = system.coordinates
    force = np.zeros(2 * n)
    downwards = np.ones(n)
    downwards[1 : 2 * system.stations : 2] = 0  # slopes
    force[n:] -= gravity * (system.plane[0] @ downwards)
    for load in loads:
        dof = _displacement_dof(system, load.station, "load")
        force[dof] += load.x
        force[n + dof] += load.y
    if not system.is_fully_supported:
        raise ParameterError("supports: they leave the rotor free to move, expected a stiffness that holds it")
    return np.asarray(system.displacements(np.linalg.solve(system.stiffness, force)), np.float64)


def _displacement_dof(system: LinearSystem, station: int, name: str) -> int:
    if not 1 <= station <= system.stations:
        raise ParameterError(f"{name}: station {station}, expected 1 to {system.stations}")
    return 2 * (station - 1)
