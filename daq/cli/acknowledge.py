"""`rig acknowledge`: take note of the alarms of the run that goes on, from another terminal or a script."""

import argparse
import json

from daq.cli.running_service import order


def run(chosen: argparse.Namespace) -> int:
    """Ask the run's service to note its alarms as seen; return the exit code."""
    made = order(chosen, "acknowledge", {})
    if chosen.json:
        print(json.dumps(made, ensure_ascii=False, indent=2))
        return 0
    for alarm in made["alarms"]:
        size = f"{alarm['largest_peak_to_peak_um']:.0f} µm peak-to-peak, limit {alarm['limit_peak_to_peak_um']:g}"
        print(f"acknowledged {alarm['severity']} at {alarm['probe']}: {size}")
    if not made["alarms"]:
        print("no new alarm")
    return 0
