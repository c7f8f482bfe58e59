"""What a run was."""

from datetime import datetime
from typing import Annotated

import numpy as np
from pydantic import Field

from analysis.live.delivery import PPM, DeliveryStatistics
from analysis.live.summary import ProbeSummary, RunSummary
from analysis.signals.blocks import EndReason, SegmentEnd
from analysis.signals.header import Severity
from analysis.signals.ramp import RampDirection
from analysis.signals.snapshot import TachoState
from analysis.vectors.speed_table import SpeedRow
from analysis.whirl.findings import WhirlFinding, WhirlHysteresis, whirl_hysteresis
from daq.schemas.agreement import AgreementSchema, CounterSchema, agreement_schema, counter_schema
from daq.schemas.events import AlarmSchema, MarkerSchema, TimeInRunSchema, alarm_schema, time_in_run_schema
from daq.schemas.header import RunOutSchema, runout_schema
from daq.schemas.units import Schema, finite, micrometres, rpm, utc_time
from daq.schemas.vibration import (
    Direction,
    ProbeVectorsSchema,
    StandardSchema,
    direction,
    probe_vectors_schema,
    standard_schemas,
)
from model.prediction.comparison import Agreement

Count = Annotated[int, Field(ge=0)]


class SegmentEndSchema(Schema):
    """A gap-free stretch of the run and how it ended."""

    segment: Count = Field(description="Its number, from 0", examples=[0])
    samples: Count = Field(description="Samples per channel that it holds", examples=[60_000_000])
    end_reason: EndReason = Field(description="Why it ended", examples=["finished"])
    lost_samples: Count = Field(description="Samples per channel known to be lost after its last one", examples=[0])
    lost_is_exact: bool = Field(description="False where `lost_samples` is a lower bound", examples=[True])
    detail: str = Field(description="What the driver said; empty where all was well", examples=[""])


class ProbeSummarySchema(Schema):
    """One probe over the whole run."""

    name: str = Field(description="The operator's name for it", examples=["x"])
    gap_mean_v: float | None = Field(description="Mean gap voltage, V", examples=[5.02])
    gap_min_v: float | None = Field(description="Smallest gap voltage over an update interval, V", examples=[4.97])
    gap_max_v: float | None = Field(description="Largest gap voltage over an update interval, V", examples=[5.08])
    gap_ok: bool = Field(description="Whether it lay in the probe's window throughout", examples=[True])
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration, µm peak-to-peak", examples=[96.1]
    )
    largest_clearance_fraction: float | None = Field(
        description="That over the clearance's diameter: 1 is all the room there is", examples=[0.48]
    )
    largest_at: TimeInRunSchema | None = Field(description="Where that was; null where nothing was measured")
    severity: Severity = Field(description="The largest vibration against the limits", examples=["danger"])
    samples_beyond_calibration: Count = Field(
        description="Samples whose voltage lay outside the calibrated span: their displacement is extrapolated",
        examples=[0],
    )


class TachoSummarySchema(Schema):
    """What was seen of the tacho over the whole run."""

    pulses: Count = Field(description="Pulses accepted", examples=[40_210])
    filled: Count = Field(description="Pulses that were missing and filled in", examples=[0])
    rejected: Count = Field(description="Edges rejected as doubles or noise", examples=[2])
    jitter_us: float | None = Field(
        description="Robust scatter (median absolute deviation) of the edges at the run's end, µs", examples=[4.8]
    )
    snapshots_by_state: dict[TachoState, Count] = Field(
        description="Number of results in each state of the tacho; states that did not occur are left out",
        examples=[{"good": 2980, "no pulses": 20}],
    )
    phase_reference_is_arbitrary: bool = Field(
        description="Whether several marks cannot be told apart, so that phases are referred to the first one seen of "
        "every train of pulses and cannot be compared between trains or runs",
        examples=[False],
    )
    reference: str = Field(
        description='What speed and phase are taken from: "samples" of the tacho, or a "counter" that stamps its edges',
        examples=["samples"],
    )
    counter: CounterSchema | None = Field(
        description="How the counter and the samples compare; null where no counter stamps"
    )


class SpeedRowSchema(Schema):
    """What the results in one bin of speed said, of a run-up or of a run-down."""

    ramp_direction: RampDirection = Field(description="Whether the shaft was running up or down", examples=["run-up"])
    speed_rpm: float | None = Field(description="Mean shaft speed, r/min", examples=[11_025.0])
    frames: Count = Field(description="Number of order spectra in the bin", examples=[24])
    order_1x: ProbeVectorsSchema = Field(description="At running speed, mean of the vectors as measured")
    order_2x: ProbeVectorsSchema = Field(description="At twice running speed, mean of the vectors as measured")
    order_1x_compensated: ProbeVectorsSchema | None = Field(
        description="The mean of 1X less run-out; null where no run-out was known"
    )
    order_2x_compensated: ProbeVectorsSchema | None = Field(
        description="The mean of 2X less run-out; null where no run-out was known"
    )
    scatter_1x_peak_x_um: float | None = Field(
        description="Standard deviation of the 1X vectors at x about their mean, µm zero-to-peak", examples=[0.4]
    )
    scatter_1x_peak_y_um: float | None = Field(description="The same at y, µm zero-to-peak", examples=[0.5])
    mean_peak_to_peak_x_um: float | None = Field(description="Mean overall at x, µm peak-to-peak", examples=[38.4])
    mean_peak_to_peak_y_um: float | None = Field(description="Mean overall at y, µm peak-to-peak", examples=[41.0])
    largest_peak_to_peak_x_um: float | None = Field(
        description="Largest overall at x, µm peak-to-peak", examples=[43.9]
    )
    largest_peak_to_peak_y_um: float | None = Field(
        description="Largest overall at y, µm peak-to-peak", examples=[47.2]
    )
    whirl_order: float | None = Field(
        description="Order of the largest component below 1X; null where none stood out", examples=[0.49]
    )
    whirl_peak_um: float | None = Field(
        description="Its size, half the major axis of its ellipse, µm zero-to-peak; null likewise", examples=[12.1]
    )
    noise_peak_um: float | None = Field(description="Mean floor of the order spectra, µm zero-to-peak", examples=[0.05])


class SubSynchronousSchema(Schema):
    """A component below 1X from its beginning to its end."""

    order: float | None = Field(
        description="Its frequency over the shaft's, mean weighted with amplitude", examples=[0.49]
    )
    order_at_begin: float | None = Field(description="The same over its first results", examples=[0.492])
    begin: TimeInRunSchema = Field(description="The first result that showed it")
    begin_ramp_direction: RampDirection = Field(
        description="Whether the shaft was running up or down then", examples=["run-up"]
    )
    end: TimeInRunSchema = Field(description="The last result that showed it")
    end_ramp_direction: RampDirection = Field(
        description="Whether the shaft was running up or down then", examples=["run-down"]
    )
    largest_peak_um: float | None = Field(
        description="Its largest size, half the major axis of its ellipse, µm zero-to-peak", examples=[14.2]
    )
    largest_at: TimeInRunSchema = Field(description="Where that was")
    direction: Direction = Field(description="Whether it went round with the shaft", examples=["forward"])
    frames: Count = Field(description="Number of order spectra that showed it", examples=[212])


class HysteresisSchema(Schema):
    """How much longer a component below 1X stays on the run-down than the run-up took to bring it."""

    order: float | None = Field(description="Its frequency over the shaft's when it came", examples=[0.492])
    onset_rpm: float | None = Field(description="Lowest speed at which it came on a run-up, r/min", examples=[11020.0])
    end_rpm: float | None = Field(description="Lowest speed at which it went on a run-down, r/min", examples=[10310.0])
    width_rpm: float | None = Field(
        description="By how much lower it went than it came, r/min; negative where it went sooner", examples=[710.0]
    )


class SummarySchema(Schema):
    """What a run was."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    note: str = Field(description="The operator's words", examples=["after the oil change"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
    duration_s: float = Field(description="Sampled time of all segments together, s", examples=[300.0])
    samples: Count = Field(description="Samples per channel in all segments together", examples=[60_000_000])
    is_gap_free: bool = Field(description="Whether the run is one stretch of which no sample was lost", examples=[True])
    lost_samples: Count = Field(description="Samples per channel known to be lost", examples=[0])
    lost_is_exact: bool = Field(description="False where `lost_samples` is a lower bound", examples=[True])
    clipped_samples: tuple[Count, ...] = Field(
        description="Samples at the converter's rails, for each channel in the order of the card", examples=[[0, 0, 0]]
    )
    segments: tuple[SegmentEndSchema, ...] = Field(description="The run's gap-free stretches")
    markers: tuple[MarkerSchema, ...] = Field(
        description="Moments that were marked while the run was recorded, in order: words, alarms, acknowledgements"
    )
    clock_error_ppm: float | None = Field(
        description="The card's clock against the computer's over the run, positive where the card is fast; null where "
        "the run is too short or did not go in real time",
        examples=[12.3],
    )
    clock_uncertainty_ppm: float | None = Field(
        description="How far off that may be on either side, 95 %; null likewise", examples=[0.4]
    )
    largest_backlog_s: float | None = Field(
        description="The longest that samples waited in the card's buffer, s; null where there is no card, or the run "
        "was not finished",
        examples=[0.12],
    )
    buffer_s: float | None = Field(
        description="What the card's buffer holds, s: a larger backlog loses samples; null where there is no card",
        examples=[8.0],
    )
    lowest_speed_rpm: float | None = Field(
        description="Lowest shaft speed, r/min; null where the tacho never told", examples=[1004.0]
    )
    highest_speed_rpm: float | None = Field(
        description="Highest shaft speed, r/min; null likewise", examples=[15_120.0]
    )
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration of either probe, µm peak-to-peak", examples=[96.1]
    )
    severity: Severity = Field(description="That against the limits, held or not", examples=["danger"])
    alarms: tuple[AlarmSchema, ...] = Field(
        description="Limits that were passed for long enough, in the order in which their alarms came"
    )
    standards: tuple[StandardSchema, ...] = Field(
        description="What standards say of the largest vibration, for information; empty where its speed is unknown"
    )
    probes: tuple[ProbeSummarySchema, ...] = Field(description="The probes x and y")
    tacho: TachoSummarySchema | None = Field(description="The tacho; null where nothing was measured")
    snapshots: Count = Field(description="Number of results", examples=[3000])
    frames: Count = Field(description="Number of results with an order spectrum", examples=[2950])
    by_speed: tuple[SpeedRowSchema, ...] = Field(
        description="Amplitude, phase and peak-to-peak by speed, run-up and run-down apart, in rising order of speed"
    )
    runout: RunOutSchema | None = Field(description="What was taken off as run-out; null where nothing was to be")
    sub_synchronous: tuple[SubSynchronousSchema, ...] = Field(
        description="Components below 1X in the order in which they began"
    )
    hysteresis: tuple[HysteresisSchema, ...] = Field(
        description="Of the components that came on a run-up and went on a run-down"
    )
    agreement: AgreementSchema | None = Field(
        description="How far the model agrees; null where it is off or its prediction is still being computed"
    )


def summary_schema(
    summary: RunSummary,
    agreement: Agreement | None = None,
    delivery: DeliveryStatistics | None = None,
    markers: tuple[MarkerSchema, ...] = (),
) -> SummarySchema:
    """Return what a run was as a document.

    Parameters
    ----------
    summary : RunSummary
        What was measured.
    agreement : Agreement or None
        How far the model agrees; None where there is no prediction for it.
    delivery : Delivery or None
        How the samples came from the device; None where nobody knows.
    markers : tuple of MarkerSchema
        Moments that somebody named.
    """
    tacho, delivery = summary.tacho, delivery or DeliveryStatistics()
    clock = delivery.clock
    return SummarySchema(
        run=summary.run,
        rig=summary.rig,
        note=summary.note,
        started_at=utc_time(summary.started_ns),
        duration_s=finite(summary.duration) or 0.0,
        samples=summary.samples,
        is_gap_free=summary.is_gap_free,
        lost_samples=summary.lost,
        lost_is_exact=summary.lost_is_exact,
        clipped_samples=summary.clipped,
        segments=tuple(_segment(end) for end in summary.segments),
        markers=markers,
        clock_error_ppm=None if clock is None else finite(clock.error / PPM),
        clock_uncertainty_ppm=None if clock is None else finite(clock.uncertainty / PPM),
        largest_backlog_s=None if delivery.backlog is None else finite(delivery.backlog),
        buffer_s=None if delivery.buffer is None else finite(delivery.buffer),
        lowest_speed_rpm=rpm(summary.lowest_speed),
        highest_speed_rpm=rpm(summary.highest_speed),
        largest_peak_to_peak_um=micrometres(summary.largest_peak_to_peak),
        severity=summary.severity,
        alarms=tuple(alarm_schema(alarm) for alarm in summary.alarms),
        standards=standard_schemas(summary.probes),
        probes=tuple(_probe(probe) for probe in summary.probes),
        tacho=None
        if tacho is None
        else TachoSummarySchema(
            pulses=tacho.pulses,
            filled=tacho.filled,
            rejected=tacho.rejected,
            jitter_us=finite(tacho.jitter * 1e6),
            phase_reference_is_arbitrary=tacho.phase_reference_is_arbitrary,
            snapshots_by_state={TachoState(state): count for state, count in summary.tacho_states.items()},
            reference=summary.tacho_reference,
            counter=counter_schema(summary.counter),
        ),
        snapshots=summary.snapshots,
        frames=summary.frames,
        by_speed=tuple(speed_row_schema(row) for row in summary.rows),
        runout=runout_schema(summary.runout_settings, summary.runout),
        sub_synchronous=tuple(sub_synchronous_schema(finding) for finding in summary.whirls),
        hysteresis=tuple(_hysteresis(each) for each in whirl_hysteresis(summary.whirls)),
        agreement=None if agreement is None else agreement_schema(agreement),
    )


def _segment(end: SegmentEnd) -> SegmentEndSchema:
    return SegmentEndSchema(
        segment=end.segment,
        samples=end.samples,
        end_reason=end.reason,
        lost_samples=end.lost,
        lost_is_exact=end.lost_is_exact,
        detail=end.detail,
    )


def _probe(probe: ProbeSummary) -> ProbeSummarySchema:
    return ProbeSummarySchema(
        name=probe.name,
        gap_mean_v=finite(probe.gap_mean),
        gap_min_v=finite(probe.gap_min),
        gap_max_v=finite(probe.gap_max),
        gap_ok=probe.gap_ok,
        largest_peak_to_peak_um=micrometres(probe.largest_peak_to_peak),
        largest_clearance_fraction=finite(probe.clearance_fraction),
        largest_at=None if probe.largest is None else time_in_run_schema(probe.largest),
        severity=probe.severity,
        samples_beyond_calibration=probe.beyond_calibration,
    )


def _hysteresis(hysteresis: WhirlHysteresis) -> HysteresisSchema:
    return HysteresisSchema(
        order=finite(hysteresis.order),
        onset_rpm=rpm(hysteresis.onset),
        end_rpm=rpm(hysteresis.end),
        width_rpm=rpm(hysteresis.width),
    )


def _compensated(row: SpeedRow, order: int) -> ProbeVectorsSchema | None:
    vectors = row.compensated[order - 1]
    return None if np.isnan(vectors).any() else probe_vectors_schema(vectors.tolist())


def speed_row_schema(row: SpeedRow) -> SpeedRowSchema:
    """Return what one bin of speed said as a document."""
    order = finite(row.whirl_order)
    return SpeedRowSchema(
        ramp_direction=row.direction,
        speed_rpm=rpm(row.speed),
        frames=row.frames,
        order_1x=probe_vectors_schema(row.vectors[0]),
        order_2x=probe_vectors_schema(row.vectors[1]),
        order_1x_compensated=_compensated(row, 1),
        order_2x_compensated=_compensated(row, 2),
        scatter_1x_peak_x_um=micrometres(row.scatter[0, 0]),
        scatter_1x_peak_y_um=micrometres(row.scatter[0, 1]),
        mean_peak_to_peak_x_um=micrometres(row.peak_to_peak[0]),
        mean_peak_to_peak_y_um=micrometres(row.peak_to_peak[1]),
        largest_peak_to_peak_x_um=micrometres(row.largest_peak_to_peak[0]),
        largest_peak_to_peak_y_um=micrometres(row.largest_peak_to_peak[1]),
        whirl_order=order,
        whirl_peak_um=None if order is None else micrometres(row.whirl_amplitude),
        noise_peak_um=micrometres(row.noise),
    )


def sub_synchronous_schema(finding: WhirlFinding) -> SubSynchronousSchema:
    """Return a component below 1X as a document."""
    return SubSynchronousSchema(
        order=finite(finding.order),
        order_at_begin=finite(finding.order_at_begin),
        begin=time_in_run_schema(finding.begin),
        begin_ramp_direction=finding.begin_direction,
        end=time_in_run_schema(finding.end),
        end_ramp_direction=finding.end_direction,
        largest_peak_um=micrometres(finding.amplitude),
        largest_at=time_in_run_schema(finding.largest),
        direction=direction(is_forward=finding.is_forward),
        frames=finding.frames,
    )
