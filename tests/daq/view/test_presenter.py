"""What is logged of a run: every plot has its data, measured and predicted, at the run's time."""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from analysis.signals.header import Severity
from analysis.signals.snapshot import OVERALL, TachoState
from daq.colours import ALARM, DANGER, MARKER, MEASURED_X, MEASURED_Y, MODEL, TACHO, Color
from daq.session.live_update import Clipping, LiveUpdate, RunState, Status, TimedMarker
from daq.view.drawing import MODEL_DASH, Drawing, text_strokes, text_width
from daq.view.presenter import Presenter, timeline
from daq.view.spectra import COLUMNS, FONT_SIZE, HIGHEST_MAP_ORDER, ROWS, SpectrumPlot
from daq.view.status import details
from daq.view.waveforms import TrendPlot
from recordings.mcap.results import Marker, MarkerKind
from tests.daq.support.live_updates import (
    RATE,
    make_header,
    make_live_updates,
    with_alarm,
    with_runout,
    with_second_whirl,
)

RUN = timeline(make_header())
DRAWN = {
    "/banner",
    "/details",
    "/spectrum/labels",
    "/trend/axes",
    "/trend/lines",
    *(
        f"/{plot}/{part}"
        for plot in ("orbit", "spectrum", "cascade", "waterfall", "bode")
        for part in ("axes", "model")
    ),
    *(f"/{plot}/measured" for plot in ("orbit", "spectrum", "cascade", "waterfall", "bode")),
    "/traces/axes",
    "/traces/lines",
}


class Logged:
    """What a presenter logged of some frames, read back from a file."""

    def __init__(self, updates: Iterable[LiveUpdate], path: Path) -> None:
        stream = rr.RecordingStream("rig")
        stream.set_sinks(rr.FileSink(path))
        presenter = Presenter(stream, make_header())
        for update in updates:
            presenter.show(update)
        stream.flush()
        stream.disconnect()
        self.path = path

    def rows(self, entity: str) -> list[dict[str, Any]]:
        """The rows of an entity, as columns by name."""
        chunks = RrdReader(self.path).stream().filter(content=entity)
        rows = []
        for chunk in chunks:
            batch = chunk.to_record_batch()
            names = [name for name in batch.schema.names if name not in {"rerun.controls.RowId", "log_time", RUN}]
            columns = {name: batch.column(name).to_pylist() for name in names}
            if RUN in batch.schema.names:
                columns[RUN] = [ns / 1e9 for ns in batch.column(RUN).cast("int64").to_pylist()]
            rows += [{name: column[k] for name, column in columns.items()} for k in range(batch.num_rows)]
        return sorted(rows, key=lambda row: float(row.get(RUN, 0.0)))

    def entities(self) -> set[str]:
        return {chunk.entity_path for chunk in RrdReader(self.path).stream() if not chunk.entity_path.startswith("/__")}

    def strips(self, entity: str, color: Color) -> list[NDArray[np.float64]]:
        """The strips of the last row of an entity that have a colour."""
        row = self.rows(entity)[-1]
        red, green, blue, alpha = color
        wanted = (red << 24) | (green << 16) | (blue << 8) | alpha
        pairs = zip(row["LineStrips2D:strips"], row["LineStrips2D:colors"], strict=True)
        return [np.array(strip) for strip, code in pairs if code == wanted]


@pytest.fixture(autouse=True)
def _strict() -> Iterator[None]:
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture(scope="module")
def run_up(tmp_path_factory: pytest.TempPathFactory) -> Logged:
    """A run-up to 15,600 r/min, cut where 0.49X stands beside the model's 0.70X."""
    return Logged(make_live_updates(120)[:101], tmp_path_factory.mktemp("view") / "run.rrd")


def test_every_entity_of_every_plot_has_data(run_up: Logged) -> None:
    assert run_up.entities() - {"/"} == DRAWN


@pytest.mark.parametrize("plot", ["orbit", "spectrum", "bode"])
def test_measured_and_predicted_are_drawn_in_their_colours(run_up: Logged, plot: str) -> None:
    assert any(len(strip) > 20 for strip in run_up.strips(f"/{plot}/measured", MEASURED_X))
    dashes = run_up.strips(f"/{plot}/model", MODEL)
    assert len(dashes) > 20  # distinguishable from measured curves without colour
    lengths = [float(np.hypot(*np.diff(dash, axis=0).T).sum()) for dash in dashes]
    assert float(np.median(lengths)) < 4.0 * MODEL_DASH


def test_dashes_of_closed_orbit_coincide(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    assert update.prediction is not None
    angle = 2.0 * math.pi * np.arange(4 * 64) / 64
    closed = replace(update.prediction, orbit=8e-6 * np.stack([np.cos(angle), np.sin(angle)]))
    logged = Logged([replace(update, prediction=closed)], tmp_path / "closed.rrd")
    arcs = [strip for strip in logged.strips("/orbit/model", MODEL) if np.allclose(np.hypot(*strip.T), 80.0, atol=0.1)]
    middles = {round(16.0 * float(np.arctan2(*arc.mean(axis=0))) / math.pi, 1) % 2.0 for arc in arcs}
    assert len(arcs) == 4 * 16
    assert len(middles) == 1


def test_both_probes_have_separate_lines(run_up: Logged) -> None:
    for entity in ("/spectrum/measured", "/bode/measured", "/traces/lines"):
        for color in (MEASURED_X, MEASURED_Y):
            assert any(len(strip) > 20 for strip in run_up.strips(entity, color))
    assert any(len(strip) > 10 for strip in run_up.strips("/traces/lines", TACHO))


def test_predicted_whirl_is_drawn_on_cascade_at_its_order(run_up: Logged) -> None:
    line = max(run_up.strips("/cascade/model", MODEL), key=len)
    assert np.allclose(line[:, 0], 0.70 / HIGHEST_MAP_ORDER * COLUMNS, atol=1e-3)


def test_cascade_fills_rows_skipped_by_fast_run_up(tmp_path: Path) -> None:
    logged = Logged(make_live_updates(60)[:49], tmp_path / "fast.rrd")  # 247 r/min from frame to frame, 200 r/min a row
    row = logged.rows("/cascade/measured")[-1]
    picture = np.array(row["Image:buffer"], dtype=np.uint8).reshape(ROWS, COLUMNS, 3).sum(axis=2)
    at_1x = picture[:, round(COLUMNS / HIGHEST_MAP_ORDER)].astype(int)
    assert np.all(at_1x[40:60] > 250)  # 8,000 to 12,000 r/min


def test_banner_shows_lost_samples_and_error(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    status = replace(
        update.status,
        state=RunState.FAILED,
        lost=12_345,
        lost_is_exact=False,
        detail="unplugged",
        latched=Severity.DANGER,
    )
    logged = Logged([replace(update, status=status)], tmp_path / "failed.rrd")
    assert logged.strips("/banner", ALARM)
    assert len(logged.strips("/banner", DANGER)) > 10
    assert "at least 12,345" in str(logged.rows("/details")[-1]["TextDocument:text"][0])


def test_banner_shows_measurement_warnings(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    assert update.snapshot is not None
    clipped = replace(update.status, clipped=(Clipping("y", 1234, 3, 0.1),))
    irregular = replace(update.snapshot.tacho, state=TachoState.IRREGULAR)
    for name, doubtful in (
        ("clipped", replace(update, status=clipped)),
        ("gap", replace(update, snapshot=replace(update.snapshot, gap_in_window=np.array([True, False])))),
        ("tacho", replace(update, snapshot=replace(update.snapshot, tacho=irregular))),
    ):
        assert Logged([doubtful], tmp_path / f"{name}.rrd").strips("/banner", ALARM), name
    assert not Logged([update], tmp_path / "good.rrd").strips("/banner", ALARM)


def test_spectrum_labels_do_not_overlap() -> None:
    plot = SpectrumPlot()
    for update in map(with_second_whirl, make_live_updates(200)[::8]):
        assert update.snapshot is not None
        plot.follow(update)
        placed = plot.placed_labels(update.snapshot.frame, update.prediction)
        assert len(placed) >= 2
        for (left, bottom, name, _), (its_left, its_bottom, its_name, _) in itertools.combinations(placed, 2):
            right, its_right = (
                start + FONT_SIZE * text_width(word) for start, word in ((left, name), (its_left, its_name))
            )
            beside = right < its_left or its_right < left
            assert beside or abs(bottom - its_bottom) > 1.2 * FONT_SIZE, (name, its_name)


def test_external_message_is_drawn_with_available_glyphs() -> None:
    box = text_strokes("\u4e00")
    for letter in "no samples; é ö “x” … ≥ → # & *":
        assert letter == " " or str(text_strokes(letter)) != str(box), letter


def test_updates_are_on_timeline_of_their_run(run_up: Logged) -> None:
    times = [row[RUN] for row in run_up.rows("/orbit/measured")]
    assert np.allclose(times, 0.1 * np.arange(1, 102, 3))


def test_orbit_is_drawn_with_y_up(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    assert update.snapshot is not None
    assert update.snapshot.frame is not None
    angle = 2.0 * math.pi * np.arange(256) / 64
    orbit = 8e-6 * np.stack([0.5 * np.cos(angle), np.sin(angle)])  # on the axis Y at a quarter of a turn
    snapshot = replace(update.snapshot, frame=replace(update.snapshot.frame, orbit=orbit))
    logged = Logged([replace(update, snapshot=snapshot, prediction=None)], tmp_path / "orbit.rrd")
    line = max(logged.strips("/orbit/measured", MEASURED_X), key=len)
    top = line[np.argmin(line[:, 1])]  # the viewer's y points down
    assert np.allclose(top, (0.0, -80.0), atol=1e-3)  # 8 µm on a scale of 10 µm, 100 units long
    assert math.isclose(line[:, 0].max(), 40.0, abs_tol=0.1)


def test_cascade_is_bright_at_1x_up_to_the_speed_reached(run_up: Logged) -> None:
    row = run_up.rows("/cascade/measured")[-1]
    picture = np.array(row["Image:buffer"], dtype=np.uint8).reshape(ROWS, COLUMNS, 3).sum(axis=2)
    at_1x = picture[:, round(COLUMNS / HIGHEST_MAP_ORDER)]
    reached = round((1.0 - 13_000.0 / 20_000.0) * ROWS)
    assert at_1x[reached + 3] > 300  # 12,400 r/min
    assert np.all(at_1x[: reached - 5] == picture.min())  # above 14,000 r/min nothing has been


def test_updates_without_snapshot_prediction_or_speed_are_drawn(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    assert update.snapshot is not None
    still = replace(update.snapshot, speed=math.nan, frame=None)
    starting = LiveUpdate(update.header, Status(RunState.STARTING))
    logged = Logged(
        [starting] * 20 + [replace(update, snapshot=still, prediction=None)] * 20 + [update], tmp_path / "few.rrd"
    )
    assert logged.entities() - {"/"} >= {"/banner", "/orbit/axes", "/spectrum/axes", "/details"}


def test_latched_alarm_stays_on_banner(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    quiet = Logged([update], tmp_path / "quiet.rrd")
    latched = Logged([with_alarm(update, Severity.ALARM)], tmp_path / "latched.rrd")
    assert not quiet.strips("/banner", ALARM)
    assert latched.strips("/banner", ALARM)


def marked(updates: list[LiveUpdate], *markers: TimedMarker) -> list[LiveUpdate]:
    return [replace(update, status=replace(update.status, markers=markers)) for update in updates]


def test_marker_is_labelled_line_in_trend_and_waterfall(tmp_path: Path) -> None:
    updates = make_live_updates(120)[:97]  # trend and waterfall are drawn with every 24th, so with the last
    elapsed = updates[-1].status.elapsed
    word = TimedMarker(Marker(0, round((elapsed - 3.0) * RATE), "knocking", 0), elapsed - 3.0, elapsed - 3.0)
    came = TimedMarker(Marker(0, 0, "alarm at x", 0, MarkerKind.ALARM), elapsed - 5.0, elapsed - 5.0)
    logged = Logged(marked(updates, word, came), tmp_path / "marked.rrd")
    unmarked = Logged(updates, tmp_path / "unmarked.rrd")
    for color, before in ((MARKER, 3.0), (ALARM, 5.0)):
        upright = [line for line in logged.strips("/trend/lines", color) if len(line) == 2 and np.ptp(line[:, 0]) == 0]
        across = 300.0 * (1.0 - before / 60.0)  # of the plot's width, which shows the last minute
        long = [line for line in upright if np.ptp(line[:, 1]) > 50.0]
        assert [line[0, 0] for line in long] == pytest.approx([across, across], abs=1e-3)
        level = [line for line in logged.strips("/waterfall/model", color) if np.ptp(line[:, 0]) > 100.0]
        assert [line[0, 1] for line in level] == pytest.approx([ROWS * before / 60.0], abs=1e-3)
        assert len(logged.strips("/trend/lines", color)) > 8  # the strokes of its word
        assert not unmarked.strips("/trend/lines", color)


def test_marker_is_drawn_on_traces_at_its_time(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    assert update.snapshot is not None
    trace = update.snapshot.trace
    at = float(trace.time[-1]) - 0.01
    marker = TimedMarker(Marker(update.snapshot.segment, round(at * RATE), "now", 0), at, update.status.elapsed - 0.01)
    other = TimedMarker(
        Marker(update.snapshot.segment + 1, round(at * RATE), "elsewhere", 0), at, update.status.elapsed
    )
    here = Logged(marked([update], marker), tmp_path / "here.rrd")
    assert len([line for line in here.strips("/traces/lines", MARKER) if np.ptp(line[:, 1]) > 30.0]) == 2
    assert not Logged(marked([update], other), tmp_path / "there.rrd").strips("/traces/lines", MARKER)


def test_trend_retains_maxima_and_switches_to_minutes() -> None:
    plot = TrendPlot()
    update = make_live_updates(1)[0]
    assert update.snapshot is not None
    for k in range(1200):
        spike = 90e-6 if k == 1003 else 10e-6
        snapshot = replace(update.snapshot, overall=np.array([[spike, 5e-6]] * len(OVERALL.rows)))
        plot.add(replace(at_time(update, 0.1 * k), snapshot=snapshot, prediction=None))
    span, end, _ = plot.follow(at_time(update, 119.9))
    assert span == 300.0
    lines = plot.layers(at_time(update, 119.9))["lines"]
    assert isinstance(lines, Drawing)
    highest = min(strip[:, 1].min() for strip in _strips(lines))
    assert highest == pytest.approx(90.0 * (1.0 - 90.0 / end), abs=0.5)
    assert plot.follow(at_time(update, 12.0))[0] == 60.0
    assert plot.follow(at_time(update, 1e5))[0] == 1800.0


def at_time(update: LiveUpdate, elapsed: float) -> LiveUpdate:
    return replace(update, status=replace(update.status, elapsed=elapsed))


def _strips(drawing: Drawing) -> list[NDArray[np.float64]]:
    strips = drawing.archetype().strips
    assert strips is not None
    return [np.array(strip) for strip in strips.as_arrow_array().to_pylist()]


def test_orbit_and_details_show_compensated_and_measured(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    plain = Logged([update], tmp_path / "plain.rrd")
    taken_off = Logged([with_second_whirl(with_runout(update))], tmp_path / "compensated.rrd")
    raw = plain.strips("/orbit/measured", MEASURED_X)
    compensated = taken_off.strips("/orbit/measured", MEASURED_X)
    assert len(compensated) > len(raw)  # the word in the orbit's colour
    assert not np.allclose(max(raw, key=len)[:50], max(compensated, key=len)[:50])
    text = str(taken_off.rows("/details")[-1]["TextDocument:text"][0])
    assert "| compensated |" in text
    assert "0.31X 3.2 µm backward" in text
    assert "compensated" not in str(plain.rows("/details")[-1]["TextDocument:text"][0])


def test_details_show_uncertainty_of_1x() -> None:
    update = make_live_updates(1)[0]
    assert "| **1X** peak, lag ± 0.07 µm, 80° |" in details(update)
    assert "| compensated ± 0.08 µm, 2° |" in details(with_runout(update))


def test_details_show_measured_and_predicted_components_below_1x(run_up: Logged) -> None:
    text = str(run_up.rows("/details")[-1]["TextDocument:text"][0])
    assert "0.49X" in text
    assert "forward (model 0.70X" in text
    assert "lost **0**" in text


def test_details_contain_only_characters_of_viewer_font(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    update = replace(update, status=replace(update.status, detail="Öl ∠ 油"))
    logged = Logged([update], tmp_path / "letters.rrd")
    assert "Öl ? ?" in str(logged.rows("/details")[-1]["TextDocument:text"][0])


def test_axes_are_repeated_for_late_viewers(run_up: Logged) -> None:
    assert len(run_up.rows("/cascade/axes")) >= 2


def test_axes_are_repeated_by_time_if_few_updates_are_drawn(tmp_path: Path) -> None:
    update = make_live_updates(1)[0]
    logged = Logged([at_time(update, 2.0 * k) for k in range(25)], tmp_path / "slow.rrd")
    assert [row[RUN] for row in logged.rows("/cascade/axes")] == [0.0, 24.0, 48.0]  # every 12th update is drawn


def test_logged_data_rate_is_limited(run_up: Logged) -> None:
    assert run_up.path.stat().st_size / 10.1 < 500e3  # bytes a second of run
