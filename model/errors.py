"""Errors of the model that a caller may handle.

    ModelError
    ├── EquilibriumError    no position was found at which the oil film carries its load
    ├── WallContactError    a journal or ring reached the wall of its film
    └── ParameterError      a size, station or speed that the rotor or its model does not allow; also a ValueError
        └── TableError      faults of a rotor file (`model.rotor.tables`)

Misuse that no rotor file and no operator can cause (wrong shapes, calls out of order) is a ``ValueError``.
"""


class ModelError(Exception):
    """The model has no solution for these parameters."""


class ParameterError(ModelError, ValueError):
    """A size, station or speed is not allowed; the message names it, its value and what was expected."""


class EquilibriumError(ModelError):
    """A film has no equilibrium position within its clearance, or its iteration did not converge."""


class WallContactError(ModelError):
    """The motion reached the wall: the eccentricity ratio of a film is 1."""
