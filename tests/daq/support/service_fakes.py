"""Fakes for the service: catalogue, live run and summaries."""

import math
import threading
from pathlib import Path

import numpy as np

from analysis.live.summary import ProbeSummary, RunSummary
from analysis.signals.blocks import EndReason, RampDirection, SegmentEnd, TimeInRun
from analysis.signals.header import Severity
from analysis.signals.snapshot import OVERALL, TachoReport, TachoState
from analysis.signals.units import RPM
from analysis.vectors.speed_curve import SpeedRow
from analysis.whirl.findings import WhirlFinding
from daq.reports.run_summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema, alarm_schema
from daq.schemas.summary import SummarySchema, summary_schema
from daq.schemas.units import utc_time
from daq.session.live_update import LiveUpdate
from daq.session.predictor import Predictors
from model.prediction.comparison import Agreement, PredictedWhirl, SynchronousAgreement, WhirlAgreement
from recordings.catalogue.catalogue import Catalogue, RunEntry
from recordings.catalogue.run_store import Search
from recordings.errors import NotFoundError
from recordings.mcap.results import MarkerKind
from tests.daq.support.live_updates import make_header

NEWEST = "2026-11-24T09-12-07-gj90c"
CUT = "2026-11-23T10-00-00-gj90c"
OTHER_RIG = "2026-11-22T10-00-00-bench2"
UNREADABLE = "2026-11-21T10-00-00-gj90c"


def make_entry(run: str = NEWEST, *, rig: str = "gj90c", is_complete: bool = True, fault: str = "") -> RunEntry:
    """Return a run as the catalogue lists it."""
    header = make_header(run)
    return RunEntry(
        id=run,
        path=Path(f"{run}.mcap"),
        size=154_000_000,
        modified_ns=header.started_ns,
        header=type(header)(
            run=run,
            rig=rig,
            started_ns=header.started_ns,
            acquisition=header.acquisition,
            settings=header.settings,
            limits=header.limits,
            config_toml="",
            program="rig 0.1.0",
            note="after the oil change",
        ),
        duration=300.0,
        samples=60_000_000,
        is_complete=is_complete,
        is_gap_free=is_complete,
        fault=fault,
    )


def make_entries() -> list[RunEntry]:
    """Return four runs: complete, truncated, of another rig, and unreadable."""
    unreadable = RunEntry(
        UNREADABLE, Path("u.mcap"), 12, 1_795_000_000_000_000_000, fault="u.mcap: 12 bytes, no MCAP file"
    )
    return [
        make_entry(),
        make_entry(CUT, is_complete=False, fault="not finished"),
        make_entry(OTHER_RIG, rig="bench2"),
        unreadable,
    ]


def make_summary() -> RunSummary:
    """Return the summary of a run-up with one component below 1X; some values are unknown."""

    def at(time: float, speed_rpm: float) -> TimeInRun:
        return TimeInRun(0, time, speed_rpm * RPM)

    def row(speed_rpm: float, order: float, amplitude: float) -> SpeedRow:
        vectors = np.array([[10e-6 * np.exp(-0.5j), 11e-6 * np.exp(1j)], [1e-6, complex(math.nan, 0.0)]])
        two = np.array([[30e-6, 31e-6]] * len(OVERALL.rows))
        scatter, compensated = np.full((2, 2), 4e-7), np.full((2, 2), complex(math.nan))
        sizes = (two, 1.1 * two, 5e-8, amplitude, order)
        return SpeedRow(RampDirection.RUN_UP, speed_rpm * RPM, 24, vectors, scatter, *sizes, compensated)

    largest, none = (96.1e-6,) * len(OVERALL.rows), (0.0,) * len(OVERALL.rows)
    return RunSummary(
        run=NEWEST,
        rig="gj90c",
        note="after the oil change",
        started_ns=1_795_511_527_000_000_000,
        duration=300.0,
        samples=60_000_000,
        lost=2000,
        lost_is_exact=False,
        segments=(
            SegmentEnd(0, 40_000_000, EndReason.OVERRUN, 2000, lost_is_exact=False, detail="driver code -200279"),
            SegmentEnd(1, 20_000_000, EndReason.FINISHED),
        ),
        lowest_speed=1004.0 * RPM,
        highest_speed=math.nan,
        probes=(
            ProbeSummary("x", 5.02, 4.97, 5.08, True, largest, at(280.0, 15_060.0), Severity.DANGER),
            ProbeSummary("y", math.nan, math.nan, math.nan, False, none, None, Severity.NORMAL),
        ),
        clipped=(0, 3, 0),
        snapshots=3000,
        frames=2950,
        tacho=TachoReport(TachoState.GOOD, 40_210, 1, 2, math.nan),
        tacho_states={"good": 2980, "no pulses": 20},
        rows=(row(10_000.0, math.nan, math.nan), row(11_025.0, 0.49, 12.1e-6)),
        whirls=(
            WhirlFinding(0.49, 0.492, at(98.0, 10_980.0), at(150.0, 13_900.0), 14.2e-6, at(140.0, 13_500.0), True, 212),
        ),
    )


def make_agreement() -> Agreement:
    """Return the agreement with the model: 1X agrees up to 14,000 r/min, one of two whirls was measured."""
    return Agreement(
        synchronous=SynchronousAgreement(
            speeds=52,
            median_ratio=0.97,
            worst_ratio=1.31,
            worst_ratio_speed=14_800.0 * RPM,
            median_phase=math.radians(3.2),
            worst_phase=math.radians(-24.0),
            worst_phase_speed=14_900.0 * RPM,
            agrees_to=14_000.0 * RPM,
            within_ratio=0.08,
            within_phase=math.radians(11.0),
        ),
        whirls=(
            WhirlAgreement(PredictedWhirl(0.7, 9500.0 * RPM, 18_000.0 * RPM, 22e-6), make_summary().whirls[0], True),
            WhirlAgreement(PredictedWhirl(0.2, 18_100.0 * RPM, 20_000.0 * RPM, 60e-6), None, False),
        ),
        instability_onset=math.nan,
    )


class FakeCatalogue(Catalogue):
    """Catalogue of given entries; raises ``trouble`` if set."""

    def __init__(self, entries: list[RunEntry], folder: Path) -> None:
        super().__init__(folder)
        self.entries = entries
        self.trouble: Exception | None = None

    def runs(self) -> list[RunEntry]:
        if self.trouble is not None:
            raise self.trouble
        return self.entries

    def search(self, search: Search) -> list[RunEntry]:
        return [entry for entry in self.runs() if search.text in entry.id]

    def run(self, run_id: str) -> RunEntry:
        for entry in self.runs():
            if entry.id == run_id:
                return entry
        raise NotFoundError(f"run {run_id!r}: there is no such run in data")


class FakeLive:
    """Live run with a settable update; records which runs it stopped."""

    def __init__(self) -> None:
        self.update: LiveUpdate | None = None
        self.stopped: list[str] = []

    def latest(self) -> LiveUpdate | None:
        return self.update

    def stop(self) -> str | None:
        if self.update is None:
            return None
        self.stopped.append(self.update.header.run)
        return self.update.header.run

    def add_marker(self, text: str) -> MarkerSchema | None:
        if self.update is None:
            return None
        marked_at = utc_time(1_795_511_527_250_000_000)
        return MarkerSchema(kind=MarkerKind.NOTE, text=text, segment=0, time_s=1.0, marked_at=marked_at)

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        if self.update is None:
            return None
        alarms = tuple(alarm_schema(alarm) for alarm in self.update.status.alarms)
        return AcknowledgedAlarmsSchema(run=self.update.header.run, alarms=alarms)


class FakeSummaries(Summaries):
    """Returns one summary; raises ``trouble`` if set, and waits for ``gate``."""

    def __init__(self, catalogue: FakeCatalogue) -> None:
        super().__init__(catalogue, Predictors())
        self.catalogue = catalogue
        self.trouble: Exception | None = None
        self.gate = threading.Event()
        self.gate.set()

    def summary(self, run_id: str) -> SummarySchema:
        self.catalogue.run(run_id)
        self.gate.wait(60.0)
        if self.trouble is not None:
            raise self.trouble
        return summary_schema(make_summary(), make_agreement())
