"""`rig check`: whether a rig file and the calibrations that it names are good, without any hardware."""

import argparse
from pathlib import Path

from daq.cli.telling import print_json
from daq.config.load import load_rig
from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers import simulated_converter as converter
from daq.errors import ConfigError
from daq.service.documents.rig_check import RigCheckDocument, faulty_document, good_document
from daq.session.rig_checks import disk_rate


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
    document = good_document(
        rig,
        rate=rate,
        convert_rate=converter.convert_rate(rate, len(rig.config.channel)),
        disk_rate=disk_rate(rig, rate),
    )
    if chosen.json:
        print_json(document)
    else:
        print(_line(rig, document))
    return 0


def _line(rig: Rig, document: RigCheckDocument) -> str:
    """Return what was understood in one line."""
    device = rig.config.device
    card = f"simulated {device.product}" if device.backend is Backend.SIMULATED else device.product
    if device.backend is Backend.NIDAQMX:
        card += f" serial number {device.serial}" if device.serial else f" as {device.name}"
    inputs = ", ".join(f"{channel.name} on {channel.physical}" for channel in document.channels)
    convert = document.convert_rate_hz or 0.0
    return (
        f"{rig.path}: good: {rig.config.rig} on {card}, {inputs}, {(document.sample_rate_hz or 0.0) / 1e3:g} kS/s each, "
        f"convert clock {convert / 1e3:.4g} kHz ({1e6 / convert:.2f} µs between channels), "
        f"at most {(document.disk_bytes_per_hour or 0) / 1e9:.2g} GB an hour"
    )
