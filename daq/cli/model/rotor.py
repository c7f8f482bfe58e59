"""The parameters that a study is made for, and the model's errors in the words of the command line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daq.config.load import load_rig
from daq.config.rotor import rotor_parameters
from daq.config.rotor_file import read_rotor, rotor_of
from daq.errors import ConfigError, RigError, UsageError
from model.errors import ModelError
from model.rotor.gj90c import gj90c
from model.rotor.parameters import ModelParameters
from model.rotor.tables import DocumentError


def parameters_of(config: str | None) -> ModelParameters:
    """Return the parameters that a rig file asks for, or a rotor's own file; the thesis's rotor without one.

    Raises
    ------
    ConfigError
        Where the file cannot be read or is wrong.
    """
    if config is None:
        return gj90c()
    file = Path(config)
    tables = read_rotor(file)
    if "station" not in tables:  # no rig has stations, no rotor is without
        return rotor_parameters(load_rig(file))
    try:
        return rotor_of(tables)
    except DocumentError as error:
        raise ConfigError(config, list(error.faults)) from error


@contextmanager
def model_errors() -> Iterator[None]:
    """Turn what the model refuses or cannot answer into one message of the command."""
    try:
        yield
    except ValueError as error:
        raise UsageError(str(error)) from error
    except ModelError as error:
        raise RigError(str(error)) from error
