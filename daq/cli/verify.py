"""`rig verify` and `rig recover`: check a recording, and copy the intact part of a damaged one."""

import argparse
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from daq.cli.arguments import INCOMPLETE, AddCommand, add_folder
from daq.cli.progress import TerminalOutput
from daq.cli.runs import find_run
from daq.cli.terminal import print_json, print_lines
from daq.schemas.checks import RecoverySchema, VerificationSchema
from recordings.catalogue.catalogue import SUFFIX
from recordings.integrity.recover import MissingSamples, recover
from recordings.integrity.verify import Verdict, Verification, verify


def add_commands(add: AddCommand) -> None:
    """Add `rig verify` and `rig recover` to the command line."""
    command = add("verify", run_verify)
    command.add_argument("recording", metavar="RUN", help="run id or file")
    add_folder(command)
    command.add_argument("--json", action="store_true", help="print JSON")

    command = add("recover", run_recover)
    command.add_argument("recording", metavar="RUN", help="run id or file; it is not changed")
    command.add_argument(
        "-o", dest="output", default="", metavar="NEW.MCAP", help="the copy (default: RUN-recovered.mcap beside it)"
    )
    add_folder(command)
    command.add_argument("--json", action="store_true", help="print JSON")


def run_verify(args: argparse.Namespace) -> int:
    """Verify a recording; return the exit code."""
    catalogue, run_id = find_run(args.recording, args.folder)
    console = TerminalOutput()
    verification = verify(catalogue.path(run_id), partial(console.progress, f"verifying {run_id}"))
    console.done()
    if args.json:
        print_json(VerificationSchema.of(verification))
    else:
        print_lines(_verification_lines(verification))
    return 0 if verification.verdict is Verdict.SOUND else INCOMPLETE


def _verification_lines(verification: Verification) -> Iterator[str]:
    """Yield the verdict and the findings, line by line."""
    yield (
        f"{verification.path}: {verification.verdict.value}  {verification.samples:,} samples per channel, "
        f"{verification.segments} {'segment' if verification.segments == 1 else 'segments'}, "
        f"{f'{verification.pulses:,} counter stamps, ' if verification.pulses else ''}"
        f"{verification.chunks} intact chunks, {verification.size / 1e6:.1f} MB"
    )
    for finding in verification.findings:
        kind = "fault" if finding.is_fault else "note "
        yield f"{kind}  {finding.check.value:11} {finding.where}: {finding.what}"


def run_recover(args: argparse.Namespace) -> int:
    """Copy the intact part of a recording; return the exit code."""
    catalogue, run_id = find_run(args.recording, args.folder)
    source = catalogue.path(run_id)
    target = Path(args.output) if args.output else source.with_name(f"{source.stem}-recovered{SUFFIX}")
    recovery = recover(source, target)
    if args.json:
        print_json(RecoverySchema.of(recovery))
    else:
        print(
            f"{recovery.target}: {recovery.samples:,} samples per channel in {len(recovery.segments)} "
            f"{'segment' if len(recovery.segments) == 1 else 'segments'}, "
            f"{recovery.damaged_chunks} damaged {'chunk' if recovery.damaged_chunks == 1 else 'chunks'} left out"
        )
        for missing in recovery.missing:
            print(_missing_line(missing))
        if not recovery.missing:
            print("nothing is missing")
    return INCOMPLETE if recovery.missing else 0


def _missing_line(missing: MissingSamples) -> str:
    if missing.stop is None:
        return f"missing  segment {missing.segment}: everything after its first {missing.first} samples"
    last = missing.stop - 1
    return f"missing  segment {missing.segment}: samples {missing.first} to {last} ({missing.samples} per channel)"
