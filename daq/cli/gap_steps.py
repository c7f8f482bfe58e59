"""The dialog of `rig calibrate gap`: the gap of each micrometer step is asked for, and its voltage measured."""

import csv
import math
import sys
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from daq.config.rig import MICRO, Rig
from daq.errors import DeviceError
from daq.session.preflight.calibration import Point, measured_point, probe_row


def stepped(rig: Rig, name: str, path: Path) -> list[Point]:
    """Ask for the gap of each micrometer step, and measure it.

    Parameters
    ----------
    rig : Rig
        The rig.
    name : str
        Of the probe's channel.
    path : Path
        The record to be written; beside it the points are kept where the dialog breaks off.

    Raises
    ------
    DeviceError
        The first step cannot be measured; what fails later can be tried again.
    """
    physical = rig.config.channel[probe_row(rig, name)].physical
    _say(
        f"probe {name} on {physical}: set the micrometer, wait until it is still, and enter the gap in µm (0 where the "
        "tip touches).\nAn empty line ends; a - takes the last step back."
    )
    points: list[Point] = []
    try:
        while answer := _asked(len(points) + 1):
            _take(answer, points, rig, name)
    except KeyboardInterrupt:
        if points:
            _say(f"\nthe {len(points)} points are kept in {keep(path, points)}: give them with --points")
        raise
    _say("")
    return points


def keep(path: Path, points: Sequence[Point]) -> Path:
    """Write points as CSV beside a record of theirs, over nothing that is there; return the file."""
    stems = (path.stem if number == 1 else f"{path.stem}-{number}" for number in count(1))
    saved = next(file for file in (path.with_name(f"{stem}.csv") for stem in stems) if not file.exists())
    saved.parent.mkdir(parents=True, exist_ok=True)
    with saved.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["gap_um", "volts"])
        writer.writerows((f"{point.gap / MICRO:g}", f"{point.volts:.6f}") for point in points)
    return saved


def _asked(step: int) -> str:
    print(f"step {step}, gap in µm: ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def _take(answer: str, points: list[Point], rig: Rig, name: str) -> None:
    """Do what an answer says: take the last step back, or measure one."""
    if answer == "-":
        del points[-1:]
        return
    gap_um = _gap(answer)
    if gap_um is None:
        _say(f"{answer!r}: expected a gap in µm, 0 or more, such as 250")
        return
    try:
        points.append(measured_point(rig, name, gap_um * MICRO))
    except DeviceError as error:
        if not points:
            raise
        _say(f"  not measured: {error}")
    else:
        _say(f"  {points[-1].volts:.4f} V, scatter {1e3 * points[-1].scatter:.1f} mV rms")


def _gap(answer: str) -> float | None:
    try:
        value = float(answer.replace(",", "."))
    except ValueError:
        return None
    return value if 0.0 <= value < math.inf else None


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
