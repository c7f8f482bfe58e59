"""`rig model thesis`: report with all tables and figures of chapters 3, 5 and 6, recomputed."""

import argparse
from collections.abc import Callable
from pathlib import Path

from daq.cli.model.report import Part, captioned_plot, count_reproduced, report_html
from daq.cli.progress import TerminalOutput
from daq.errors import UsageError
from daq.session.sweep import LocalWorkers
from model.studies.thesis.chapter_3 import chapter_3
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
from recordings.atomic_file import atomic_write

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


def add_thesis(add: Callable[[str, str], argparse.ArgumentParser]) -> None:
    """Add the subcommand `thesis`."""
    command = add("thesis", "Recompute chapters 3, 5 and 6 of the thesis: report of stated and computed numbers.")
    command.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help=f"folder of {FILE_NAME} (default: the current one)",
    )
    command.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compute and write the report; return the exit code."""
    folder: Path = args.output
    console = TerminalOutput()
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
        reproduced, total = count_reproduced(part)
        print(f"{part.title}: {reproduced} of {total} numbers and trends reproduced")
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
    third = chapter_3()
    return [
        Part(third.title, _CHAPTER_3, third.comparisons, tuple(captioned_plot(one) for one in third.figures)),
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
