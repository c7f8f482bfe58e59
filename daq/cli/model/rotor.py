"""The parameters that a study is made for, and the model's errors in the words of the command line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daq.config.load import load_rig
from daq.config.rotor import rotor_parameters
from daq.errors import RigError, UsageError
from model.errors import ModelError
from model.gj90c import gj90c
from model.parameters import ModelParameters


def parameters_of(config: str | None) -> ModelParameters:
    """Return the parameters that a rig file asks for; the thesis's rotor without one."""
    return gj90c() if config is None else rotor_parameters(load_rig(Path(config)))


@contextmanager
def model_errors() -> Iterator[None]:
    """Turn what the model refuses or cannot answer into one message of the command."""
    try:
        yield
    except ValueError as error:
        raise UsageError(str(error)) from error
    except ModelError as error:
        raise RigError(str(error)) from error
