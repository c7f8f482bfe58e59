"""Schema of the summary of a run."""

from datetime import datetime

import numpy as np
from pydantic import Field

from analysis.live.summary import ProbeSummary, RunSummary
from analysis.signals import ComplexArray
from analysis.signals.blocks import ClockError, DeliveryStatistics, EndReason, RampDirection, SegmentEnd
from analysis.signals.header import Severity
from analysis.signals.snapshot import TachoReport, TachoState, WhirlDirection
from analysis.vectors.speed_curve import SpeedRow
from analysis.whirl.findings import WhirlFinding, WhirlHysteresis, whirl_hysteresis
from daq.schemas.events import AlarmSchema, MarkerSchema, TimeInRunSchema, alarm_schema
from daq.schemas.runs import RunOutSchema, runout_schema
from daq.schemas.units import Count, Number, Schema, micrometres, utc_time
from daq.schemas.vibration import (
    AgreementSchema,
    CounterSchema,
    LargestOverallSchema,
    ProbeVectorsSchema,
    SpeedRowOverallSchema,
    StandardSchema,
    agreement_schema,
    probe_vectors_schema,
    standard_schemas,
)
from model.prediction.comparison import Agreement


class SegmentEndSchema(Schema, of=(SegmentEnd,)):
    """A gap-free segment of the run and its end."""

    segment: Count = Field(examples=[0])
    samples: Count = Field(examples=[60_000_000])
    end_reason: EndReason = Field(examples=["finished"])
    lost_samples: Count = Field(examples=[0])
    lost_is_exact: bool = Field(examples=[True])
    detail: str = Field(examples=[""])


class ProbeSummarySchema(LargestOverallSchema, of=(ProbeSummary,)):
    """Summary of one probe over the run."""

    name: str = Field(examples=["x"])
    gap_mean_v: Number = Field(examples=[5.02])
    gap_min_v: Number = Field(examples=[4.97])
    gap_max_v: Number = Field(examples=[5.08])
    gap_ok: bool = Field(examples=[True])
    largest_clearance_fraction: Number = Field(examples=[0.48])
    largest_at: TimeInRunSchema | None = Field()
    severity: Severity = Field(examples=["danger"])
    samples_beyond_calibration: Count = Field(examples=[0])


class TachoSummarySchema(Schema, of=(TachoReport,)):
    """Summary of the tacho over the run."""

    pulses: Count = Field(examples=[40_210])
    filled: Count = Field(examples=[0])
    rejected: Count = Field(examples=[2])
    jitter_us: Number = Field(examples=[4.8])
    snapshots_by_state: dict[TachoState, Count] = Field(
        description="Number of results in each tacho state; states without results are omitted",
        examples=[{"good": 2980, "no pulses": 20}],
    )
    phase_reference_is_arbitrary: bool = Field(examples=[False])
    reference: str = Field(
        description='Source of speed and phase: "samples" of the tacho, or a "counter" that timestamps its edges',
        examples=["samples"],
    )
    counter: CounterSchema | None = Field(description="Comparison of counter and samples; null without a counter")


class SpeedRowSchema(SpeedRowOverallSchema, of=(SpeedRow,)):
    """Averages over one speed bin of a run-up or run-down."""

    ramp_direction: RampDirection = Field(examples=["run-up"])
    speed_rpm: Number = Field(examples=[11_025.0])
    frames: Count = Field(examples=[24])
    order_1x: ProbeVectorsSchema = Field(description="Mean 1X vector as measured")
    order_2x: ProbeVectorsSchema = Field(description="Mean 2X vector as measured")
    order_1x_compensated: ProbeVectorsSchema | None = Field(
        description="Mean 1X vector minus run-out; null where no run-out was known"
    )
    order_2x_compensated: ProbeVectorsSchema | None = Field(
        description="Mean 2X vector minus run-out; null where no run-out was known"
    )
    scatter_1x_peak_x_um: Number = Field(
        description="Standard deviation of the 1X vectors at x about their mean, µm zero-to-peak", examples=[0.4]
    )
    scatter_1x_peak_y_um: Number = Field(
        description="Standard deviation of the 1X vectors at y about their mean, µm zero-to-peak", examples=[0.5]
    )
    whirl_order: Number = Field(examples=[0.49])
    whirl_peak_um: Number = Field(examples=[12.1])
    noise_peak_um: Number = Field(examples=[0.05])


class SubSynchronousSchema(Schema, of=(WhirlFinding,)):
    """A component below 1X from onset to end."""

    order: Number = Field(examples=[0.49])
    order_at_begin: Number = Field(examples=[0.492])
    begin: TimeInRunSchema = Field()
    begin_ramp_direction: RampDirection = Field(examples=["run-up"])
    end: TimeInRunSchema = Field()
    end_ramp_direction: RampDirection = Field(examples=["run-down"])
    largest_peak_um: Number = Field(examples=[14.2])
    largest_at: TimeInRunSchema = Field()
    direction: WhirlDirection = Field(examples=["forward"])
    frames: Count = Field(examples=[212])


class HysteresisSchema(Schema, of=(WhirlHysteresis,)):
    """Hysteresis of a component below 1X: onset speed of the run-up, end speed of the run-down."""

    order: Number = Field(examples=[0.492])
    onset_rpm: Number = Field(examples=[11020.0])
    end_rpm: Number = Field(examples=[10310.0])
    width_rpm: Number = Field(examples=[710.0])


class SummarySchema(LargestOverallSchema, of=(RunSummary, DeliveryStatistics, ClockError)):
    """Summary of a run."""

    run: str = Field(examples=["2026-11-24T09-12-07-gj90c"])
    rig: str = Field(examples=["gj90c"])
    note: str = Field(examples=["after the oil change"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
    duration_s: float = Field(examples=[300.0])
    samples: Count = Field(examples=[60_000_000])
    is_gap_free: bool = Field(examples=[True])
    lost_samples: Count = Field(examples=[0])
    lost_is_exact: bool = Field(examples=[True])
    clipped_samples: tuple[Count, ...] = Field(examples=[[0, 0, 0]])
    segments: tuple[SegmentEndSchema, ...] = Field()
    markers: tuple[MarkerSchema, ...] = Field(
        description="Markers in order of time: text of an operator, alarms, acknowledgements"
    )
    clock_error_ppm: Number = Field(examples=[12.3])
    clock_uncertainty_ppm: Number = Field(examples=[0.4])
    largest_backlog_s: Number = Field(examples=[0.12])
    buffer_s: Number = Field(examples=[8.0])
    lowest_speed_rpm: Number = Field(examples=[1004.0])
    highest_speed_rpm: Number = Field(examples=[15_120.0])
    severity: Severity = Field(examples=["danger"])
    alarms: tuple[AlarmSchema, ...] = Field()
    standards: tuple[StandardSchema, ...] = Field(
        description="Limits of standards for the largest vibration, for information; empty where its speed is unknown"
    )
    probes: tuple[ProbeSummarySchema, ...] = Field()
    tacho: TachoSummarySchema | None = Field(description="Tacho; null where nothing was measured")
    snapshots: Count = Field(examples=[3000])
    frames: Count = Field(examples=[2950])
    by_speed: tuple[SpeedRowSchema, ...] = Field()
    runout: RunOutSchema | None = Field(description="Run-out; null without compensation")
    sub_synchronous: tuple[SubSynchronousSchema, ...] = Field()
    hysteresis: tuple[HysteresisSchema, ...] = Field(
        description="Hysteresis of the components with onset on a run-up and end on a run-down"
    )
    agreement: AgreementSchema | None = Field(
        description="Agreement with the model; null where the model is off or still being computed"
    )


def summary_schema(
    summary: RunSummary,
    agreement: Agreement | None = None,
    delivery: DeliveryStatistics | None = None,
    markers: tuple[MarkerSchema, ...] = (),
) -> SummarySchema:
    """Return the schema of a run's summary.

    Parameters
    ----------
    summary : RunSummary
        Measured summary.
    agreement : Agreement or None
        Agreement with the model; None without a prediction.
    delivery : DeliveryStatistics or None
        Backlog and clock of the acquisition; None where unknown.
    markers : tuple of MarkerSchema
        Markers of the run.
    """
    delivery = delivery or DeliveryStatistics()
    return SummarySchema.of(
        summary,
        delivery,
        delivery.clock,
        started_at=utc_time(summary.started_ns),
        markers=markers,
        alarms=tuple(map(alarm_schema, summary.alarms)),
        standards=standard_schemas(summary.probes),
        tacho=None
        if summary.tacho is None
        else TachoSummarySchema.of(
            summary.tacho,
            snapshots_by_state=summary.tacho_states,
            reference=summary.tacho_reference,
            counter=summary.counter,
        ),
        by_speed=tuple(map(speed_row_schema, summary.rows)),
        runout=runout_schema(summary.runout_settings, summary.runout),
        hysteresis=whirl_hysteresis(summary.whirls),
        agreement=None if agreement is None else agreement_schema(agreement),
    )


def speed_row_schema(row: SpeedRow) -> SpeedRowSchema:
    """Return the schema of a speed bin."""
    return SpeedRowSchema.of(
        row,
        order_1x=probe_vectors_schema(row.vectors[0]),
        order_2x=probe_vectors_schema(row.vectors[1]),
        order_1x_compensated=_known_vectors(row.compensated[0]),
        order_2x_compensated=_known_vectors(row.compensated[1]),
        scatter_1x_peak_x_um=micrometres(row.scatter[0, 0]),
        scatter_1x_peak_y_um=micrometres(row.scatter[0, 1]),
    )


def _known_vectors(vectors: ComplexArray) -> ProbeVectorsSchema | None:
    return None if np.isnan(vectors).any() else probe_vectors_schema(vectors)
