"""Content of files as a part of a document, taken as strictly as the files are: a text is no number."""

import json
from collections.abc import Callable

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails


def as_a_file(model: type[BaseModel]) -> Callable[[object], object]:
    """Return what takes a value as a file of this model is read; ValueError tells every fault."""

    def taken(value: object) -> object:
        try:
            return model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise ValueError("; ".join(map(_said, error.errors()))) from error

    return taken


def _said(fault: ErrorDetails) -> str:
    return f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].removeprefix('Value error, ')}"
