"""`rig runs`, `rig index` and `rig annotate`: what is known of the recorded runs, and what people say of them."""

import argparse
from collections.abc import Callable
from datetime import UTC, datetime

from daq.cli.arguments import add_folder, show_examples, speed
from daq.cli.listing import run_line, said_of
from daq.cli.progress import RPM, Console
from daq.cli.replay import found
from daq.cli.summary_text import print_json
from daq.errors import UsageError
from daq.schemas import run_document
from daq.schemas.catalogue import index_document
from daq.session.offline import summarise
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.catalogue.search import Search

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
        print_json(index_document(report))
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
        print_json([run_document(entry) for entry in entries])
    elif entries:
        for entry in entries:
            print(run_line(run_document(entry)))
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
        print_json(run_document(entry))
    else:
        print("  ".join((entry.id, *said_of(run_document(entry)))))
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
