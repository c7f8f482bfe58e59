"""`rig model thesis`: report with all tables and figures of chapters 3, 5 and 6, recomputed."""

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from daq.cli.terminal import TerminalOutput
from daq.errors import UsageError
from daq.session.sweep import LocalWorkers
from model.studies.thesis.chapter_3 import chapter_3_comparisons, chapter_3_readings
from model.studies.thesis.chapter_3_cases import chapter_3_figures
from model.studies.thesis.chapter_5 import chapter_5_comparisons, chapter_5_figures
from model.studies.thesis.chapter_6 import (
    CASES,
    CaseResult,
    chapter_6_comparisons,
    chapter_6_figures,
    onsets_by_eigenvalues,
    run_case,
    trends,
)
from model.studies.thesis.report import Captioned, Comparison, Trend, Verdict, headline
from recordings.file_operations import atomic_write

_STYLE = """\
body{font:15px/1.45 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;font-size:13px;margin:1rem 0}th,td{padding:.2rem .6rem;border-bottom:1px solid #ddd;
text-align:left;vertical-align:top}td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
tr.no td.v{color:#a33;font-weight:600}tr.yes td.v{color:#276}figure{margin:1.5rem 0}
figure svg{max-width:100%;height:auto}
figcaption{font-size:13px;color:#444}.three figure{display:inline-block;width:48%;margin:.5rem .5%;vertical-align:top}
"""
_INTRODUCTION = (
    "Tables and figures of H. Zhang (2012): stated and computed numbers. “Reproduced” means within the tolerance of "
    "the printed value; if a number differs, the note gives the reason. Each statement counts once. Bounds (an "
    "inequality, the limit of an axis) are satisfied by many values and count apart; values that set a factor of the "
    "computation are no agreement; “undecided” means that the computation was too short to tell."
)


@dataclass(frozen=True, slots=True)
class Part:
    """A chapter of the report.

    Parameters
    ----------
    title : str
        Number and subject.
    text : str
        Introduction.
    comparisons : tuple of Comparison
        Stated and computed numbers.
    figures : tuple of pairs of caption and plots
        Figures.
    trends : tuple of Trend
        Trends stated in words.
    """

    title: str
    text: str
    comparisons: tuple[Comparison, ...]
    figures: tuple[Captioned, ...]
    trends: tuple[Trend, ...] = ()


def report_html(parts: Sequence[Part]) -> str:
    """Return the report as HTML."""
    body = [
        "<h1>The thesis recomputed</h1>",
        f"<p>{_INTRODUCTION}</p>",
        _overview(parts),
    ]
    for number, part in enumerate(parts):
        body += [f"<h2>{escape(part.title)}</h2>", f"<p>{escape(part.text)}</p>"]
        if part.trends:
            body.append(_trends(part.trends))
        body.append(_comparisons(part.comparisons))
        layout = ' class="three"' if len(part.figures) > 20 else ""
        body.append(f"<div{layout}>")
        body += [_figure(one, f"{number}-{index}") for index, one in enumerate(part.figures)]
        body.append("</div>")
    head = f'<meta charset="utf-8"><title>The thesis recomputed</title><style>{_STYLE}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{"".join(body)}</body></html>\n'


def _overview(parts: Sequence[Part]) -> str:
    rows = []
    for part in parts:
        places = Counter(one.place for one in part.comparisons if one.verdict is not Verdict.REPRODUCED)
        missed = ", ".join(f"{place} ({count})" for place, count in places.items()) or "none"
        cells = (part.title, headline(part.comparisons, part.trends), missed)
        rows.append(f"<tr>{''.join(f'<td>{escape(cell)}' for cell in cells)}</tr>")
    return f"<table><tr><th>Chapter<th>Reproduced<th>Numbers that differ, by place</tr>{''.join(rows)}</table>"


def _comparisons(comparisons: Iterable[Comparison]) -> str:
    rows = []
    for one in comparisons:
        computed = "none" if one.computed is None else _number(one.computed)
        deviation = "" if one.deviation is None else _signed(one.deviation)
        kind = "yes" if one.verdict is Verdict.REPRODUCED else "no"
        relation = "" if one.relation.value == "=" else f"{one.relation.value} "
        cells = (
            one.place,
            one.quantity,
            f"{relation}{_number(one.stated)}",
            computed,
            deviation,
            one.unit,
            one.kind.value,
            one.verdict.value,
            one.note,
        )
        kinds = ("", "", " class=n", " class=n", " class=n", "", "", " class=v", "")
        row = "".join(f"<td{k}>{escape(cell)}" for k, cell in zip(kinds, cells, strict=True))
        rows.append(f"<tr class={kind}>{row}</tr>")
    names = ("Place", "Quantity", "Stated", "Computed", "Deviation", "Unit", "Kind", "Verdict", "Note")
    return f"<table><tr>{''.join(f'<th>{name}' for name in names)}</tr>{''.join(rows)}</table>"


def _trends(trends: Iterable[Trend]) -> str:
    rows = "".join(
        f"<tr class={'yes' if one.verdict is Verdict.REPRODUCED else 'no'}><td>{escape(one.text)}"
        f"<td class=v>{one.verdict.value}<td>{escape(one.computed)}</tr>"
        for one in trends
    )
    return f"<table><tr><th>Trend stated<th>Verdict<th>Computed, in order of the cases</tr>{rows}</table>"


def _figure(one: Captioned, salt: str) -> str:
    from daq.reports.plots.layouts import study_panels
    from daq.reports.plots.render import render

    caption, plots = one
    svg = render(study_panels(plots), "svg", salt=salt).decode()
    return f"<figure>{svg[svg.index('<svg') :]}<figcaption>{escape(caption)}</figcaption></figure>"


def _number(value: float) -> str:
    return f"{value:,.1f}".removesuffix(".0") if abs(value) >= 100 else f"{value:.3g}"


def _signed(value: float) -> str:
    return f"{value:+,.0f}" if abs(value) >= 100 else f"{value:+.3g}"


FILE_NAME = "thesis.html"
_CHAPTER_3 = (
    "Two calibrations: nominal, with Table 3.1 and the equations; thesis-like, with two factors that reproduce the "
    "stated equilibria. Oil flows are known only up to a factor that the thesis does not give."
)
_CHAPTER_5 = (
    "Euler-Bernoulli shaft, lumped discs with gyroscopic moments, as printed in Table 5.1; radii, journals 3 and 4."
)
_CHAPTER_6 = (
    "Run-ups in steps of 100 rad/s, at least 40 turns to settle and 64 evaluated. Onset: a film's whirl exceeds a "
    "tenth of 1X at two successive speeds. Two of the printed imbalances exceed the limit of the clearances, and the "
    "smallest pins the journals, so the cases are computed at 0.05 of them. Unstable motions are perturbed by 0.02 µm "
    "along each film's whirl and have time to grow; without seed, the onset would depend on rounding errors. A whirl "
    "is assigned to the film whose surfaces move more against each other, by the integrated motion of the rings and by "
    "the eigenvectors; combinations with 1X are assigned to no film. Spectra and trajectories are those of the run-ups "
    "at that speed. Grey: the motion reached a wall. "
)


def add_thesis(studies: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the subcommand `thesis`."""
    text = "Recompute chapters 3, 5 and 6 of the thesis: report of stated and computed numbers."
    command = studies.add_parser("thesis", help=text, description=text, allow_abbrev=False)
    text = f"folder of {FILE_NAME} (default: the current one)"
    command.add_argument("-o", "--output", type=Path, default=Path(), metavar="FOLDER", help=text)
    command.set_defaults(run=run_thesis)


def run_thesis(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Compute and write the report; return the exit code."""
    folder: Path = args.output
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"-o {folder}: expected a folder that can be created ({error.strerror})") from error
    parts = compute_parts(console.progress)
    console.progress("drawing")
    file = folder / FILE_NAME
    text = report_html(parts)
    try:
        with atomic_write(file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file}: cannot be written ({error.strerror})") from error
    console.done()
    for part in parts:
        print(f"{part.title}: {headline(part.comparisons, part.trends)}")
    print(f"report: {file}")
    return 0


def compute_parts(on_progress: Callable[[str], None]) -> list[Part]:
    """Return the chapters of the report; the run-ups of chapter 6 run in local processes."""
    found: dict[int, CaseResult] = {}
    for number, outcome in LocalWorkers().run(run_case, CASES):
        found[number] = outcome
        on_progress(f"chapter 6: {len(found)} of {len(CASES)} cases")
    outcomes = tuple(found[number] for number in range(len(CASES)))
    on_progress("chapters 3 and 5")
    readings = chapter_3_readings()
    return [
        Part(
            "Chapter 3: lubrication of floating-ring bearings",
            _CHAPTER_3,
            tuple(one for reading in readings for one in chapter_3_comparisons(reading)),
            tuple(one for reading in readings for one in chapter_3_figures(reading)),
        ),
        Part(
            "Chapter 5: modes and critical speeds of the rotor",
            _CHAPTER_5,
            tuple(chapter_5_comparisons()),
            tuple(chapter_5_figures()),
        ),
        Part(
            "Chapter 6: whirl of the rotor on floating rings",
            _CHAPTER_6 + onsets_by_eigenvalues(outcomes),
            tuple(chapter_6_comparisons(outcomes)),
            tuple(chapter_6_figures(outcomes)),
            tuple(trends(outcomes)),
        ),
    ]
