"""What a caller of the model may have to handle.

    ModelError
    ├── EquilibriumError    no place was found at which the oil film carries its load
    └── WallContactError    a journal or ring came so close to the wall that the oil film's equations end

Misuse (sizes, stations, speeds that make no sense) is a ``ValueError``.
"""


class ModelError(Exception):
    """The model cannot answer."""


class EquilibriumError(ModelError):
    """No place short of the wall was found at which a film carries its load, or a film's solution did not settle."""


class WallContactError(ModelError):
    """The motion reached the wall: a film's eccentricity ratio came to 1."""
