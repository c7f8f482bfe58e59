"""`rig verify` and `rig recover`: whether a recording is whole, and a whole copy of what is left of one that is not."""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from daq.cli.arguments import add_folder
from daq.cli.progress import Console
from daq.cli.replay import found
from daq.cli.summary_text import print_json
from daq.cli.terminal import show
from daq.schemas.verification import recovery_document, verification_document
from recordings.catalogue.catalogue import SUFFIX
from recordings.integrity.recover import Missing, recover
from recordings.integrity.verify import Verdict, Verification, verify

NOT_WHOLE = 5

Add = Callable[[str, Callable[[argparse.Namespace], int], str], argparse.ArgumentParser]


def add_commands(add: Add) -> None:
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
        print_json(verification_document(verification))
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
        print_json(recovery_document(recovery))
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
