"""Raimondi and Boyd's table of finite journal bearings (Trans. ASLE 1, 1958, part III: with cavitation).

Their film starts with zero pressure at the thickest position, so a groove at zero pressure is placed there. Tolerance:
the table has three digits from finite differences on coarse grids; 1.5 % of the Sommerfeld number and 0.6 degrees of
the attitude cover all rows. The infinitely long rows are compared with the closed form, 0.8 % and 0.4 degrees.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from model.films.film import Film
from model.films.finite_film import Grid, Groove, solve_reynolds
from model.films.long_film import ruptured_film

# length over diameter: eccentricity ratio: Sommerfeld number mu N L D / W (R / C)², attitude in degrees
FINITE = {
    1.0: {0.1: (1.33, 79.50), 0.2: (0.631, 74.02), 0.4: (0.264, 63.10), 0.6: (0.121, 50.58), 0.8: (0.0446, 36.24)},
    0.5: {0.1: (4.31, 81.62), 0.2: (2.03, 74.94), 0.4: (0.779, 61.45), 0.6: (0.319, 48.14), 0.8: (0.0923, 33.31)},
    0.25: {0.1: (16.2, 82.31), 0.2: (7.57, 75.18), 0.4: (2.83, 60.86), 0.6: (1.07, 46.72), 0.8: (0.261, 31.04)},
}
LONG = {0.1: (0.240, 69.10), 0.2: (0.123, 67.26), 0.4: (0.0626, 61.94), 0.6: (0.0389, 54.31), 0.8: (0.021, 42.22)}
SPEED = 1000.0


@pytest.mark.parametrize("slenderness", FINITE)
@pytest.mark.parametrize("eccentricity", [0.1, 0.2, 0.4, 0.6, 0.8])
def test_finite_film_has_the_tabulated_load_and_attitude(slenderness: float, eccentricity: float) -> None:
    film = Film(radius=5e-3, length=slenderness * 10e-3, clearance=20e-6, viscosity=0.012)
    position = eccentricity * film.clearance + 0j
    force = solve_reynolds(film, position, 0j, SPEED, Grid(180, 12), groove=Groove(math.pi, 0.0)).force
    unit = film.viscosity * SPEED / (2 * math.pi) * film.length * 2 * film.radius * (film.radius / film.clearance) ** 2
    number, attitude = FINITE[slenderness][eccentricity]
    assert unit / abs(force) == pytest.approx(number, rel=0.015)
    assert np.degrees(math.atan2(force.imag, -force.real)) == pytest.approx(attitude, abs=0.6)


@pytest.mark.parametrize("eccentricity", LONG)
def test_long_film_from_the_thickest_position_has_the_tabulated_load_and_attitude(eccentricity: float) -> None:
    extent = brentq(lambda extent: ruptured_film(eccentricity, extent).start, 0.3, 1.0)
    film = ruptured_film(eccentricity, float(extent))
    number, attitude = LONG[eccentricity]
    assert 1 / (6 * math.pi * film.load) == pytest.approx(number, rel=0.008)
    assert np.degrees(film.attitude) == pytest.approx(attitude, abs=0.4)
