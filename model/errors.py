"""What a caller of the model may have to handle.

    ModelError
    └── WallContactError    a journal or ring came so close to the wall that the oil film's equations end

Misuse (sizes, stations, speeds that make no sense) is a ``ValueError``.
"""


class ModelError(Exception):
    """The model cannot answer."""


class WallContactError(ModelError):
    """The motion reached the wall: a film's eccentricity ratio came to 1."""
