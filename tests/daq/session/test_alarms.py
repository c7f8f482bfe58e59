"""Alarms of a run: live, in its file, summary and replay."""

import json
import re
from pathlib import Path

import pytest

from analysis.signals.header import Severity
from analysis.signals.units import MICROMETRE, RPM
from daq.cli.main import main
from daq.cli.run_text import status_line
from daq.drivers.replay import ReplaySource
from daq.session.live_update import acknowledgement_marker, alarm_name, alarm_text
from daq.session.offline import summarise
from daq.session.replayed_run import ReplayedRun
from daq.view.status import worst_alarm
from recordings.integrity.verify import verify
from recordings.mcap.reader import RunReader
from recordings.mcap.results import MarkerKind
from tests.daq.conftest import RigFactory
from tests.daq.support.live_updates import make_live_updates, with_alarm, with_further_alarms
from tests.daq.support.recorded_bench import open_recorded_bench
from tests.daq.support.recording import REAL_TIME, NoModel, UpdateList, start_recording, wait_until

LOW_LIMIT = {"peak_to_peak_alarm_um": 1.0, "peak_to_peak_danger_um": 90.0, "hold_s": 0.3}


def test_alarm_starts_after_its_hold_time_and_is_recorded_and_acknowledged(rig: RigFactory, tmp_path: Path) -> None:
    updates = UpdateList()
    run = start_recording(rig(simulation=REAL_TIME, limits=LOW_LIMIT), tmp_path, updates)
    wait_until(lambda: len(run.latest().status.alarms) == 2)
    assert {alarm.probe for alarm in run.latest().status.alarms} == {"x", "y"}
    acknowledged = run.acknowledge()
    assert [alarm.number for alarm in acknowledged] == [1, 2]
    assert run.acknowledge() == ()
    assert run.wait(60)
    run.close()
    first = next(update for update in updates.updates if update.status.alarms)
    assert first.snapshot is not None
    assert first.snapshot.time == pytest.approx(0.4)  # the limit is exceeded 0.1 s after the start
    last = run.latest().status
    assert (last.severity, last.latched) == (Severity.ALARM, Severity.ALARM)  # the condition persists
    assert last.acknowledged == 2
    with RunReader(run.path) as reader:
        markers = reader.markers()
        summary = summarise(reader)
    assert [marker.kind for marker in markers] == [MarkerKind.ALARM, MarkerKind.ALARM, MarkerKind.ACKNOWLEDGED]
    assert markers[0].sample == 8000
    assert markers[0].text.startswith("alarm at ")
    assert "µm peak-to-peak, limit 1, at " in markers[0].text
    assert markers[2].text == f"acknowledged alarm at {acknowledged[0].probe}, alarm at {acknowledged[1].probe}"
    assert [(alarm.probe, alarm.begin.time) for alarm in summary.alarms] == [("x", 0.4), ("y", 0.4)]
    assert summary.alarms == run.summary().alarms
    assert verify(run.path).findings == ()


def test_replay_gives_the_same_alarms_unacknowledged(rig: RigFactory, tmp_path: Path) -> None:
    run = start_recording(rig(limits=LOW_LIMIT), tmp_path)
    assert run.wait(60)
    run.acknowledge()
    run.close()
    with RunReader(run.path) as reader:
        header, expected = reader.header, summarise(reader).alarms
    source = ReplaySource(run.path, None)
    replayed = ReplayedRun(header, source, NoModel())
    assert replayed.wait(60)
    assert replayed.summary().alarms == expected
    assert replayed.latest().status.alarms == expected
    assert len(replayed.acknowledge()) == 2
    assert replayed.latest().status.acknowledged == 2
    replayed.close()


@pytest.mark.parametrize(("latch", "latched"), [(True, Severity.ALARM), (False, Severity.NORMAL)])
def test_alarm_that_is_over_stays_shown_where_latching_is_configured(
    rig: RigFactory, tmp_path: Path, *, latch: bool, latched: Severity
) -> None:
    profile = [(0.0, 9000.0), (1.0, 9000.0), (2.0, 2000.0), (3.0, 2000.0)]
    falling = {"profile": [{"time_s": time_s, "speed_rpm": speed_rpm} for time_s, speed_rpm in profile]}
    first = start_recording(rig(simulation=falling), tmp_path)
    assert first.wait(60)
    first.close()
    overall = [float(row.largest_overall[0].max()) / MICROMETRE for row in first.summary().rows]
    limits = {"peak_to_peak_alarm_um": 0.5 * (min(overall) + max(overall)), "hold_s": 0.0, "latch": latch}
    (tmp_path / "again").mkdir()
    run = start_recording(rig(simulation=falling, limits=limits), tmp_path / "again")
    assert run.wait(60)
    run.close()
    status = run.latest().status
    assert (status.severity, status.latched) == (Severity.NORMAL, latched)
    assert [alarm.is_active for alarm in run.summary().alarms] == [False] * len(run.summary().alarms)
    assert run.summary().alarms


def test_alarm_texts_name_quantity_probe_value_and_limit() -> None:
    update = with_further_alarms(make_live_updates(1)[0])
    one, below, speed = update.status.alarms
    assert alarm_text(one) == "1X alarm at x: 24 µm peak, limit 20, at 12,000 r/min"
    assert alarm_text(below) == "below 1X alarm at y: 14.1 µm peak, limit 12.5, at 12,000 r/min"
    assert alarm_text(speed) == "speed danger: 19,642 r/min, limit 19,500"
    assert acknowledgement_marker((one, speed), 0, 1, 2).text == "acknowledged 1X alarm at x, speed danger"
    assert worst_alarm((one, below, speed)) == "DANGER 19,642 r/min"
    assert worst_alarm((one, below)) == "ALARM 1X x 24 µm"
    assert worst_alarm((below,)) == "ALARM below 1X y 14 µm"
    assert "pp  DANGER speed" in status_line(update)


def test_overspeed_and_1x_alarms_are_in_the_file_the_summary_and_on_the_terminal(
    rig: RigFactory, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = [(0.0, 3000.0), (1.0, 9000.0), (2.0, 9000.0), (3.5, 2000.0)]
    simulation = {"profile": [{"time_s": time_s, "speed_rpm": speed_rpm} for time_s, speed_rpm in profile]}
    limits = {"speed_danger_rpm": 8_000.0, "order_1x_peak_alarm_um": 0.5, "hold_s": 0.2}
    run = start_recording(rig(simulation=simulation, limits=limits), tmp_path)
    assert run.wait(60)
    run.close()
    by_name = {alarm_name(alarm): alarm for alarm in run.summary().alarms}
    assert {"1X alarm at x", "1X alarm at y", "speed danger"} == set(by_name)
    overspeed = by_name["speed danger"]
    assert overspeed.begin.time == pytest.approx(0.9)  # 8,000 r/min at 0.83 s, without hold time
    assert overspeed.end is not None
    assert overspeed.end.speed < 0.95 * 8_000.0 * RPM
    with RunReader(run.path) as reader:
        texts = [marker.text for marker in reader.markers()]
        assert summarise(reader).alarms == run.summary().alarms
    assert any(text.startswith("speed danger: ") and text.endswith("r/min, limit 8,000") for text in texts)
    assert main(["summary", str(run.path)]) == 0
    output = capsys.readouterr().out
    assert re.search(
        r"alarm +speed DANGER from 0\.9 s, 8,\d+ r/min until \d\.\d s, up to 9,0\d\d r/min, limit 8,000", output
    )
    assert re.search(r"alarm +1X ALARM at x from .* µm peak, limit 0\.5", output)


def test_alarms_are_acknowledged_by_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench = open_recorded_bench(tmp_path)
    bench.live.update = with_alarm(make_live_updates(1)[0], Severity.DANGER)
    port = ["--port", str(bench.client.base_url.port)]
    assert main(["acknowledge", *port]) == 0
    assert capsys.readouterr().out == "acknowledged danger at x: 92 µm peak-to-peak, limit 90\n"
    assert main(["acknowledge", "--json", *port]) == 0
    assert json.loads(capsys.readouterr().out)["alarms"][0]["probe"] == "x"
    bench.close()
