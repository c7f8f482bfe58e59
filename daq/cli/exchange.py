"""`rig import` and `rig export`: runs from and for other programs."""

import argparse
import math
from functools import partial
from pathlib import Path

from daq.cli.arguments import AddCommand, add_folder, add_run, time_in_run
from daq.cli.runs import find_run
from daq.cli.terminal import TerminalOutput
from daq.session.import_run import import_run
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import EXPORT_FORMATS, IMPORT_FORMATS, write_table
from recordings.mcap.reader import RunReader


def add_commands(add: AddCommand) -> None:
    """Add `rig import` and `rig export` to the command line."""
    command = add("import", run_import, add_folder, examples=["rig import bench.tdms --mapping bench-tdms.toml"])
    command.add_argument("file", type=Path, metavar="FILE", help=f"the file to read ({', '.join(IMPORT_FORMATS)})")
    command.add_argument(
        "--mapping",
        type=Path,
        required=True,
        metavar="MAP.TOML",
        help="maps columns to the rig's channels, with units; described in docs/exchange.md",
    )

    command = add(
        "export",
        run_export,
        add_run,
        examples=[
            "rig export 2026-11-24T09-12-07-gj90c --from 10s --to whirl.csv",
            "rig export 2026-11-24T09-12-07-gj90c --results --to vectors.parquet",
        ],
    )
    command.add_argument(
        "--to",
        type=Path,
        required=True,
        metavar="FILE",
        help=f"the new file; its suffix sets the format ({', '.join(EXPORT_FORMATS)})",
    )
    command.add_argument(
        "--from",
        dest="start",
        type=time_in_run,
        default=0.0,
        metavar="TIME",
        help="10s, 1.5min … (default: start of the run)",
    )
    command.add_argument(
        "--until",
        dest="stop",
        type=time_in_run,
        default=math.inf,
        metavar="TIME",
        help="20s … (default: end of the run)",
    )
    command.add_argument("--segment", type=int, help="segment to export, from 0; needed where a run has several")
    instead = command.add_mutually_exclusive_group()
    instead.add_argument("--results", action="store_true", help="speeds, amplitudes and lags instead of samples")
    instead.add_argument("--pulses", action="store_true", help="tacho edges timed by the counter instead of samples")


def run_import(args: argparse.Namespace, _console: TerminalOutput) -> int:
    """Import a file as a run; return the exit code."""
    run_id, path = import_run(args.file, args.mapping, Catalogue(data_folder(args.folder)))
    with RunReader(path) as reader:
        channels = len(reader.header.acquisition.channels)
        rate = reader.header.acquisition.rate
        print(f"run {run_id}  {channels} × {rate / 1e3:g} kS/s  {reader.duration:.1f} s  {path}")
    return 0


def run_export(args: argparse.Namespace, console: TerminalOutput) -> int:
    """Export a run to a file; return the exit code."""
    catalogue, run_id = find_run(args)
    make_table = results_table if args.results else pulses_table if args.pulses else samples_table
    with RunReader(catalogue.path(run_id)) as reader:
        reading = partial(console.progress, f"reading {run_id}")
        table = make_table(reader, args.start, args.stop, args.segment, reading)
    write_table(args.to, table, partial(console.progress, f"writing {table.n_rows:,} rows"))
    console.done()
    print(f"{args.to}: {table.n_rows:,} rows of {', '.join(column.name for column in table.columns)}")
    return 0
