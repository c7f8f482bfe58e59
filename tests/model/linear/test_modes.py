import numpy as np
import pytest

from model.linear.modes import free_modes
from model.rotor.gj90c import gj90c_rotor
from tests.model.linear.springs import natural_frequencies, supported_stiffness


def test_free_modes_are_orthonormal_in_mass_and_diagonal_in_stiffness() -> None:
    rotor = gj90c_rotor()
    modes = free_modes(rotor)
    assert modes.shapes.T @ rotor.mass_matrix() @ modes.shapes == pytest.approx(np.eye(12), abs=1e-9)
    squares = np.diag(modes.shapes.T @ rotor.stiffness_matrix() @ modes.shapes)
    assert squares[2:] == pytest.approx(modes.frequencies[2:] ** 2, rel=1e-6)
    assert list(modes.frequencies[:2]) == [0.0, 0.0]


def test_frequencies_at_standstill_are_those_of_the_supported_rotor() -> None:
    rotor = gj90c_rotor()
    frequencies = natural_frequencies(rotor, 1e7, 0.0)
    M, K = rotor.mass_matrix(), supported_stiffness(rotor, 1e7)
    own = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real))
    assert frequencies[12:16] == pytest.approx(own[:4], rel=1e-6)
    assert frequencies[11:7:-1] == pytest.approx(-own[:4], rel=1e-6)


def test_frequencies_of_the_rotating_rotor_fulfil_the_characteristic_equation() -> None:
    rotor, speed = gj90c_rotor(), 4000.0
    K, M, J = supported_stiffness(rotor, 1e7), rotor.mass_matrix(), rotor.gyroscopic_matrix()
    for frequency in natural_frequencies(rotor, 1e7, speed)[9:15]:
        dynamic = K + frequency * speed * J - frequency**2 * M
        singular = np.linalg.svd(dynamic, compute_uv=False)
        assert singular[-1] / singular[0] < 1e-12


@pytest.mark.parametrize("count", [1, 13])
def test_invalid_number_of_modes_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"count: {count} modes, expected 2 to 12"):
        free_modes(gj90c_rotor(), count)
