"""The form that all documents share."""

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """A JSON document: its fields are all there, always, and no other; what is not known is null."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
