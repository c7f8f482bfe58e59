"""Schema of the summary of a run."""

from datetime import datetime
from typing import Annotated

import numpy as np
from pydantic import Field

from analysis.live.summary import ProbeSummary, RunSummary
from analysis.signals.blocks import PPM, DeliveryStatistics, EndReason, RampDirection, SegmentEnd
from analysis.signals.header import Severity
from analysis.signals.snapshot import TachoState
from analysis.signals.units import MICROSECOND
from analysis.vectors.speed_curve import SpeedRow
from analysis.whirl.findings import WhirlFinding, WhirlHysteresis, whirl_hysteresis
from daq.schemas.events import AlarmSchema, MarkerSchema, TimeInRunSchema, alarm_schema, time_in_run_schema
from daq.schemas.runs import RunOutSchema, runout_schema
from daq.schemas.units import Schema, finite, micrometres, rpm, utc_time
from daq.schemas.vibration import (
    AgreementSchema,
    CounterSchema,
    Direction,
    ProbeVectorsSchema,
    StandardSchema,
    agreement_schema,
    counter_schema,
    direction,
    probe_vectors_schema,
    standard_schemas,
)
from model.prediction.comparison import Agreement

Count = Annotated[int, Field(ge=0)]


class SegmentEndSchema(Schema):
    """A gap-free segment of the run and its end."""

    segment: Count = Field(description="Number of the segment, from 0", examples=[0])
    samples: Count = Field(description="Samples per channel", examples=[60_000_000])
    end_reason: EndReason = Field(description="Reason of the end", examples=["finished"])
    lost_samples: Count = Field(description="Lost samples per channel after the last one", examples=[0])
    lost_is_exact: bool = Field(description="False where `lost_samples` is a lower bound", examples=[True])
    detail: str = Field(description="Message of the driver; empty without an error", examples=[""])


class ProbeSummarySchema(Schema):
    """Summary of one probe over the run."""

    name: str = Field(description="Name of the channel", examples=["x"])
    gap_mean_v: float | None = Field(description="Mean gap voltage, V", examples=[5.02])
    gap_min_v: float | None = Field(description="Smallest mean gap voltage of an update interval, V", examples=[4.97])
    gap_max_v: float | None = Field(description="Largest mean gap voltage of an update interval, V", examples=[5.08])
    gap_ok: bool = Field(description="Whether the gap voltage stayed in the probe's window", examples=[True])
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration, µm peak-to-peak", examples=[96.1]
    )
    largest_clearance_fraction: float | None = Field(
        description="Largest overall vibration as a fraction of the diametral clearance", examples=[0.48]
    )
    largest_at: TimeInRunSchema | None = Field(
        description="Time of the largest vibration; null where nothing was measured"
    )
    severity: Severity = Field(description="Severity of the largest vibration", examples=["danger"])
    samples_beyond_calibration: Count = Field(
        description="Samples outside the calibrated voltage span; their displacement is extrapolated",
        examples=[0],
    )


class TachoSummarySchema(Schema):
    """Summary of the tacho over the run."""

    pulses: Count = Field(description="Pulses accepted", examples=[40_210])
    filled: Count = Field(description="Missing pulses that were filled in", examples=[0])
    rejected: Count = Field(description="Edges rejected as doubles or noise", examples=[2])
    jitter_us: float | None = Field(
        description="Robust scatter (median absolute deviation) of the edges at the run's end, µs", examples=[4.8]
    )
    snapshots_by_state: dict[TachoState, Count] = Field(
        description="Number of results in each tacho state; states without results are omitted",
        examples=[{"good": 2980, "no pulses": 20}],
    )
    phase_reference_is_arbitrary: bool = Field(
        description="Whether several keyphasor marks are indistinguishable, so that phases refer to the first one of "
        "each pulse train and cannot be compared between trains or runs",
        examples=[False],
    )
    reference: str = Field(
        description='Source of speed and phase: "samples" of the tacho, or a "counter" that time-stamps its edges',
        examples=["samples"],
    )
    counter: CounterSchema | None = Field(description="Comparison of counter and samples; null without a counter")


class SpeedRowSchema(Schema):
    """Averages over one speed bin of a run-up or run-down."""

    ramp_direction: RampDirection = Field(description="Ramp direction of the shaft speed", examples=["run-up"])
    speed_rpm: float | None = Field(description="Mean shaft speed, r/min", examples=[11_025.0])
    frames: Count = Field(description="Number of order spectra in the bin", examples=[24])
    order_1x: ProbeVectorsSchema = Field(description="Mean 1X vector as measured")
    order_2x: ProbeVectorsSchema = Field(description="Mean 2X vector as measured")
    order_1x_compensated: ProbeVectorsSchema | None = Field(
        description="Mean 1X vector minus run-out; null where no run-out was known"
    )
    order_2x_compensated: ProbeVectorsSchema | None = Field(
        description="Mean 2X vector minus run-out; null where no run-out was known"
    )
    scatter_1x_peak_x_um: float | None = Field(
        description="Standard deviation of the 1X vectors at x about their mean, µm zero-to-peak", examples=[0.4]
    )
    scatter_1x_peak_y_um: float | None = Field(
        description="Standard deviation of the 1X vectors at y about their mean, µm zero-to-peak", examples=[0.5]
    )
    mean_peak_to_peak_x_um: float | None = Field(description="Mean overall at x, µm peak-to-peak", examples=[38.4])
    mean_peak_to_peak_y_um: float | None = Field(description="Mean overall at y, µm peak-to-peak", examples=[41.0])
    largest_peak_to_peak_x_um: float | None = Field(
        description="Largest overall at x, µm peak-to-peak", examples=[43.9]
    )
    largest_peak_to_peak_y_um: float | None = Field(
        description="Largest overall at y, µm peak-to-peak", examples=[47.2]
    )
    whirl_order: float | None = Field(
        description="Order of the largest component below 1X; null without one above the noise", examples=[0.49]
    )
    whirl_peak_um: float | None = Field(
        description="Amplitude of it, half the major axis of the ellipse, µm zero-to-peak; null likewise",
        examples=[12.1],
    )
    noise_peak_um: float | None = Field(
        description="Mean noise floor of the order spectra, µm zero-to-peak", examples=[0.05]
    )


class SubSynchronousSchema(Schema):
    """A component below 1X from onset to end."""

    order: float | None = Field(description="Frequency over shaft frequency, amplitude-weighted mean", examples=[0.49])
    order_at_begin: float | None = Field(
        description="Frequency over shaft frequency in the first results", examples=[0.492]
    )
    begin: TimeInRunSchema = Field(description="First result with the component")
    begin_ramp_direction: RampDirection = Field(description="Ramp direction at the onset", examples=["run-up"])
    end: TimeInRunSchema = Field(description="Last result with the component")
    end_ramp_direction: RampDirection = Field(description="Ramp direction at the end", examples=["run-down"])
    largest_peak_um: float | None = Field(
        description="Largest amplitude, half the major axis of the ellipse, µm zero-to-peak", examples=[14.2]
    )
    largest_at: TimeInRunSchema = Field(description="Time of the largest amplitude")
    direction: Direction = Field(description="Sense of the whirl relative to the rotation", examples=["forward"])
    frames: Count = Field(description="Number of order spectra with the component", examples=[212])


class HysteresisSchema(Schema):
    """Hysteresis of a component below 1X: onset speed of the run-up, end speed of the run-down."""

    order: float | None = Field(description="Frequency over shaft frequency at the onset", examples=[0.492])
    onset_rpm: float | None = Field(description="Lowest onset speed on a run-up, r/min", examples=[11020.0])
    end_rpm: float | None = Field(description="Lowest end speed on a run-down, r/min", examples=[10310.0])
    width_rpm: float | None = Field(
        description="Onset speed minus end speed, r/min; negative where it ended above the onset speed",
        examples=[710.0],
    )


class SummarySchema(Schema):
    """Summary of a run."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    note: str = Field(description="Note of the operator", examples=["after the oil change"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
    duration_s: float = Field(description="Total sampled time of all segments, s", examples=[300.0])
    samples: Count = Field(description="Samples per channel in all segments", examples=[60_000_000])
    is_gap_free: bool = Field(description="Whether the run is one segment without lost samples", examples=[True])
    lost_samples: Count = Field(description="Lost samples per channel", examples=[0])
    lost_is_exact: bool = Field(description="False where `lost_samples` is a lower bound", examples=[True])
    clipped_samples: tuple[Count, ...] = Field(
        description="Clipped samples of each channel in sampling order", examples=[[0, 0, 0]]
    )
    segments: tuple[SegmentEndSchema, ...] = Field(description="Gap-free segments of the run")
    markers: tuple[MarkerSchema, ...] = Field(
        description="Markers in order of time: text of an operator, alarms, acknowledgements"
    )
    clock_error_ppm: float | None = Field(
        description="Error of the card's clock against the computer's, positive where the card is fast; null where the "
        "run is too short or was not recorded in real time",
        examples=[12.3],
    )
    clock_uncertainty_ppm: float | None = Field(
        description="Half width of the 95 % interval of the clock error; null likewise", examples=[0.4]
    )
    largest_backlog_s: float | None = Field(
        description="Longest time that samples waited in the card's buffer, s; null without a card or where the run "
        "was not finished",
        examples=[0.12],
    )
    buffer_s: float | None = Field(
        description="Capacity of the card's buffer, s: a larger backlog loses samples; null without a card",
        examples=[8.0],
    )
    lowest_speed_rpm: float | None = Field(
        description="Lowest shaft speed, r/min; null where the tacho measured none", examples=[1004.0]
    )
    highest_speed_rpm: float | None = Field(
        description="Highest shaft speed, r/min; null likewise", examples=[15_120.0]
    )
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration of either probe, µm peak-to-peak", examples=[96.1]
    )
    severity: Severity = Field(
        description="Severity of the largest overall vibration, regardless of the hold time", examples=["danger"]
    )
    alarms: tuple[AlarmSchema, ...] = Field(description="Alarms: limits exceeded for the hold time, in order of time")
    standards: tuple[StandardSchema, ...] = Field(
        description="Limits of standards for the largest vibration, for information; empty where its speed is unknown"
    )
    probes: tuple[ProbeSummarySchema, ...] = Field(description="Probes x and y")
    tacho: TachoSummarySchema | None = Field(description="Tacho; null where nothing was measured")
    snapshots: Count = Field(description="Number of results", examples=[3000])
    frames: Count = Field(description="Number of results with an order spectrum", examples=[2950])
    by_speed: tuple[SpeedRowSchema, ...] = Field(
        description="Amplitude, phase and peak-to-peak by rising speed, run-up and run-down separately"
    )
    runout: RunOutSchema | None = Field(description="Run-out; null without compensation")
    sub_synchronous: tuple[SubSynchronousSchema, ...] = Field(description="Components below 1X in order of onset")
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
            jitter_us=finite(tacho.jitter / MICROSECOND),
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
        hysteresis=tuple(_hysteresis(hysteresis) for hysteresis in whirl_hysteresis(summary.whirls)),
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
        gap_ok=probe.gap_in_window,
        largest_peak_to_peak_um=micrometres(probe.largest_peak_to_peak),
        largest_clearance_fraction=finite(probe.clearance_fraction),
        largest_at=None if probe.largest_at is None else time_in_run_schema(probe.largest_at),
        severity=probe.severity,
        samples_beyond_calibration=probe.outside_calibration,
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
    """Return the schema of a speed bin."""
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
    """Return the schema of a component below 1X."""
    return SubSynchronousSchema(
        order=finite(finding.order),
        order_at_begin=finite(finding.order_at_onset),
        begin=time_in_run_schema(finding.onset),
        begin_ramp_direction=finding.onset_direction,
        end=time_in_run_schema(finding.end),
        end_ramp_direction=finding.end_direction,
        largest_peak_um=micrometres(finding.amplitude),
        largest_at=time_in_run_schema(finding.largest_at),
        direction=direction(is_forward=finding.is_forward),
        frames=finding.frames,
    )
