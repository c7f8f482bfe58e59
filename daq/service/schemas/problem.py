"""What goes wrong, told as RFC 9457 tells it."""

from typing import Any

from pydantic import Field

from daq.schemas.document import Document


class Fault(Document):
    """One parameter that is wrong."""

    parameter: str = Field(description="Where it stands: query or path, and its name", examples=["query.limit"])
    detail: str = Field(
        description="What was given and what was expected",
        examples=["'0': expected a number greater than or equal to 1"],
    )


class ProblemDocument(Document):
    """A request that could not be answered (RFC 9457, application/problem+json)."""

    type: str = Field(
        description="Address of the problem's explanation; names the kind of problem for programs",
        examples=["/docs#run-not-found"],
    )
    title: str = Field(description="The kind of problem in words", examples=["There is no such run"])
    status: int = Field(description="HTTP status of the answer", examples=[404])
    detail: str = Field(description="This case", examples=["no run '2026-11-24T09-12-07-gj90c' in this data folder"])
    instance: str = Field(description="What was asked for", examples=["/api/v1/runs/2026-11-24T09-12-07-gj90c"])
    faults: tuple[Fault, ...] = Field(
        description="Every parameter that is wrong; empty where it is not about parameters", examples=[[]]
    )
    job: dict[str, Any] | None = Field(
        description="What to POST to /api/v1/jobs for the same without a time limit; null where no job does it",
        examples=[None],
    )
