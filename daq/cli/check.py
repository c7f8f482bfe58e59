"""`rig check`: whether a rig file and the calibrations that it names are good, without any hardware."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from daq.cli.summary_text import print_json
from daq.cli.terminal import show
from daq.config.load import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers.simulation import converter
from daq.errors import ConfigError
from daq.schemas.rig_check import faulty_document, good_document
from daq.session.preflight.rig_checks import disk_rate


def run(chosen: argparse.Namespace) -> int:
    """Check a rig file; return the exit code."""
    try:
        rig = load_rig(Path(chosen.config))
    except ConfigError as error:
        if not chosen.json:
            raise
        print_json(faulty_document(error))
        return error.exit_code
    rate = converter.coerced_rate(rig.config.timing.rate_hz)
    convert_rate = converter.convert_rate(rate, len(rig.config.channel))
    if chosen.json:
        print_json(good_document(rig, rate=rate, convert_rate=convert_rate, disk_rate=disk_rate(rig, rate)))
    else:
        show(_lines(rig, rate, convert_rate))
    return 0


def _lines(rig: Rig, rate: float, convert_rate: float) -> Iterator[str]:
    """Yield what was understood; rates in Hz."""
    device = rig.config.device
    card = f"simulated {device.product}" if device.backend is Backend.SIMULATED else device.product
    if device.backend is Backend.NIDAQMX:
        card += f" serial number {device.serial}" if device.serial else f" as {device.name}"
    inputs = ", ".join(f"{channel.name} on {channel.physical}" for channel in rig.config.channel)
    yield f"{rig.path}: good"
    yield f"  rig      {rig.config.rig} on {card}"
    yield f"  inputs   {inputs}"
    between = f"convert clock {convert_rate / 1e3:.4g} kHz ({1e6 / convert_rate:.2f} µs between channels)"
    yield f"  rate     {rate / 1e3:g} kS/s each, {between}"
    counter = rig.tacho.counter
    if counter is not None:
        stamped = f"edges stamped by {counter.counter} on {counter.terminal} to {1e9 / counter.timebase:g} ns"
        yield f"  tacho    {stamped}; speed and phase from the {rig.tacho.reference}"
    yield f"  disk     at most {disk_rate(rig, rate) * 3600 / 1e9:.2g} GB an hour"
