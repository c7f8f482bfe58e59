"""`rig index`, `rig runs` and `rig annotate`: the catalogue of recorded runs."""

import argparse
from datetime import UTC, datetime
from pathlib import Path

from analysis.signals.units import RPM
from daq.cli.arguments import INCOMPLETE, AddCommand, add_folder, show_examples, speed
from daq.cli.progress import TerminalOutput
from daq.cli.terminal import print_json
from daq.schemas.runs import IndexReportSchema, RunSchema, run_schema
from recordings.catalogue.catalogue import SUFFIX, Catalogue, data_folder
from recordings.catalogue.run_store import Search
from recordings.errors import NotFoundError
from recordings.integrity.verify import Verdict


def find_run(recording: str, folder: str) -> tuple[Catalogue, str]:
    """Return the catalogue and run id of a recording given by run id or file.

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


def run_row(run: RunSchema) -> str:
    """Return a run as one line of the list: id, duration, size, state and annotations."""
    state = "complete" if run.is_complete else "incomplete"
    if run.is_complete and not run.is_gap_free:
        state = "samples lost"
    if run.verdict not in ("", Verdict.SOUND):
        state = run.verdict
    size = f"{run.size_bytes / 1e6:9.1f} MB"
    return "  ".join((run.run, f"{run.duration_s or 0.0:8.1f} s", size, run.fault or state, *annotation_texts(run)))


def annotation_texts(run: RunSchema) -> list[str]:
    """Return a run's tags, note and remark as printed."""
    texts = [" ".join(text.split()) for text in (run.note or "", run.remark)]
    return [*(f"#{tag}" for tag in run.tags), *(f"“{text}”" for text in texts if text)]


NS_PER_SECOND = 1_000_000_000


def add_commands(add: AddCommand) -> None:
    """Add `rig index`, `rig runs` and `rig annotate` to the command line."""
    command = add("index", run_index)
    command.add_argument("--verify", action="store_true", help="verify the files not verified yet")
    _add_folder_and_json(command)

    command = add("runs", run_runs)
    command.add_argument("--since", type=_time_ns, metavar="TIME", help="started at or after, such as 2026-11-24T09:00")
    command.add_argument("--before", type=_time_ns, metavar="TIME", help="started before, such as 2026-11-25")
    command.add_argument("--rig", default="", help="recorded with the rig of this name")
    command.add_argument(
        "--device", default="", metavar="SERIAL", help="recorded with the device of this serial number"
    )
    text = "recorded with this calibration: an identity from --json, or its first digits"
    command.add_argument("--calibration", default="", metavar="IDENTITY", help=text)
    command.add_argument("--speed", type=_speed_range, metavar="LOW-HIGH", help="covers this speed range, r/min")
    command.add_argument("--text", default="", help="words in id, rig, note, remark or markers")
    command.add_argument("--tag", action="append", default=[], help="has this tag; repeatable")
    text = "a sub-synchronous component started below this speed, r/min"
    command.add_argument("--onset-below", type=speed, metavar="RPM", help=text)
    _add_folder_and_json(command)
    show_examples(
        command, "rig runs --since 2026-11-01 --speed 9000-12000 --tag reference", "rig runs --onset-below 9000"
    )

    command = add("annotate", run_annotate)
    command.add_argument("recording", metavar="RUN", help="run id or file")
    command.add_argument("--remark", help="replaces the run's remark")
    command.add_argument("--tag", action="append", default=[], help="tag to add; repeatable")
    command.add_argument("--untag", action="append", default=[], help="tag to remove; repeatable")
    _add_folder_and_json(command)
    show_examples(command, 'rig annotate 2026-11-24T09-12-07-gj90c --remark "new bearing next"')


def _add_folder_and_json(command: argparse.ArgumentParser) -> None:
    add_folder(command)
    command.add_argument("--json", action="store_true", help="print JSON")


def run_index(args: argparse.Namespace) -> int:
    """Update the catalogue from the files; return the exit code."""
    from daq.session.offline import summarise  # noqa: PLC0415 - the analysis takes a second to import, which `rig runs` need not wait

    console = TerminalOutput()
    catalogue = Catalogue(data_folder(args.folder))
    report = catalogue.index(summarise, verify_files=args.verify, on_status=console.progress)
    console.done()
    faults = {entry.id: entry.fault or entry.verdict for entry in catalogue.runs()}
    damaged = [run_id for run_id, fault in faults.items() if fault not in ("", "sound")]
    if args.json:
        print_json(IndexReportSchema.of(report))
    else:
        for name, run_ids in (("new", report.new), ("changed", report.changed), ("missing", report.missing)):
            for run_id in run_ids:
                print(f"{name:9} {run_id}")
        for run_id in damaged:
            print(f"damaged   {run_id}: {faults[run_id]}")
        print(f"{catalogue.folder}: {len(faults)} runs, {report.unchanged} unchanged")
    return INCOMPLETE if damaged else 0


def run_runs(args: argparse.Namespace) -> int:
    """List runs; return the exit code."""
    low, high = args.speed or (None, None)
    search = Search(
        started_from_ns=args.since,
        started_before_ns=args.before,
        speed_low=None if low is None else low * RPM,
        speed_high=None if high is None else high * RPM,
        text=args.text,
        tags=tuple(args.tag),
        onset_below=None if args.onset_below is None else args.onset_below * RPM,
        rig=args.rig,
        serial=args.device,
        calibration=args.calibration,
    )
    catalogue = Catalogue(data_folder(args.folder))
    entries = catalogue.search(search) if search != Search() else catalogue.runs()
    if args.json:
        print_json([run_schema(entry) for entry in entries])
    elif entries:
        for entry in entries:
            print(run_row(run_schema(entry)))
    else:
        print(f"no {'matching ' if search != Search() else ''}runs in {catalogue.folder}")
    return 0


def run_annotate(args: argparse.Namespace) -> int:
    """Set the remark and tags of a run; return the exit code."""
    catalogue, run_id = find_run(args.recording, args.folder)
    entry = catalogue.run(run_id)
    tags = None
    if args.tag or args.untag:
        tags = (set(entry.tags) | set(args.tag)) - set(args.untag)
    entry = catalogue.annotate(run_id, remark=args.remark, tags=tags)
    if args.json:
        print_json(run_schema(entry))
    else:
        print("  ".join((entry.id, *annotation_texts(run_schema(entry)))))
    return 0


def _time_ns(text: str) -> int:
    """Return an ISO 8601 time as ns since 1970; without a zone it is local time."""
    try:
        return round(datetime.fromisoformat(text).astimezone(UTC).timestamp()) * NS_PER_SECOND
    except (ValueError, OverflowError, OSError):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a time such as 2026-11-24T09:00") from None


def _speed_range(text: str) -> tuple[float, float]:
    low, separator, high = text.partition("-")
    try:
        speeds = float(low), float(high)
    except ValueError:
        speeds = (0.0, -1.0)
    if not separator or not 0 <= speeds[0] <= speeds[1]:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a range of speed in r/min, such as 9000-12000")
    return speeds
