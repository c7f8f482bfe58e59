"""`rig model thesis`: report with all tables and figures of chapters 3, 5 and 6, recomputed."""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from daq.cli.terminal import TerminalOutput
from daq.errors import UsageError
from daq.session.sweep import LocalWorkers
from model.studies.study import Plot, Surface
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

    def missed_places(self) -> str:
        """Return the places of the numbers that are not reproduced, with their counts."""
        places = Counter(one.place for one in self.comparisons if one.verdict is not Verdict.REPRODUCED)
        return ", ".join(f"{place} ({count})" for place, count in places.items()) or "none"


def report_html(parts: Sequence[Part]) -> str:
    """Return the report as HTML."""
    environment = Environment(loader=PackageLoader("daq.cli.model", "."), autoescape=True, trim_blocks=True)
    environment.filters |= {"number": _number, "signed": _signed, "row_class": _row_class, "svg": _svg}
    return environment.get_template("thesis.html").render(parts=parts, headline=headline)


def _row_class(verdict: Verdict) -> str:
    return "yes" if verdict is Verdict.REPRODUCED else "no"


def _svg(plots: Sequence[Plot | Surface], salt: str) -> Markup:
    from daq.reports.plots.layouts import study_panels
    from daq.reports.plots.render import render

    svg = render(study_panels(plots), "svg", salt=salt).decode()
    return Markup(svg[svg.index("<svg") :])  # noqa: S704 - our own drawing


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
    command.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help=f"folder of {FILE_NAME} (default: the current one)",
    )
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
    results: dict[int, CaseResult] = {}
    for number, outcome in LocalWorkers().run(run_case, CASES):
        results[number] = outcome
        on_progress(f"chapter 6: {len(results)} of {len(CASES)} cases")
    outcomes = tuple(results[number] for number in range(len(CASES)))
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
