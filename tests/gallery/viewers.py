"""Write a Foxglove layout and a rerun blueprint that show a run.

    python tests/gallery/viewers.py docs/viewers

Each plot is defined once; the fields are those of recordings/mcap/rig.proto.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

APPLICATION = "rig"
COLOURS = ((57, 135, 229), (12, 163, 12), (250, 178, 25), (213, 81, 129))


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot: label and message path of each line, against time or against the message path x.

    With `is_momentary` it shows the arrays of the message at the playback time, else the whole run.
    """

    title: str
    lines: dict[str, str]
    y_label: str
    x: str = ""
    x_label: str = ""
    is_momentary: bool = False


TRENDS = (
    Plot("Speed", {"speed": "/features.speed_rpm"}, "r/min"),
    Plot(
        "Vibration",
        {"x": "/features.peak_to_peak_x_um", "y": "/features.peak_to_peak_y_um"},
        "µm peak-to-peak",
    ),
    Plot("1X", {"x": "/features.x_1x_um", "y": "/features.y_1x_um"}, "µm peak"),
    Plot("1X lag", {"x": "/features.x_1x_lag_deg", "y": "/features.y_1x_lag_deg"}, "deg"),
    Plot("Below 1X", {"whirl": "/features.whirl_um"}, "µm peak"),
    Plot("Gap", {"x": "/features.gap_x_v", "y": "/features.gap_y_v"}, "V"),
)
PICTURES = (
    Plot(
        "Orbit",
        {"orbit": "/order_frame.orbit_y_um[:]"},
        "y, µm",
        x="/order_frame.orbit_x_um[:]",
        x_label="x, µm",
        is_momentary=True,
    ),
    Plot(
        "Order spectrum",
        {"x": "/order_frame.spectrum_x_um[:]", "y": "/order_frame.spectrum_y_um[:]"},
        "µm peak",
        x="/order_frame.orders[:]",
        x_label="order",
        is_momentary=True,
    ),
    Plot(
        "1X over speed",
        {"x": "/features.x_1x_um", "y": "/features.y_1x_um"},
        "µm peak",
        x="/features.speed_rpm",
        x_label="r/min",
    ),
)


STATES = {"marker": "/mark.text", "tacho": "/features.tacho_state"}


def foxglove_layout() -> dict[str, Any]:
    """Return the layout: trends and states on the left, plots against other quantities on the right."""
    panels = {f"Plot!{number}": _panel(plot) for number, plot in enumerate((*TRENDS, *PICTURES))}
    names = list(panels)
    states = {
        "foxglovePanelTitle": "Marks",
        "paths": [{"value": path, "label": label, "timestampMethod": "receiveTime"} for label, path in STATES.items()],
        "isSynced": True,
    }
    return {
        "configById": panels | {"StateTransitions!0": states},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": _column([*names[: len(TRENDS)], "StateTransitions!0"]),
            "second": _column(names[len(TRENDS) :]),
            "splitPercentage": 60,
        },
    }


def _panel(plot: Plot) -> dict[str, Any]:
    panel: dict[str, Any] = {
        "foxglovePanelTitle": plot.title,
        "paths": [
            {"value": path, "label": label, "enabled": True, "showLine": True, "timestampMethod": "receiveTime"}
            for label, path in plot.lines.items()
        ],
        "xAxisVal": "timestamp",
        "yAxisLabel": plot.y_label,
        "showLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
    }
    if plot.x:
        panel["xAxisVal"] = "currentCustom" if plot.is_momentary else "custom"
        panel["xAxisPath"] = {"value": plot.x, "enabled": True}
        panel["xAxisLabel"] = plot.x_label
    return panel


def _column(names: list[str]) -> Any:
    if len(names) == 1:
        return names[0]
    rest = _column(names[1:])
    return {"direction": "column", "first": names[0], "second": rest, "splitPercentage": 100 / len(names)}


def rerun_blueprint() -> rrb.Blueprint:
    """Return the blueprint with the trends, for a run converted with the application id `rig`."""
    views = [
        rrb.TimeSeriesView(
            name=f"{plot.title} [{plot.y_label}]",
            origin="/features",
            contents=["/features"],
            overrides={
                "/features": [
                    _series(label, path.removeprefix("/features"), colour)
                    for (label, path), colour in zip(plot.lines.items(), COLOURS, strict=False)
                ]
            },
        )
        for plot in TRENDS
    ]
    return rrb.Blueprint(rrb.Vertical(*views), collapse_panels=True)


def _series(label: str, selector: str, colour: tuple[int, int, int]) -> rrb.Visualizer:
    mapping = VisualizerComponentMapping(
        target="Scalars:scalars",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component="rig.Features:message",
        selector=selector,
    )
    return rr.SeriesLines(names=label, colors=[colour]).visualizer(mappings=[mapping])


def main(folder: Path) -> None:
    """Write the layout and the blueprint into a folder."""
    layout = json.dumps(foxglove_layout(), ensure_ascii=False, indent=1)
    (folder / "foxglove.json").write_text(layout + "\n", encoding="utf-8")
    rerun_blueprint().save(APPLICATION, folder / "rerun.rbl")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
