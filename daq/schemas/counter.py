"""How the tacho's counter and its waveform compare, as a document."""

from pydantic import Field

from analysis.signals.snapshot import CounterReport, CounterState
from daq.schemas.agreement import Count
from daq.schemas.document import Document
from daq.schemas.units import finite


class CounterDocument(Document):
    """The tacho's counter against its waveform since the run began."""

    state: CounterState = Field(description="The verdict", examples=["agrees"])
    compared: Count = Field(description="Edges that both have", examples=[40_180])
    missing: Count = Field(description="Edges of the waveform that the counter has not stamped", examples=[0])
    extra: Count = Field(description="Stamps where the waveform has no edge", examples=[0])
    apart: Count = Field(description="Edges that lie further apart than the rig says they may", examples=[0])
    mean_us: float | None = Field(description="How much later the counter has them, in the mean, µs", examples=[0.02])
    largest_us: float | None = Field(description="Largest distance of the two, µs", examples=[0.41])
    recent: Count = Field(description="Edges of either in the last 10 s", examples=[250])
    recent_odd: Count = Field(description="Of those, the ones that are missing, extra or apart", examples=[0])
    told: str = Field(
        description="What an operator should know of the whole run; empty where they agree", examples=[""]
    )
    told_lately: str = Field(
        description="Whether they still differ where they have; empty where they agree, or the counter has failed",
        examples=[""],
    )


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
        recent=counter.recent,
        recent_odd=counter.recent_odd,
        told=counter.told,
        told_lately=counter.told_lately,
    )
