"""Commands on recorded runs: `rig index`, `runs`, `annotate`, `summary`, `verify` and `recover`."""

import argparse
import math
from collections.abc import Iterable
from contextlib import closing
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.signals.snapshot import LARGEST_OVERALL, OVERALL
from analysis.signals.units import RPM
from daq.cli.arguments import INCOMPLETE, AddCommand, add_folder, add_json, add_run, calibration, speed
from daq.cli.terminal import TerminalOutput, grid, print_json, print_output
from recordings.catalogue.catalogue import SUFFIX, Catalogue, RunEntry, data_folder
from recordings.catalogue.run_store import Search
from recordings.errors import NotFoundError
from recordings.integrity.verify import Verdict, Verification, verify
from recordings.mcap.layout import NANOSECONDS

if TYPE_CHECKING:
    from recordings.integrity.recover import MissingSamples


def add_commands(add: AddCommand) -> None:
    """Add the commands on recorded runs to the command line."""
    command = add("index", run_index, add_folder, add_json)
    command.add_argument("--verify", action="store_true", help="verify the files not verified yet")

    command = add(
        "runs",
        run_runs,
        add_folder,
        add_json,
        examples=["rig runs --since 2026-11-01 --speed 9000-12000 --tag reference", "rig runs --onset-below 9000"],
    )
    command.add_argument("--since", type=_time_ns, metavar="TIME", help="started at or after, such as 2026-11-24T09:00")
    command.add_argument("--before", type=_time_ns, metavar="TIME", help="started before, such as 2026-11-25")
    command.add_argument("--rig", default="", help="recorded with the rig of this name")
    command.add_argument(
        "--device", default="", metavar="SERIAL", help="recorded with the device of this serial number"
    )
    command.add_argument(
        "--calibration",
        default="",
        metavar="IDENTITY",
        help="recorded with this calibration: an identity from --json, or its first digits",
    )
    command.add_argument("--speed", type=_range, metavar="LOW-HIGH", help="covers this speed range, r/min")
    for measure in OVERALL.rows:
        command.add_argument(
            f"--{measure.name.replace('_', '-')}",
            type=_range,
            metavar="LOW-HIGH",
            help=f"range, {measure.unit}, of the largest {measure.description}",
        )
    command.add_argument("--text", default="", help="words in id, rig, note, remark or markers")
    command.add_argument("--tag", action="append", default=[], help="has this tag; repeatable")
    command.add_argument(
        "--onset-below", type=speed, metavar="RPM", help="a sub-synchronous component started below this speed, r/min"
    )

    command = add(
        "annotate",
        run_annotate,
        add_run,
        add_json,
        examples=['rig annotate 2026-11-24T09-12-07-gj90c --remark "new bearing next"'],
    )
    command.add_argument("--remark", help="replaces the run's remark")
    command.add_argument("--tag", action="append", default=[], help="tag to add; repeatable")
    command.add_argument("--untag", action="append", default=[], help="tag to remove; repeatable")

    command = add("summary", run_summary, add_run, add_json, examples=["rig summary 2026-11-24T09-12-07-gj90c"])
    command.add_argument(
        "--calibration",
        type=calibration,
        action="append",
        default=[],
        metavar="PROBE=FILE",
        help="re-evaluate the samples with this calibration, as x=probe-x-2026-11-24.toml; repeatable; "
        "the recording is not changed",
    )

    add("verify", run_verify, add_run, add_json)
    command = add("recover", run_recover, add_run, add_json)
    command.add_argument(
        "-o", dest="output", type=Path, metavar="NEW.MCAP", help="the copy (default: RUN-recovered.mcap beside it)"
    )


def find_run(args: argparse.Namespace) -> tuple[Catalogue, str]:
    """Return the catalogue and run id of the recording given by run id or file.

    Raises
    ------
    NotFoundError
        There is no such recording.
    """
    path = Path(args.recording)
    if path.suffix == SUFFIX or path.is_file():
        if not path.is_file():
            raise NotFoundError(f"{path}: there is no such file")
        catalogue, run_id = Catalogue(path.parent), path.stem
    else:
        catalogue, run_id = Catalogue(data_folder(args.folder)), args.recording
    catalogue.path(run_id)
    return catalogue, run_id


def print_runs(runs: Iterable[RunEntry]) -> None:
    """Print runs, one a row: id, duration, size, state and annotations."""
    print_output(grid(*map(_run_row, runs)))


def _run_row(run: RunEntry) -> tuple[str, str, str, str]:
    state = "incomplete" if not run.is_complete else "complete" if run.is_gap_free else "samples lost"
    if run.verdict not in ("", Verdict.INTACT):
        state = run.verdict
    largest = zip(LARGEST_OVERALL.rows, run.largest or (), strict=False)
    overall = (f"{measure.shown(value):.3g} {measure.unit}" for measure, value in largest if not math.isnan(value))
    texts = "  ".join((run.fault or state, *overall, *_annotations(run)))
    return run.id, f"{run.duration:8.1f} s", f"{run.size / 1e6:9.1f} MB", texts


def _annotations(run: RunEntry) -> list[str]:
    """Return a run's tags, note and remark as printed."""
    note = "" if run.header is None else run.header.note
    texts = [" ".join(text.split()) for text in (note, run.remark)]
    return [*(f"#{tag}" for tag in run.tags), *(f"“{text}”" for text in texts if text)]


def run_index(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Update the catalogue from the files; return the exit code."""
    from daq.session.offline import summarise

    catalogue = Catalogue(data_folder(args.folder))
    report = catalogue.index(summarise, verify_files=args.verify, on_status=console.progress)
    console.done()
    faults = {entry.id: entry.fault or entry.verdict for entry in catalogue.runs()}
    damaged = [run_id for run_id, fault in faults.items() if fault not in ("", Verdict.INTACT)]
    if args.json:
        from daq.schemas.runs import IndexReportSchema

        print_json(IndexReportSchema.of(report))
    else:
        changes = (("new", report.new), ("changed", report.changed), ("missing", report.missing))
        rows = [(name, run_id) for name, run_ids in changes for run_id in run_ids]
        rows += [("damaged", f"{run_id}: {faults[run_id]}") for run_id in damaged]
        print_output(
            grid(*rows, label_width=8), f"{catalogue.folder}: {len(faults)} runs, {report.unchanged} unchanged"
        )
    return INCOMPLETE if damaged else 0


def run_runs(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """List runs; return the exit code."""
    low, high = (None, None) if args.speed is None else (each * RPM for each in args.speed)
    search = Search(
        started_from_ns=args.since,
        started_before_ns=args.before,
        speed_low=low,
        speed_high=high,
        overall=tuple(
            (measure.name, measure.scale * ends[0], measure.scale * ends[1])
            for measure in OVERALL.rows
            if (ends := getattr(args, measure.name)) is not None
        ),
        text=args.text,
        tags=tuple(args.tag),
        onset_below=None if args.onset_below is None else args.onset_below * RPM,
        rig=args.rig,
        serial=args.device,
        calibration=args.calibration,
    )
    catalogue = Catalogue(data_folder(args.folder))
    runs = catalogue.search(search) if search != Search() else catalogue.runs()
    if args.json:
        from daq.schemas.runs import run_schema

        print_json([run_schema(run) for run in runs])
    elif runs:
        print_runs(runs)
    else:
        print(f"no {'matching ' if search != Search() else ''}runs in {catalogue.folder}")
    return 0


def run_annotate(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Set the remark and tags of a run; return the exit code."""
    catalogue, run_id = find_run(args)
    tags = None
    if args.tag or args.untag:
        tags = (set(catalogue.run(run_id).tags) | set(args.tag)) - set(args.untag)
    run = catalogue.annotate(run_id, remark=args.remark, tags=tags)
    if args.json:
        from daq.schemas.runs import run_schema

        print_json(run_schema(run))
    else:
        print("  ".join((run.id, *_annotations(run))))
    return 0


def _time_ns(text: str) -> int:
    """Return an ISO 8601 time as ns since 1970; without a zone it is local time."""
    try:
        return round(datetime.fromisoformat(text).astimezone(UTC).timestamp()) * NANOSECONDS
    except (ValueError, OverflowError, OSError):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a time such as 2026-11-24T09:00") from None


def _range(text: str) -> tuple[float, float]:
    """Return the ends of a range such as 9000-12000, both 0 or more."""
    try:
        low, high = map(float, text.split("-"))
    except ValueError:
        low, high = 0.0, -1.0
    if not 0 <= low <= high:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a range such as 9000-12000")
    return low, high


def run_summary(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Print the summary of a run; return the exit code."""
    from daq.cli.run_text import print_summary
    from daq.config.calibration import load_calibration
    from daq.reports.run_summaries import Summaries
    from daq.session.predictor import Predictors

    catalogue, run_id = find_run(args)
    calibrations = {name: load_calibration(path) for name, path in args.calibration}
    with closing(Predictors()) as predictors:
        summaries = Summaries(catalogue, predictors)
        if calibrations:
            summary = summaries.recalibrated_summary(run_id, calibrations, console.progress)
        else:
            summary = summaries.summary_with_agreement(run_id, console.progress)
    console.done()
    print_summary(summary, as_json=args.json)
    return 0 if summary.is_gap_free else INCOMPLETE


def run_verify(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Verify a recording; return the exit code."""
    from daq.schemas.checks import VerificationSchema

    catalogue, run_id = find_run(args)
    verification = verify(catalogue.path(run_id), partial(console.progress, f"verifying {run_id}"))
    console.done()
    if args.json:
        print_json(VerificationSchema.of(verification))
    else:
        findings = (
            ("fault" if finding.is_fault else "note", finding.check.value, f"{finding.where}: {finding.what}")
            for finding in verification.findings
        )
        print_output(_verdict(verification), grid(*findings))
    return 0 if verification.verdict is Verdict.INTACT else INCOMPLETE


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _verdict(verification: Verification) -> str:
    pulses = f"{verification.pulses:,} counter timestamps, " if verification.pulses else ""
    return (
        f"{verification.path}: {verification.verdict.value}  {verification.samples:,} samples per channel, "
        f"{_plural(verification.segments, 'segment')}, {pulses}{verification.chunks} intact chunks, "
        f"{verification.size / 1e6:.1f} MB"
    )


def run_recover(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Copy the intact part of a recording; return the exit code."""
    from daq.schemas.checks import RecoverySchema
    from recordings.integrity.recover import recover

    catalogue, run_id = find_run(args)
    source = catalogue.path(run_id)
    recovery = recover(source, args.output or source.with_name(f"{source.stem}-recovered{SUFFIX}"))
    if args.json:
        print_json(RecoverySchema.of(recovery))
    else:
        print(
            f"{recovery.target}: {recovery.samples:,} samples per channel in "
            f"{_plural(len(recovery.segments), 'segment')}, {_plural(recovery.damaged_chunks, 'damaged chunk')} "
            "left out"
        )
        print("\n".join(map(_missing_line, recovery.missing)) or "nothing is missing")
    return INCOMPLETE if recovery.missing else 0


def _missing_line(missing: "MissingSamples") -> str:
    if missing.stop is None:
        return f"missing  segment {missing.segment}: everything after its first {missing.first} samples"
    last = missing.stop - 1
    return f"missing  segment {missing.segment}: samples {missing.first} to {last} ({missing.samples} per channel)"
