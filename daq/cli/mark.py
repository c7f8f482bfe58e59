"""`rig mark`: name the present moment of the run that is being recorded, from another terminal or a script."""

import argparse
import json

from daq.cli.running_service import order


def run(chosen: argparse.Namespace) -> int:
    """Ask the recording's service to keep a word; return the exit code."""
    made = order(chosen, "marks", {"text": " ".join(chosen.word) or "mark"})
    if chosen.json:
        print(json.dumps(made, ensure_ascii=False, indent=2))
        return 0
    print(f"marked “{made['text']}” at {made['time_s']:.1f} s of segment {made['segment']}")
    return 0
