"""How the tacho's counter and its waveform compare, as a document."""

from pydantic import Field

from analysis.snapshot import CounterReport, CounterState
from daq.service.documents.agreement import Count
from daq.service.documents.document import Document
from daq.service.documents.units import finite


class CounterDocument(Document):
    """The tacho's counter against its waveform since the run began."""

    state: CounterState = Field(description="The verdict", examples=["agrees"])
    compared: Count = Field(description="Edges that both have", examples=[40_180])
    missing: Count = Field(description="Edges of the waveform that the counter has not stamped", examples=[0])
    extra: Count = Field(description="Stamps where the waveform has no edge", examples=[0])
    apart: Count = Field(description="Edges that lie further apart than the rig says they may", examples=[0])
    mean_us: float | None = Field(description="How much later the counter has them, in the mean, µs", examples=[0.02])
    largest_us: float | None = Field(description="Largest distance of the two, µs", examples=[0.41])
    told: str = Field(description="What an operator should know; empty where they agree", examples=[""])


def counter_document(counter: CounterReport | None) -> CounterDocument | None:
    """Return a comparison as a document; None where no counter stamps."""
    if counter is None:
        return None
    return CounterDocument(
        state=counter.state,
        compared=counter.compared,
        missing=counter.missing,
        extra=counter.extra,
        apart=counter.apart,
        mean_us=finite(counter.mean * 1e6),
        largest_us=finite(counter.largest * 1e6),
        told=counter.told,
    )
