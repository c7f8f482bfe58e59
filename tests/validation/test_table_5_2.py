"""Table 5.2 of the thesis: natural frequencies of the free rotor."""

import numpy as np
import pytest

from model.linear.modes import free_modes
from model.rotor.gj90c import gj90c_rotor

TABLE_5_3 = (1730, 5045, 11975, 18193)  # Hz


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_free_rotor_has_the_bending_frequencies_of_table_5_2(order: int) -> None:
    frequencies = free_modes(gj90c_rotor()).frequencies / (2 * np.pi)
    assert frequencies[1 + order] == pytest.approx(TABLE_5_3[order - 1], abs=0.5)
