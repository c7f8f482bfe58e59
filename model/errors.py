"""Errors of the model that a caller may handle.

    ModelError
    ├── EquilibriumError    no position was found at which the oil film carries its load
    └── WallContactError    a journal or ring reached the wall of its film

Misuse (invalid sizes, stations or speeds) is a ``ValueError``.
"""


class ModelError(Exception):
    """The model has no solution for these parameters."""


class EquilibriumError(ModelError):
    """A film has no equilibrium position within its clearance, or its iteration did not converge."""


class WallContactError(ModelError):
    """The motion reached the wall: the eccentricity ratio of a film is 1."""
