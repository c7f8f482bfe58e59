"""The two oil films of a floating-ring bearing in series, with the short-bearing force of a film model."""

import cmath
import math
from dataclasses import dataclass

from analysis.signals.units import MICROMETRE
from model.errors import ParameterError
from model.films.film_kernels import FORCE_LAWS, MIN_WALL_MARGIN, film_force
from model.films.short_film import CaponeForm, capone_forces, require_capone
from model.rotor.parameters import FilmModel, FloatingRing
from model.rotor.rotor import require_positive


@dataclass(frozen=True, slots=True)
class Film:
    """One cylindrical oil film.

    Parameters
    ----------
    radius : float
        Of the inner body, m.
    length : float
        m.
    clearance : float
        Radial, m.
    viscosity : float
        Pa s.
    model : FilmModel
        Force law of the short film.

    Raises
    ------
    ParameterError
        If a value is not positive.
    """

    radius: float
    length: float
    clearance: float
    viscosity: float
    model: FilmModel = FilmModel.CAPONE

    def __post_init__(self) -> None:
        for name, unit in (("radius", "m"), ("length", "m"), ("clearance", "m"), ("viscosity", "Pa s")):
            require_positive(name, getattr(self, name), unit)

    @property
    def factor(self) -> float:
        """Force factor mu R L³ / (4 C²), N s: the scale of the force at unit surface speed."""
        return self.viscosity * self.radius * self.length**3 / (4 * self.clearance**2)

    def force(
        self, position: complex, velocity: complex, surface_speed: float, form: CaponeForm = CaponeForm.EXACT
    ) -> complex:
        """Return the force on the inner body, N.

        Parameters
        ----------
        position : complex
            Of the inner body relative to the outer one, X + i Y, m.
        velocity : complex
            Of the inner body relative to the outer one, m/s.
        surface_speed : float
            Sum of the angular speeds of both surfaces, rad/s.
        form : CaponeForm, optional
            The exact force, or, for Capone's model, the form printed in the thesis.

        Returns
        -------
        complex
            X + i Y, N; for Capone's model thesis eq. (4.38), with F corrected unless ``form`` is the printed one.

        Raises
        ------
        ParameterError
            If the position is at or beyond the wall, velocity or speed are not finite, or the model has no such form.
        """
        eccentricity = abs(position) / self.clearance
        if not 1 - eccentricity**2 >= MIN_WALL_MARGIN:
            raise ParameterError(
                f"position: {abs(position) / MICROMETRE:.3f} µm from the centre, expected less than the clearance of "
                f"{self.clearance / MICROMETRE:g} µm (eccentricity ratio {eccentricity:.5f})"
            )
        if not (cmath.isfinite(velocity) and math.isfinite(surface_speed)):
            raise ParameterError(
                f"velocity, surface_speed: {velocity} m/s, {surface_speed} rad/s, expected finite values"
            )
        if form is CaponeForm.AS_PRINTED:
            require_capone(self.model)
            moving = velocity / self.clearance
            return complex(self.factor * capone_forces(position / self.clearance, moving, float(surface_speed), form))
        law = FORCE_LAWS[self.model]
        return film_force(law, complex(position), complex(velocity), self.clearance, float(surface_speed), self.factor)


@dataclass(frozen=True, slots=True)
class FilmPair:
    """The two films of a floating ring.

    Parameters
    ----------
    inner, outer : Film
        Journal in ring and ring in housing.
    inner_speed, outer_speed : float
        Sum of the surface speeds of each film over the shaft speed.
    """

    inner: Film
    outer: Film
    inner_speed: float
    outer_speed: float


def bearing_films(bearing: FloatingRing) -> FilmPair:
    """Return the films of a floating-ring bearing, with the ring speed of eq. (3.25)."""
    ratio, viscosity, model = bearing.ring_speed_ratio, bearing.viscosity, bearing.film_model
    return FilmPair(
        inner=Film(bearing.journal_radius, bearing.length, bearing.inner_clearance, viscosity, model),
        outer=Film(bearing.ring_outer_radius, bearing.length, bearing.outer_clearance, viscosity, model),
        inner_speed=1 + ratio * bearing.ring_inner_radius / bearing.journal_radius,
        outer_speed=ratio,
    )
