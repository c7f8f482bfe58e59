"""`rig acknowledge`: take note of the alarms of the run that goes on, from another terminal or a script."""

import argparse

from daq.cli.running_service import order
from daq.cli.summary_text import print_json


def run(chosen: argparse.Namespace) -> int:
    """Ask the run's service to note its alarms as seen; return the exit code."""
    made = order(chosen, "acknowledge", {})
    if chosen.json:
        print_json(made)
        return 0
    for alarm in made["alarms"]:
        print(f"acknowledged {alarm['name']}: {alarm['told']}")
    if not made["alarms"]:
        print("no new alarm")
    return 0
