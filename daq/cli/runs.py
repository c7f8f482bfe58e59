"""`rig runs`, `rig index` and `rig annotate`: what is known of the recorded runs, and what people say of them.

A run in a line of a list, and `rig summary`: what it was.
"""

import argparse
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from daq.cli.arguments import add_folder, show_examples, speed
from daq.cli.output.progress import RPM, Console
from daq.cli.output.summary_text import tell
from daq.cli.output.terminal import print_json
from daq.config.calibration import load_calibration
from daq.errors import UsageError
from daq.reports.summaries import Summaries
from daq.schemas.runs import RunSchema, index_report_schema, run_schema
from daq.session.offline import summarise
from daq.session.prediction.predictors import Predictors
from recordings.catalogue.catalogue import SUFFIX, Catalogue, data_folder
from recordings.catalogue.search import Search
from recordings.errors import NotFoundError
from recordings.integrity.verify import Verdict


def found(recording: str, folder: str) -> tuple[Catalogue, str]:
    """Return the catalogue and the id of a recording that is given by its id or its file.

    Raises
    ------
    NotFoundError
        There is no such recording.
    """
    path = Path(recording)
    if path.suffix == SUFFIX or path.is_file():
        if not path.is_file():
            raise NotFoundError(f"{path}: there is no such file")
        catalogue, run_id = Catalogue(path.parent), path.stem
    else:
        catalogue, run_id = Catalogue(data_folder(folder)), recording
    catalogue.path(run_id)
    return catalogue, run_id


def run_line(run: RunSchema) -> str:
    """Return what there is to say of a run in a line of a list."""
    state = "complete" if run.is_complete else "cut short"
    if run.is_complete and not run.is_gap_free:
        state = "samples lost"
    if run.verdict not in ("", Verdict.SOUND):
        state = run.verdict
    size = f"{run.size_bytes / 1e6:9.1f} MB"
    return "  ".join((run.run, f"{run.duration_s or 0.0:8.1f} s", size, run.fault or state, *said_of(run)))


def said_of(run: RunSchema) -> list[str]:
    """Return what people say of a run: tags, note, remark."""
    words = [" ".join(text.split()) for text in (run.note or "", run.remark)]
    return [*(f"#{tag}" for tag in run.tags), *(f"“{text}”" for text in words if text)]


def run_summary(chosen: argparse.Namespace) -> int:
    """Say what a run was; return the exit code."""
    console = Console()
    catalogue, run_id = found(chosen.recording, chosen.folder)
    calibrations = {name: load_calibration(path) for name, path in chosen.calibration}
    with Predictors() as predictors:
        summaries = Summaries(catalogue, predictors)
        if calibrations:
            document = summaries.reevaluated(run_id, calibrations, console.progress)
        else:
            document = summaries.patiently(run_id, console.progress)
    console.clear()
    tell(document, as_json=chosen.json)
    return 0 if document.is_gap_free else 5


NOT_WHOLE = 5
SECOND = 1_000_000_000

Add = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_commands(add: Add) -> None:
    """Add the commands to the command line."""
    command = add(
        "index", index, "Bring the catalogue up to date with the files, and tell what is new, damaged or gone."
    )
    command.add_argument("--verify", action="store_true", help="verify the files that have not been as they are")
    _add_place(command)

    command = add("runs", runs, "List the recorded runs, newest first: all, or those that are asked for.")
    command.add_argument("--since", type=_moment, metavar="TIME", help="begun at or after, such as 2026-11-24T09:00")
    command.add_argument("--before", type=_moment, metavar="TIME", help="begun before, such as 2026-11-25")
    command.add_argument("--rig", default="", help="of the rig of this name")
    command.add_argument("--device", default="", metavar="SERIAL", help="of the device of this serial number")
    text = "with probes calibrated so: the calibration of a run as --json tells it, or its first digits"
    command.add_argument("--calibration", default="", metavar="IDENTITY", help=text)
    command.add_argument("--speed", type=_range, metavar="LOW-HIGH", help="went through these speeds, r/min")
    command.add_argument("--text", default="", help="words in id, rig, note, remark or marks")
    command.add_argument("--tag", action="append", default=[], help="a tag that it has; may be given again")
    text = "a sub-synchronous component began below this speed, r/min"
    command.add_argument("--onset-below", type=speed, metavar="RPM", help=text)
    _add_place(command)
    show_examples(
        command, "rig runs --since 2026-11-01 --speed 9000-12000 --tag reference", "rig runs --onset-below 9000"
    )

    command = add(
        "annotate", annotate, "Say something of a run afterwards: a remark, tags. Its recording stays as it is."
    )
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument("--remark", help="words on the run, in place of those before")
    command.add_argument("--tag", action="append", default=[], help="a tag to be added; may be given again")
    command.add_argument("--untag", action="append", default=[], help="a tag to be taken away; may be given again")
    _add_place(command)
    show_examples(command, 'rig annotate 2026-11-24T09-12-07-gj90c --remark "new bearing next"')


def _add_place(command: argparse.ArgumentParser) -> None:
    add_folder(command)
    command.add_argument("--json", action="store_true", help="as JSON")


def index(chosen: argparse.Namespace) -> int:
    """Bring the catalogue up to date; return the exit code."""
    console = Console()
    catalogue = Catalogue(data_folder(chosen.folder))
    report = catalogue.index(summarise, verifying=chosen.verify, told=console.progress)
    console.done()
    faults = {entry.id: entry.fault or entry.verdict for entry in catalogue.runs()}
    unsound = [run_id for run_id, fault in faults.items() if fault not in ("", "sound")]
    if chosen.json:
        print_json(index_report_schema(report))
    else:
        for name, run_ids in (("new", report.new), ("changed", report.changed), ("vanished", report.vanished)):
            for run_id in run_ids:
                print(f"{name:9} {run_id}")
        for run_id in unsound:
            print(f"damaged   {run_id}: {faults[run_id]}")
        print(f"{catalogue.folder}: {len(faults)} runs, {report.unchanged} unchanged")
    return NOT_WHOLE if unsound else 0


def runs(chosen: argparse.Namespace) -> int:
    """List runs; return the exit code."""
    low, high = chosen.speed or (None, None)
    search = Search(
        started_from_ns=chosen.since,
        started_before_ns=chosen.before,
        speed_low=None if low is None else low * RPM,
        speed_high=None if high is None else high * RPM,
        text=chosen.text,
        tags=tuple(chosen.tag),
        onset_below=None if chosen.onset_below is None else chosen.onset_below * RPM,
        rig=chosen.rig,
        serial=chosen.device,
        calibration=chosen.calibration,
    )
    catalogue = Catalogue(data_folder(chosen.folder))
    entries = catalogue.search(search) if search != Search() else catalogue.runs()
    if chosen.json:
        print_json([run_schema(entry) for entry in entries])
    elif entries:
        for entry in entries:
            print(run_line(run_schema(entry)))
    else:
        print(f"no {'such ' if search != Search() else ''}runs in {catalogue.folder}")
    return 0


def annotate(chosen: argparse.Namespace) -> int:
    """Say something of a run; return the exit code."""
    catalogue, run_id = found(chosen.recording, chosen.folder)
    entry = catalogue.run(run_id)
    tags = None
    if chosen.tag or chosen.untag:
        tags = (set(entry.tags) | set(chosen.tag)) - set(chosen.untag)
    try:
        entry = catalogue.annotate(run_id, remark=chosen.remark, tags=tags)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if chosen.json:
        print_json(run_schema(entry))
    else:
        print("  ".join((entry.id, *said_of(run_schema(entry)))))
    return 0


def _moment(text: str) -> int:
    """Return a moment, ns since 1970; without a zone it is the computer's own."""
    try:
        return round(datetime.fromisoformat(text).astimezone(UTC).timestamp()) * SECOND
    except (ValueError, OverflowError, OSError):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a time such as 2026-11-24T09:00") from None


def _range(text: str) -> tuple[float, float]:
    low, separator, high = text.partition("-")
    try:
        speeds = float(low), float(high)
    except ValueError:
        speeds = (0.0, -1.0)
    if not separator or not 0 <= speeds[0] <= speeds[1]:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a range of speed in r/min, such as 9000-12000")
    return speeds
