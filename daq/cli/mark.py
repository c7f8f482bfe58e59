"""`rig mark`: name the present moment of the run that is being recorded, from another terminal or a script."""

import argparse

from daq.cli.running_service import order
from daq.cli.summary_text import print_json


def run(chosen: argparse.Namespace) -> int:
    """Ask the recording's service to keep a word; return the exit code."""
    made = order(chosen, "marks", {"text": " ".join(chosen.word) or "mark"})
    if chosen.json:
        print_json(made)
        return 0
    print(f"marked “{made['text']}” at {made['time_s']:.1f} s of segment {made['segment']}")
    return 0
