"""Errors of the model that a caller may handle.

::

    ModelError
    ├── NoSolutionError         no motion or position within the clearances was found
    │   ├── EquilibriumError    no position was found at which the oil film carries its load
    │   └── WallContactError    a journal or ring reached the wall of its film
    └── ParameterError          a size, station or speed that the rotor or its model does not allow; also a ValueError
        └── TableError          faults of a rotor file (`model.rotor.tables`)

Misuse that no rotor file and no operator can cause (wrong shapes, calls out of order) is a ``ValueError``.
"""


class ModelError(Exception):
    """The model has no result for these parameters."""


class NoSolutionError(ModelError):
    """No motion or position within the clearances was found."""


class ParameterError(ModelError, ValueError):
    """A size, station or speed is not allowed; the message names it, its value and what was expected."""


class EquilibriumError(NoSolutionError):
    """A film has no equilibrium position within its clearance, or its iteration did not converge."""


class WallContactError(NoSolutionError):
    """The motion reached the wall: the eccentricity ratio of a film is 1."""
