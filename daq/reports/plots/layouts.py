"""Layouts of Bode, polar, cascade, orbit and spectrum plots in the conventions of rotating machinery."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analysis.spectra.windows import HANN, Window
from daq.reports.plots.panel import FULL_TURN, MARGIN, Curve, Panel, Style, Values
from model.studies import study

FULL_SPECTRUM_LABEL = "order (negative: against the rotation)"
LABEL_SPACING = 0.18  # of the largest vector, between speed labels of a polar plot
MAX_LINES = 40  # of a cascade
LINE_HEIGHT = 0.2  # height of a cascade's largest line over the length of the y axis
PROBE_LABEL_RADIUS = 0.97  # of the axes of an orbit
BLANK_FRACTION = 0.05  # of a revolution before the keyphasor mark, left blank in an orbit
PROBES = ("x", "y")
DISTINCT_COLOURS = (0, 4, 1, 5, 2, 3)  # colour indices of curves other than probes, most distinct first
SPEED_COLOUR = 6  # index of the colour of a speed over time
MAX_LABELS = 6  # lines of a spectrum with a label
MIN_LABEL_FRACTION = 0.01  # of the largest line, for a label


@dataclass(frozen=True, slots=True)
class RampCurve:
    """Vectors of one order over the speed of a run-up or run-down.

    Parameters
    ----------
    arrow : str
        ▲ run-up or ▼ run-down; empty where only one of them exists.
    speeds : sequence
        r/min.
    amplitudes, lags : pair of sequences
        At probes x and y, µm and degrees; None where unknown.
    """

    arrow: str
    speeds: Values
    amplitudes: tuple[Values, Values]
    lags: tuple[Values, Values]


def bode(title: str, what: str, unit: str, ramps: Sequence[RampCurve], caption: str = "") -> list[Panel]:
    """Return a Bode plot: phase lag, growing downwards, above amplitude."""
    lag: list[Curve] = []
    size: list[Curve] = []
    begin = _begin([ramp.lags[probe] for ramp in ramps for probe in (0, 1)])
    for row, ramp in enumerate(ramps):
        for probe, name in enumerate(PROBES):
            named, colour = f"{name} {ramp.arrow}".strip(), 2 * row + probe
            lag.append(Curve(named, *_wrapped(ramp.speeds, ramp.lags[probe], begin), colour=colour))
            size.append(Curve(named, ramp.speeds, ramp.amplitudes[probe], colour=colour))
    return [
        Panel(
            title, "speed, r/min", f"phase lag of {what}, degrees", tuple(lag), caption,
            y_range=(begin, begin + FULL_TURN), y_is_lag=True,
        ),
        Panel(f"amplitude of {what}", "speed, r/min", f"amplitude, {unit}", tuple(size)),
    ]  # fmt: skip


def polar(
    title: str, what: str, unit: str, ramps: Sequence[RampCurve], zeros: tuple[float, float], caption: str = ""
) -> list[Panel]:
    """Return a polar plot for each probe; zero lag at ``zeros``, rad, lags growing clockwise."""
    panels = []
    for probe, name in enumerate(PROBES):
        curves: list[Curve] = []
        paths: list[tuple[float, float, float]] = []
        for row, ramp in enumerate(ramps):
            places = _places(ramp, probe, zeros[probe])
            paths += places
            path = [x for _, x, _ in places], [y for _, _, y in places]
            curves.append(Curve(ramp.arrow, *path, colour=2 * row + probe))
        label = f"{unit}; lag clockwise, against the rotation; r/min along the path"
        panels.append(
            Panel(
                f"{title} · {what} at probe {name}", label, "µm", tuple(curves), caption, is_square=True,
                polar_zero=zeros[probe], notes=tuple(_spaced(paths)),
            )
        )  # fmt: skip
    return panels


def stacked(
    title: str,
    x_label: str,
    y_label: str,
    across: Values,
    feet: Values,
    rows: Sequence[Values],
    caption: str = "",
    guides: tuple[Curve, ...] = (),
) -> Panel:
    """Return stacked spectra; the baseline of each lies at its speed or time."""
    group_size = -(-len(feet) // MAX_LINES)  # rows per line, which shows their maximum
    groups = [rows[k : k + group_size] for k in range(0, len(feet), group_size)]
    lines = [tuple(max(value or 0.0 for value in cell) for cell in zip(*group, strict=True)) for group in groups]
    baselines = [foot or 0.0 for foot in feet[::group_size]]
    largest = max(map(max, lines), default=0.0) or 1.0
    scale = LINE_HEIGHT * ((max(baselines) - min(baselines)) or max(baselines) or 1.0) / largest
    curves = tuple(
        Curve("", across, [foot + scale * value for value in line]) for foot, line in zip(baselines, lines, strict=True)
    )
    heading = f"{title}, largest line {largest:.3g} µm"
    return Panel(heading, x_label, y_label, curves + guides, caption, y_from_zero=False, is_stacked=True)


def orbit(
    title: str, turns: Sequence[tuple[Values, Values]], directions: tuple[float, float], caption: str = ""
) -> Panel:
    """Return an orbit of successive revolutions that start at the keyphasor mark: blank before it, a dot at it.

    ``directions`` are the angles of the probes, rad from X.
    """
    across: list[float | None] = []
    up: list[float | None] = []
    for xs, ys in turns:
        seen = len(xs) - max(round(BLANK_FRACTION * len(xs)), 1)
        across += [*xs[:seen], None]
        up += [*ys[:seen], None]
    marks = Curve("keyphasor mark", [xs[0] for xs, _ in turns], [ys[0] for _, ys in turns], Style.KEYPHASOR)
    reach = MARGIN * max((abs(value) for value in (*across, *up, *marks.x, *marks.y) if value is not None), default=1.0)
    notes = tuple(
        (f"probe {name}", PROBE_LABEL_RADIUS * reach * math.cos(angle), PROBE_LABEL_RADIUS * reach * math.sin(angle))
        for name, angle in zip(PROBES, directions, strict=True)
    )
    label = "X to the right, µm; the shaft turns anticlockwise"
    path = Curve("", across, up)
    return Panel(title, label, "Y up, µm", (path, marks), caption, is_square=True, notes=notes)


def spectrum(
    title: str,
    x_label: str,
    unit: str,
    across: Values,
    rows: Sequence[tuple[str, Values]],
    caption: str = "",
    window: Window = HANN,
) -> list[Panel]:
    """Return spectra of the same scale, one panel each, with labels at the largest components.

    Position and amplitude of a label are interpolated between the lines by the rule of the window.
    """
    highest = max((value for _, row in rows for value in row if value is not None), default=0.0) or 1.0
    panels = []
    for place, (name, row) in enumerate(rows):
        unit_of_x = "X" if "order" in x_label else f" {x_label.rpartition(', ')[2]}"
        tops = components(across, row, window, MIN_LABEL_FRACTION * highest)
        notes = tuple((f"{x:.3g}{unit_of_x} {size:.3g}", x, size) for x, size in tops)
        panels.append(
            Panel(
                title if place == 0 else "", x_label, f"amplitude, {unit}{name and f', at {name}'}",
                (Curve("", across, row, colour=place),), caption if place == 0 else "", y_range=(0.0, MARGIN * highest),
                notes=notes,
            )
        )  # fmt: skip
    return panels


def components(across: Values, row: Values, window: Window = HANN, minimum: float = 0.0) -> list[tuple[float, float]]:
    """Return position and amplitude of the largest components, interpolated between the lines, the largest first."""
    places = np.array([np.nan if value is None else value for value in across], dtype=np.float64)
    sizes = np.array([value or 0.0 for value in row], dtype=np.float64)
    inner = sizes[1:-1]
    lines = np.flatnonzero((inner > sizes[:-2]) & (inner >= sizes[2:]) & (inner > minimum)) + 1
    lines = lines[np.argsort(-sizes[lines], kind="stable")][:MAX_LABELS]
    found = [(line, *window.component(sizes, line)) for line in lines.tolist()]
    return [(float(places[line] + offset * (places[1] - places[0])), size) for line, offset, size in found]


def _places(ramp: RampCurve, probe: int, zero: float) -> list[tuple[float, float, float]]:
    """Return speed, x and y of the known vectors of a probe."""
    places = []
    for speed, radius, lag in zip(ramp.speeds, ramp.amplitudes[probe], ramp.lags[probe], strict=True):
        if speed is not None and radius is not None and lag is not None:
            angle = zero - math.radians(lag)
            places.append((speed, radius * math.cos(angle), radius * math.sin(angle)))
    return places


def _begin(rows: Sequence[Values]) -> float:
    """Return the start of the lag axis, a multiple of 90 degrees, with the fewest breaks of the curves."""

    def breaks(begin: float) -> int:
        return sum(_is_break(a, b) for row in rows for a, b in pairwise(_turned(row, begin)))

    return min((0.0, 270.0, 90.0, 180.0), key=breaks)


def _turned(lags: Values, begin: float) -> list[float | None]:
    """Return lags wrapped to ``begin`` up to ``begin`` + 360 degrees."""
    return [None if lag is None else begin + (lag - begin) % FULL_TURN for lag in lags]


def _is_break(before: float | None, lag: float | None) -> bool:
    return before is not None and lag is not None and abs(lag - before) > FULL_TURN / 2


def _wrapped(speeds: Values, lags: Values, begin: float) -> tuple[Values, Values]:
    """Return a lag wrapped to an axis from ``begin``, broken at the ends of the axis."""
    points = list(zip(speeds, _turned(lags, begin), strict=True))
    found = points[:1]
    for (_, before), (speed, lag) in pairwise(points):
        if _is_break(before, lag):
            found.append((None, None))
        found.append((speed, lag))
    return [speed for speed, _ in found], [lag for _, lag in found]


def _spaced(places: Sequence[tuple[float, float, float]]) -> list[tuple[str, float, float]]:
    """Return the speed labels of a polar plot at a minimum spacing."""
    reach = max((math.hypot(x, y) for _, x, y in places), default=0.0)
    written: list[tuple[str, float, float]] = []
    for speed, x, y in places:
        if all(math.hypot(x - other[1], y - other[2]) > LABEL_SPACING * reach for other in written):
            written.append((f"{speed:,.0f}", x, y))
    return written


TURN = (0.0, FULL_TURN)  # degrees
_STYLES = {
    study.Style.LINE: Style.LINE,
    study.Style.DASHED: Style.DASHED,
    study.Style.DOTTED: Style.DOTTED,
    study.Style.POINTS: Style.DOTS,
    study.Style.MARKERS: Style.MARKERS,
    study.Style.REFERENCE: Style.GUIDE,
}


def study_panels(plots: Sequence[study.Plot | study.Surface]) -> list[Panel]:
    """Return the plots of a model study as panels."""
    return [_surface_panel(plot) if isinstance(plot, study.Surface) else _study_panel(plot) for plot in plots]


def _surface_panel(plot: study.Surface) -> Panel:
    guides = tuple(Curve("", guide.x, guide.y, Style.GUIDE) for guide in plot.guides)
    ends = (float(plot.x[0]), float(plot.x[-1])), (float(plot.y[0]), float(plot.y[-1]))
    return Panel(plot.title, plot.x_label, plot.y_label, guides, x_range=ends[0], y_range=ends[1], surface=plot)


def _study_panel(plot: study.Plot) -> Panel:
    """Return a plot as a panel; a series without a label has the colour of the previous one."""
    number, curves = -1, []
    for series in plot.series:
        number += bool(series.label) or number < 0
        colour = DISTINCT_COLOURS[number % len(DISTINCT_COLOURS)]
        curves.append(Curve(series.label, series.x, series.y, _STYLES[series.style], colour))
    x_range, y_range = plot.x_limits, plot.y_limits
    if plot.is_square:
        points = np.array([point for curve in curves for part in curve.segments() for point in part]).reshape(-1, 2)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = 0.5 * MARGIN * float(np.ptp(points, axis=0).max())
        x_range, y_range = ((float(at - reach), float(at + reach)) for at in middle)
    return Panel(
        plot.title, plot.x_label, plot.y_label, tuple(curves), is_square=plot.is_square, y_from_zero=False,
        x_range=x_range, y_range=y_range, x_is_angle=x_range == TURN, y_is_angle=y_range == TURN,
        x_is_log=plot.x_log, y_is_log=plot.y_log, empty_text=plot.empty_text,
    )  # fmt: skip
