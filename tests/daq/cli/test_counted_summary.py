"""Preflight, status line, summary and export of a run whose tacho edges are timed by a counter."""

import datetime as dt
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from analysis.preflight.check_result import Verdict
from analysis.signals.snapshot import CounterState
from daq.cli.run_text import print_summary, status_line
from daq.schemas.summary import summary_schema
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.session.offline import summarise
from daq.session.preflight import PlannedRun, run_preflight_checks
from recordings.errors import ForeignFormatError
from recordings.exchange.export import pulses_table
from recordings.mcap.reader import RunReader
from tests.daq.support.counted_bench import (
    RISING,
    RigFactory,
    analysed,
    counted,
    header_of,
    items_of,
    recorded,
    ticks_of,
)


@pytest.fixture(name="counted")
def counted_rigs(rig: RigFactory) -> RigFactory:
    return partial(counted, rig)


def test_counter_on_the_wrong_edge_is_reported(rig: RigFactory, tmp_path: Path) -> None:
    wrong = rig(tacho={"counter": {"edge": "falling"}}, simulation=RISING)
    snapshot = analysed(header_of(wrong, tmp_path), items_of(wrong))[-1]
    assert snapshot.counter is not None
    assert snapshot.counter.state is not CounterState.AGREES
    assert snapshot.counter.largest_difference > 1e-3


@pytest.mark.parametrize("miswiring", ["tacho silent", "tacho reversed", "tacho weak"])
def test_silent_tacho_gives_no_counter_edges(counted: RigFactory, miswiring: str) -> None:
    rig = counted(simulation={**RISING, "miswiring": miswiring})
    assert ticks_of(items_of(rig)).size == 0


def test_counter_edges_are_exported_with_their_times(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    path = recorded(rig, tmp_path)
    truth = ticks_of(items_of(rig))
    with RunReader(path) as reader:
        whole, part = pulses_table(reader), pulses_table(reader, 1.0, 2.0)
        np.testing.assert_array_equal(whole.column("ticks").values, truth)
        np.testing.assert_array_equal(whole.column("time_s").values, truth / 80e6)
        times = part.column("time_s").values.astype(np.float64)
        assert 0 < times.size < truth.size
        assert ((times >= 1.0) & (times < 2.0)).all()
        with pytest.raises(ForeignFormatError, match="no counter timestamps"):
            pulses_table(reader, 100.0, 200.0)


def test_run_without_a_counter_has_no_edges_to_export(rig: RigFactory, tmp_path: Path) -> None:
    with (
        RunReader(recorded(rig(), tmp_path)) as reader,
        pytest.raises(ForeignFormatError, match="no counter timestamps"),
    ):
        pulses_table(reader)


def test_preflight_checks_the_counter(counted: RigFactory, tmp_path: Path) -> None:
    good = run_preflight_checks(counted(), PlannedRun(tmp_path), dt.date(2026, 11, 22), lambda _: None)
    (check,) = (check for check in good.checks if check.name == "tacho counter")
    assert check.verdict is Verdict.GOOD
    silent = counted(simulation={**RISING, "miswiring": "tacho silent"})
    bad = run_preflight_checks(silent, PlannedRun(tmp_path), dt.date(2026, 11, 22), lambda _: None)
    assert [check.verdict for check in bad.checks if check.name == "tacho counter"] == [Verdict.WARN]


def test_summary_names_the_source_of_the_speed(
    counted: RigFactory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with RunReader(recorded(counted(), tmp_path)) as reader:
        document = summary_schema(summarise(reader), None)
    assert document.tacho is not None
    assert document.tacho.reference == "counter"
    assert document.tacho.counter is not None
    assert (document.tacho.counter.state, document.tacho.counter.message) == (CounterState.AGREES, "")
    print_summary(document, as_json=False)
    assert "\ntacho            speed and phase from the counter; " in capsys.readouterr().out


def test_status_line_shows_a_counter_that_disagrees(rig: RigFactory, tmp_path: Path) -> None:
    for edge, is_named in (("rising", False), ("falling", True)):
        chosen = rig(tacho={"counter": {"edge": edge}}, simulation=RISING)
        header = header_of(chosen, tmp_path)
        frame = LiveUpdate(header, Status(RunState.RECORDING), analysed(header, items_of(chosen))[-1])
        assert ("tacho counter: count differs, " in status_line(frame)) is is_named
        assert (" in the last 10 s" in status_line(frame)) is is_named
