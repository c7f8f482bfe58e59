"""A foreign file made into a run, for a rig that a mapping names."""

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.header import Acquisition, Channel, Device, Role, RunHeader
from daq.config.import_mapping import ChannelMapping, load_mapping
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.config.schema import ChannelSection
from daq.errors import ConfigError
from daq.session.runout_reference import with_reference_runout
from recordings.catalogue.catalogue import Catalogue
from recordings.catalogue.incoming_run import move_without_overwriting
from recordings.exchange.formats import read_table
from recordings.exchange.imported_channels import LENGTH_UNITS, ImportedChannel, imported_channel, imported_items
from recordings.mcap.layout import IMPORTED_RECORD
from recordings.mcap.writer import write_run

IMPORTED_BACKEND = "imported"
"""What has delivered the samples of a run that was imported."""
SIMULTANEOUS_CONVERT_RATE = 1e12
"""Convert rate, Hz, where nothing is known of a multiplexer: all channels are sampled at once."""
RATE_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class ForeignFile:
    """A file of another program and what is known of it.

    Parameters
    ----------
    path : Path
        Where it lies; its suffix tells the format.
    name : str
        What it is called.
    mapping : ChannelMapping
        Which of its columns are which channels.
    mapping_name, mapping_text : str
        What the mapping is called, and how it was written.
    """

    path: Path
    name: str
    mapping: ChannelMapping
    mapping_name: str
    mapping_text: str


def import_run(file: Path, mapping_file: Path, catalogue: Catalogue) -> tuple[str, Path]:
    """Make a foreign file into a run of a data folder; return its id and its file.

    Raises
    ------
    ConfigError
        Where the mapping or the rig's file is wrong, or they do not fit each other or the file.
    RecordingError
        Where the file cannot be read or the run cannot be written.
    """
    mapping, text = load_mapping(mapping_file)
    rig = with_reference_runout(load_rig(mapping_file.parent / mapping.rig), catalogue.folder)
    return write_imported_run(ForeignFile(file, file.name, mapping, str(mapping_file), text), rig, catalogue)


def require_mapping_fits(foreign: ForeignFile, rig: Rig) -> None:
    """Raise ConfigError where a mapping does not give every channel of a rig what it needs."""
    if faults := _misfits(foreign.mapping, rig):
        raise ConfigError(foreign.mapping_name, faults)


def _misfits(mapping: ChannelMapping, rig: Rig) -> list[str]:
    missing = [section.name for section in rig.config.channel if section.name not in mapping.channel]
    unknown = mapping.channel.keys() - {section.name for section in rig.config.channel}
    faults = [f"channel.{name}: is missing, expected the column of the rig's channel" for name in missing]
    faults += [f"channel.{name}: the rig has no such channel" for name in sorted(unknown)]
    for section in rig.config.channel:
        wanted = mapping.channel.get(section.name)
        if wanted is not None and section.role is Role.TACHO and wanted.unit in LENGTH_UNITS:
            faults.append(f'channel.{section.name}.unit = "{wanted.unit}": a tacho gives "V" or "mV"')
    return faults


def write_imported_run(
    foreign: ForeignFile,
    rig: Rig,
    catalogue: Catalogue,
    drafts: Path | None = None,
    told: Callable[[float], None] | None = None,
) -> tuple[str, Path]:
    """Make a foreign file into a run of a rig; return its id and its file.

    Parameters
    ----------
    foreign, rig, catalogue : Foreign, Rig, Catalogue
        What is imported, of which rig, and where to.
    drafts : Path or None
        A folder on the disk of the runs in which it is written first, so that nobody sees half a run.
    told : callable or None
        Told what part of the samples is written and analysed, 0 to 1.

    Raises
    ------
    ConfigError
        Where the mapping does not fit the rig or the file.
    RecordingError
        Where the file cannot be read or the run cannot be written.
    """
    mapping, table = foreign.mapping, read_table(foreign.path)
    rate, faults = mapping.rate_hz or table.rate, _misfits(mapping, rig)
    if rate is None:
        faults.append(f"rate_hz: is missing, and {foreign.name} does not tell how fast it was sampled")
    elif table.rate is not None and abs(rate - table.rate) > RATE_TOLERANCE * rate:
        faults.append(f"rate_hz = {rate:g}: {foreign.name} says {table.rate:g}")
    if faults or rate is None:
        raise ConfigError(foreign.mapping_name, faults)
    channels = []
    for section in rig.config.channel:
        wanted = mapping.channel[section.name]
        column = table.column(wanted.source)
        channels.append(imported_channel(column, _channel(rig, section), wanted.unit, wanted.factor))
    started_ns = next(
        moment
        for moment in (mapping.started_ns, table.started_ns, foreign.path.stat().st_mtime_ns)
        if moment is not None
    )
    run_id, path = catalogue.new_run(rig.config.rig, started_ns)
    header = _header(rig, run_id, started_ns, rate, channels)
    with foreign.path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    origin = {
        "source": foreign.name,
        "sha256": digest,
        "mapping": foreign.mapping_text,
        "properties": dict(table.properties),
        "columns": {wanted.source: table.column(wanted.source).unit for wanted in mapping.channel.values()},
    }
    note = mapping.note or table.properties.get("note", "")
    items = imported_items(channels, rate, started_ns)
    if told is not None:
        items = _told(items, table.n_rows, told)
    written = path if drafts is None else drafts / path.name
    write_run(written, replace(header, note=note), items, {IMPORTED_RECORD: origin})
    if drafts is not None:
        move_without_overwriting(written, path)
    return run_id, path


def _told(items: Iterator[SourceItem], n_rows: int, told: Callable[[float], None]) -> Iterator[SourceItem]:
    for item in items:
        if isinstance(item, SampleBlock):
            told(item.first_sample / n_rows)
        yield item


def _header(rig: Rig, run_id: str, started_ns: int, rate: float, channels: list[ImportedChannel]) -> RunHeader:
    acquisition = Acquisition(
        device=Device(IMPORTED_BACKEND, "", "", "", simulated=False),
        rate=rate,
        convert_rate=SIMULTANEOUS_CONVERT_RATE,
        channels=tuple(each.channel for each in channels),
        tacho=replace(rig.tacho, counter=None),  # its stamps are in no foreign file
    )
    return RunHeader(
        run=run_id,
        rig=rig.config.rig,
        started_ns=started_ns,
        acquisition=acquisition,
        settings=rig.settings,
        limits=rig.limits,
        config_toml=rig.toml,
        program=f"rig {version('rig-service')}",
        note="",
    )


def _channel(rig: Rig, section: ChannelSection) -> Channel:
    low, high = section.gap_window_v if section.role is not Role.TACHO else (-math.inf, math.inf)
    return Channel(
        name=section.name,
        role=section.role,
        physical=section.physical,
        range_low=-section.range_v,
        range_high=section.range_v,
        scaling=(0.0, 1.0),
        calibration=rig.calibrations.get(section.name),
        angle=math.radians(section.angle_deg),
        gap_low=low,
        gap_high=high,
    )
