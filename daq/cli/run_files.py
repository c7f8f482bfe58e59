"""`rig verify` and `rig recover`: whether a recording is whole, and a whole copy of what is left of one that is not.

`rig import` and `rig export`: runs from and for other programs.
"""

import argparse
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from daq.cli.arguments import add_folder, show_examples
from daq.cli.output.progress import Console
from daq.cli.output.terminal import print_json, show
from daq.cli.runs import found
from daq.schemas.verification import recovery_schema, verification_schema
from daq.session.import_run import import_run
from recordings.catalogue.catalogue import SUFFIX, Catalogue, data_folder
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import EXPORTS, IMPORTS, write_table
from recordings.integrity.recover import Missing, recover
from recordings.integrity.verify import Verdict, Verification, verify
from recordings.mcap.reader import RunReader

Add = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_exchange_commands(add: Add) -> None:
    """Add both commands to the command line."""
    text = f"Make another program's file into a run ({', '.join(IMPORTS)})."
    command = add("import", run_import, text)
    command.add_argument("file", metavar="FILE", help="the file; it is only read")
    text = "which column is which channel of which rig, and in what unit; docs/exchange.md describes it"
    command.add_argument("--mapping", required=True, metavar="MAP.TOML", help=text)
    add_folder(command)

    show_examples(command, "rig import bench.tdms --mapping bench-tdms.toml")

    text = f"Give a run or a part of it to another program ({', '.join(EXPORTS)})."
    command = add("export", run_export, text)
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    command.add_argument("--to", required=True, metavar="FILE", help="the new file; its suffix tells the format")
    command.add_argument(
        "--from",
        dest="start",
        type=_time,
        default=0.0,
        metavar="TIME",
        help="such as 10s, 1.5min (default: its beginning)",
    )
    command.add_argument(
        "--until", dest="stop", type=_time, default=math.inf, metavar="TIME", help="such as 20s (default: its end)"
    )
    command.add_argument("--segment", type=int, help="which stretch of samples, from 0, where there are several")
    instead = command.add_mutually_exclusive_group()
    instead.add_argument("--results", action="store_true", help="speeds, amplitudes and lags instead of the samples")
    text = "the edges of the tacho as a counter stamped them, instead of the samples"
    instead.add_argument("--pulses", action="store_true", help=text)
    add_folder(command)
    show_examples(
        command,
        "rig export 2026-11-24T09-12-07-gj90c --from 10s --to whirl.csv",
        "rig export 2026-11-24T09-12-07-gj90c --results --to vectors.parquet",
    )


def run_import(chosen: argparse.Namespace) -> int:
    """Import a file; return the exit code."""
    catalogue = Catalogue(data_folder(chosen.folder))
    run_id, path = import_run(Path(chosen.file), Path(chosen.mapping), catalogue)
    with RunReader(path) as reader:
        channels = len(reader.header.acquisition.channels)
        rate = reader.header.acquisition.rate
        print(f"run {run_id}  {channels} × {rate / 1e3:g} kS/s  {reader.duration:.1f} s  {path}")
    return 0


def run_export(chosen: argparse.Namespace) -> int:
    """Export a run; return the exit code."""
    catalogue, run_id = found(chosen.recording, chosen.folder)
    target, console = Path(chosen.to), Console()
    with RunReader(catalogue.path(run_id)) as reader:
        made = results_table if chosen.results else pulses_table if chosen.pulses else samples_table
        reading = partial(console.progress, f"reading {run_id}")
        table = made(reader, chosen.start, chosen.stop, chosen.segment, reading)
    write_table(target, table, partial(console.progress, f"writing {table.n_rows:,} rows"))
    console.done()
    names = ", ".join(column.name for column in table.columns)
    print(f"{target}: {table.n_rows:,} rows of {names}")
    return 0


def _time(text: str) -> float:
    """Return a time such as 0, 10s or 1.5min in s."""
    for unit, factor in (("min", 60.0), ("h", 3600.0), ("s", 1.0), ("", 1.0)):
        if text.endswith(unit):
            try:
                seconds = float(text.removesuffix(unit)) * factor
            except ValueError:
                break
            if 0 <= seconds < math.inf:
                return seconds
            break
    raise argparse.ArgumentTypeError(f"{text!r}: expected a time such as 10s or 1.5min")


NOT_WHOLE = 5


def add_verify_commands(add: Add) -> None:
    """Add both commands to the command line."""
    command = add("verify", run, "Check that a recording is whole: checksums, indexes, samples, counts, calibration.")
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file")
    add_folder(command)
    command.add_argument("--json", action="store_true", help="as JSON")

    text = "Copy all that is intact of a damaged recording, and say what is missing."
    command = add("recover", run_recover, text)
    command.add_argument("recording", metavar="RUN", help="a run's id, or a file; it is only read")
    command.add_argument(
        "-o", dest="output", default="", metavar="NEW.MCAP", help="the copy (default: RUN-recovered.mcap beside it)"
    )
    add_folder(command)
    command.add_argument("--json", action="store_true", help="as JSON")


def run(chosen: argparse.Namespace) -> int:
    """Inspect a recording; return the exit code."""
    catalogue, run_id = found(chosen.recording, chosen.folder)
    console = Console()
    verification = verify(catalogue.path(run_id), partial(console.progress, f"verifying {run_id}"))
    console.done()
    if chosen.json:
        print_json(verification_schema(verification))
    else:
        show(_lines(verification))
    return 0 if verification.verdict is Verdict.SOUND else NOT_WHOLE


def _lines(verification: Verification) -> Iterator[str]:
    """Yield the verdict, and what was found."""
    yield (
        f"{verification.path}: {verification.verdict.value}  {verification.samples:,} samples a channel, "
        f"{verification.segments} {'segment' if verification.segments == 1 else 'segments'}, "
        f"{f'{verification.pulses:,} stamps of a counter, ' if verification.pulses else ''}"
        f"{verification.chunks} intact chunks, {verification.size / 1e6:.1f} MB"
    )
    for finding in verification.findings:
        kind = "fault" if finding.is_fault else "note "
        yield f"{kind}  {finding.check.value:11} {finding.where}: {finding.what}"


def run_recover(chosen: argparse.Namespace) -> int:
    """Copy what is intact of a recording; return the exit code."""
    catalogue, run_id = found(chosen.recording, chosen.folder)
    source = catalogue.path(run_id)
    target = Path(chosen.output) if chosen.output else source.with_name(f"{source.stem}-recovered{SUFFIX}")
    recovery = recover(source, target)
    if chosen.json:
        print_json(recovery_schema(recovery))
    else:
        print(
            f"{recovery.target}: {recovery.samples:,} samples a channel in {len(recovery.stretches)} "
            f"{'segment' if len(recovery.stretches) == 1 else 'segments'}, "
            f"{recovery.damaged_chunks} damaged {'chunk' if recovery.damaged_chunks == 1 else 'chunks'} left out"
        )
        for missing in recovery.missing:
            print(_told(missing))
        if not recovery.missing:
            print("nothing is missing")
    return NOT_WHOLE if recovery.missing else 0


def _told(missing: Missing) -> str:
    if missing.stop is None:
        return f"missing  segment {missing.segment}: whatever came after its first {missing.first} samples"
    last = missing.stop - 1
    return f"missing  segment {missing.segment}: samples {missing.first} to {last} ({missing.samples} a channel)"
