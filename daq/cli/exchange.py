"""`rig import` and `rig export`: runs from and for other programs."""

import argparse
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

from daq.cli.arguments import add_folder, show_examples
from daq.cli.progress import Console
from daq.cli.replay import found
from daq.session.import_run import import_run
from recordings.catalogue.catalogue import Catalogue, data_folder
from recordings.exchange.export import pulses_table, results_table, samples_table
from recordings.exchange.formats import EXPORTS, IMPORTS, write_table
from recordings.mcap.reader import RunReader

Add = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_commands(add: Add) -> None:
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
