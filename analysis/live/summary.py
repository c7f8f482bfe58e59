"""Run summary, built from the snapshots of a run with bounded memory."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from analysis.live.alarms import Alarm, AlarmMonitor
from analysis.signals import FloatArray
from analysis.signals.blocks import SegmentEnd, TimeInRun
from analysis.signals.header import Role, RunHeader, RunOutSettings, Severity
from analysis.signals.snapshot import LARGEST_OVERALL, OVERALL, CounterReport, RunOut, Snapshot, TachoReport
from analysis.signals.units import NUMBER, SPEED, TIME, VOLTAGE
from analysis.vectors.speed_curve import SpeedRow, SpeedTable
from analysis.whirl.findings import WhirlFinding, WhirlTracker


@dataclass(frozen=True, slots=True)
class ProbeSummary:
    """One probe over the whole run."""

    name: Annotated[str, NUMBER.of("Name of the channel")]
    gap_mean: Annotated[float, VOLTAGE.of("Mean gap voltage")]
    gap_min: Annotated[float, VOLTAGE.of("Smallest mean gap voltage of an update interval")]
    gap_max: Annotated[float, VOLTAGE.of("Largest mean gap voltage of an update interval")]
    gap_in_window: Annotated[bool, NUMBER.of("Whether the gap voltage stayed in the probe's window", "gap_ok")]
    largest: Annotated[tuple[float, ...], LARGEST_OVERALL]
    largest_at: Annotated[
        TimeInRun | None, NUMBER.of("Time of the largest vibration; unknown where nothing was measured")
    ]
    severity: Annotated[Severity, NUMBER.of("Severity of the largest vibration")]
    outside_calibration: Annotated[
        int,
        NUMBER.of(
            "Samples outside the calibrated voltage span; their displacement is extrapolated",
            "samples_beyond_calibration",
        ),
    ] = 0
    clearance_fraction: Annotated[
        float,
        NUMBER.of("Largest overall vibration as a fraction of the diametral clearance", "largest_clearance_fraction"),
    ] = 0.0

    @property
    def largest_peak_to_peak(self) -> float:
        """Largest overall vibration, m peak-to-peak; 0 without snapshots."""
        return self.largest[0]


@dataclass(frozen=True, slots=True, eq=False)
class RunSummary:
    """Summary of a run: duration, losses, speeds, vibration, whirl components and alarms.

    Parameters
    ----------
    started_ns : int
        Wall clock at the start, ns since 1970.
    tacho : TachoReport or None
        The last report; None without snapshots.
    tacho_states : dict of str to int
        Number of snapshots in each state of the tacho (`TachoState` values; those that occurred).
    runout : RunOut or None
        Subtracted run-out; None where not requested or never known.
    runout_settings : RunOutSettings
        Requested run-out compensation.
    tacho_reference : str
        Source of speed and phase: "samples" or "counter".
    counter : CounterReport or None
        Comparison of the tacho counter with the waveform; None without a counter.
    """

    run: Annotated[str, NUMBER.of("Id of the run")]
    rig: Annotated[str, NUMBER.of("Name of the rig")]
    note: Annotated[str, NUMBER.of("Note of the operator")]
    started_ns: int
    duration: Annotated[float, TIME.of("Total sampled time of all segments")]
    samples: Annotated[int, NUMBER.of("Samples per channel in all segments")]
    lost: Annotated[int, NUMBER.of("Lost samples per channel", "lost_samples")]
    lost_is_exact: Annotated[bool, NUMBER.of("False where the number of lost samples is a lower bound")]
    segments: Annotated[tuple[SegmentEnd, ...], NUMBER.of("Gap-free segments of the run")]
    lowest_speed: Annotated[float, SPEED.of("Lowest shaft speed; unknown where the tacho measured none")]
    highest_speed: Annotated[float, SPEED.of("Highest shaft speed; unknown likewise")]
    probes: Annotated[tuple[ProbeSummary, ...], NUMBER.of("Probes x and y")]
    clipped: Annotated[
        tuple[int, ...], NUMBER.of("Clipped samples of each channel in sampling order", "clipped_samples")
    ]
    snapshots: Annotated[int, NUMBER.of("Number of results")]
    frames: Annotated[int, NUMBER.of("Number of results with an order spectrum")]
    tacho: TachoReport | None
    tacho_states: dict[str, int]
    rows: Annotated[
        tuple[SpeedRow, ...],
        NUMBER.of("Amplitude, phase and overall vibration by rising speed, run-up and run-down separately", "by_speed"),
    ]
    whirls: Annotated[tuple[WhirlFinding, ...], NUMBER.of("Components below 1X in order of onset", "sub_synchronous")]
    alarms: Annotated[tuple[Alarm, ...], NUMBER.of("Alarms: limits exceeded for the hold time, in order of time")] = ()
    runout: RunOut | None = None
    runout_settings: RunOutSettings = field(default_factory=RunOutSettings)
    tacho_reference: str = "samples"
    counter: CounterReport | None = None

    @property
    def is_gap_free(self) -> Annotated[bool, NUMBER.of("Whether the run is one segment without lost samples")]:
        """Whether the run is one segment without lost samples."""
        return len(self.segments) == 1 and self.segments[0].is_gap_free

    @property
    def largest(self) -> Annotated[tuple[float, ...], LARGEST_OVERALL]:
        """Largest overall vibration of either probe by the measures `OVERALL`; 0 without snapshots."""
        return tuple(np.max([probe.largest for probe in self.probes], axis=0).tolist())

    @property
    def largest_peak_to_peak(self) -> float:
        """Largest overall vibration of either probe, m peak-to-peak."""
        return self.largest[0]

    @property
    def severity(
        self,
    ) -> Annotated[Severity, NUMBER.of("Severity of the largest overall vibration, regardless of the hold time")]:
        """Worst severity of the probes."""
        severities = (probe.severity for probe in self.probes)
        return max(severities, key=lambda severity: severity.rank, default=Severity.NORMAL)


@dataclass(slots=True)
class _Probe:
    """Running sums of one probe."""

    gap_sum: float = 0.0
    gap_min: float = np.inf
    gap_max: float = -np.inf
    gap_in_window: bool = True
    largest: FloatArray = field(default_factory=lambda: np.zeros(len(OVERALL.rows)))
    largest_at: TimeInRun | None = None
    outside_calibration: int = 0

    def add(self, snapshot: Snapshot, probe: int) -> None:
        gap = float(snapshot.gap_volts[probe])
        self.gap_sum += gap
        self.gap_min, self.gap_max = min(self.gap_min, gap), max(self.gap_max, gap)
        self.gap_in_window = self.gap_in_window and bool(snapshot.gap_in_window[probe])
        self.outside_calibration = int(snapshot.outside_calibration[probe])
        overall = snapshot.overall[:, probe]
        if self.largest_at is None or overall[0] > self.largest[0]:
            self.largest_at = TimeInRun(snapshot.segment, snapshot.time, snapshot.speed)
        self.largest = np.maximum(self.largest, overall)


class SummaryBuilder:
    """Builds the summary of a run from its snapshots and segment ends, with bounded memory.

    Parameters
    ----------
    header : RunHeader
        Header of the run.
    """

    def __init__(self, header: RunHeader) -> None:
        self._header = header
        acquisition = header.acquisition
        rows = (acquisition.row(Role.PROBE_X), acquisition.row(Role.PROBE_Y))
        self._names = [acquisition.channels[row].name for row in rows]
        self._probes = (_Probe(), _Probe())
        self._table = SpeedTable()
        self._whirls = WhirlTracker()
        self._alarms = AlarmMonitor(header.limits, self._names)
        self._runout: RunOut | None = None
        self._ends: list[SegmentEnd] = []
        self._clipped: tuple[int, ...] = (0,) * len(acquisition.channels)
        self._states: Counter[str] = Counter()
        self._tacho: TachoReport | None = None
        self._counter: CounterReport | None = None
        self._snapshots = self._frames = 0
        self._lowest, self._highest = np.inf, -np.inf
        self._open_segment, self._open_samples = -1, 0  # of the segment that has not ended

    def add_snapshot(self, snapshot: Snapshot) -> tuple[Alarm, ...]:
        """Add the next snapshot; return the new alarms."""
        if snapshot.segment != self._open_segment:
            self._whirls.end_segment()
        self._open_segment, self._open_samples = snapshot.segment, snapshot.sample
        self._snapshots += 1
        self._states[snapshot.tacho.state.value] += 1
        self._tacho, self._counter = snapshot.tacho, snapshot.counter
        self._clipped = tuple(snapshot.clipped.tolist())
        for row, probe in enumerate(self._probes):
            probe.add(snapshot, row)
        if np.isfinite(snapshot.speed):
            self._lowest, self._highest = min(self._lowest, snapshot.speed), max(self._highest, snapshot.speed)
        self._table.add_snapshot(snapshot)
        if snapshot.frame is not None:
            self._frames += 1
            self._whirls.add_frame(snapshot.segment, snapshot.time, snapshot.frame, self._table.direction)
            if snapshot.frame.runout is not None:
                self._runout = snapshot.frame.runout
        return self._alarms.update(snapshot)

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Alarms so far."""
        return self._alarms.alarms

    @property
    def runout(self) -> RunOut | None:
        """Last known run-out."""
        return self._runout

    def end_segment(self, end: SegmentEnd) -> None:
        """Add the end of a segment."""
        self._ends.append(end)
        self._whirls.end_segment()
        self._open_segment, self._open_samples = -1, 0

    def summary(self) -> RunSummary:
        """Return the summary so far."""
        header = self._header
        samples = sum(end.samples for end in self._ends) + self._open_samples
        has_speed = self._highest > 0.0
        return RunSummary(
            run=header.run,
            rig=header.rig,
            note=header.note,
            started_ns=header.started_ns,
            duration=samples / header.acquisition.rate,
            samples=samples,
            lost=sum(end.lost for end in self._ends),
            lost_is_exact=all(end.lost_is_exact for end in self._ends),
            segments=tuple(self._ends),
            lowest_speed=self._lowest if has_speed else np.nan,
            highest_speed=self._highest if has_speed else np.nan,
            probes=tuple(self._probe(name, probe) for name, probe in zip(self._names, self._probes, strict=True)),
            clipped=self._clipped,
            snapshots=self._snapshots,
            frames=self._frames,
            tacho=self._tacho,
            tacho_states=dict(self._states),
            tacho_reference=header.acquisition.tacho.reference,
            counter=self._counter,
            rows=self._table.rows(),
            whirls=self._whirls.findings(),
            alarms=self._alarms.alarms,
            runout=self._runout,
            runout_settings=header.settings.runout,
        )

    def _probe(self, name: str, probe: _Probe) -> ProbeSummary:
        seen = self._snapshots > 0
        return ProbeSummary(
            name=name,
            gap_mean=probe.gap_sum / self._snapshots if seen else np.nan,
            gap_min=probe.gap_min if seen else np.nan,
            gap_max=probe.gap_max if seen else np.nan,
            gap_in_window=probe.gap_in_window,
            largest=tuple(probe.largest.tolist()),
            largest_at=probe.largest_at,
            severity=self._header.limits.severity(float(probe.largest[0])),
            outside_calibration=probe.outside_calibration,
            clearance_fraction=self._header.limits.clearance_fraction(float(probe.largest[0])),
        )
