"""Import of files from other programs as runs of a rig, with a mapping from columns to channels."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.header import Acquisition, Device, Role, RunHeader
from daq.config.import_mapping import ChannelMapping, load_mapping
from daq.config.loader import load_rig
from daq.config.rig import Rig
from daq.errors import ConfigError
from daq.session.offline import with_reference_runout
from recordings.catalogue.catalogue import Catalogue
from recordings.exchange.formats import read_table
from recordings.exchange.table import LENGTH_UNITS, ImportedChannel, imported_channel, imported_items
from recordings.file_operations import move_without_overwriting
from recordings.mcap.layout import IMPORTED_RECORD
from recordings.mcap.writer import write_run

IMPORTED_BACKEND = "imported"
"""Value of `Device.backend` in an imported run."""
SIMULTANEOUS_CONVERT_RATE = 1e12
"""Convert rate, Hz, without a known multiplexer: all channels are sampled at the same time."""
RATE_TOLERANCE = 1e-3  # relative, between the rate in the mapping and in the file


@dataclass(frozen=True, slots=True)
class ForeignFile:
    """A file from another program, with its mapping.

    Parameters
    ----------
    path : Path
        Its path; the suffix determines the format.
    name : str
        Its name in messages and in the run.
    mapping : ChannelMapping
        Assigns its columns to the channels.
    mapping_name, mapping_text : str
        Name and source text of the mapping.
    """

    path: Path
    name: str
    mapping: ChannelMapping
    mapping_name: str
    mapping_text: str


def import_run(file: Path, mapping_file: Path, catalogue: Catalogue) -> tuple[str, Path]:
    """Import a file into the data folder of a catalogue; return the run's id and file.

    Raises
    ------
    ConfigError
        The mapping or the rig file is invalid, or the mapping does not match the rig or the file.
    RecordingError
        The file cannot be read or the run cannot be written.
    """
    mapping, text = load_mapping(mapping_file)
    rig = with_reference_runout(load_rig(mapping_file.parent / mapping.rig), catalogue.folder)
    return write_imported_run(ForeignFile(file, file.name, mapping, str(mapping_file), text), rig, catalogue)


def require_mapping_fits(foreign: ForeignFile, rig: Rig) -> None:
    """Raise ConfigError where a mapping does not match the channels of a rig."""
    if faults := _mapping_faults(foreign.mapping, rig):
        raise ConfigError(foreign.mapping_name, faults)


def _mapping_faults(mapping: ChannelMapping, rig: Rig) -> list[str]:
    missing = [section.name for section in rig.config.channel if section.name not in mapping.channel]
    unknown = mapping.channel.keys() - {section.name for section in rig.config.channel}
    faults = [f"channel.{name}: is missing, expected the column of this channel of the rig" for name in missing]
    faults += [f"channel.{name}: the rig has no such channel" for name in sorted(unknown)]
    for section in rig.config.channel:
        wanted = mapping.channel.get(section.name)
        if wanted is not None and section.role is Role.TACHO and wanted.unit in LENGTH_UNITS:
            faults.append(f'channel.{section.name}.unit = "{wanted.unit}": expected "V" or "mV" for a tacho')
    return faults


def write_imported_run(
    foreign: ForeignFile,
    rig: Rig,
    catalogue: Catalogue,
    temporary_folder: Path | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[str, Path]:
    """Write a file as a run of a rig; return the run's id and file.

    Parameters
    ----------
    foreign, rig, catalogue : ForeignFile, Rig, Catalogue
        The file, its rig, and the catalogue that gets the run.
    temporary_folder : Path or None
        Folder on the same disk in which the run is written first, so that no reader sees an incomplete run.
    on_progress : callable or None
        Receives the fraction of the samples written and analysed, 0 to 1.

    Raises
    ------
    ConfigError
        The mapping does not match the rig or the file.
    RecordingError
        The file cannot be read or the run cannot be written.
    """
    mapping, table = foreign.mapping, read_table(foreign.path)
    rate, faults = mapping.rate_hz or table.rate, _mapping_faults(mapping, rig)
    if rate is None:
        faults.append(f"rate_hz: is missing, and {foreign.name} does not state its sample rate")
    elif table.rate is not None and abs(rate - table.rate) > RATE_TOLERANCE * rate:
        faults.append(f"rate_hz = {rate:g}: {foreign.name} says {table.rate:g}")
    if faults or rate is None:
        raise ConfigError(foreign.mapping_name, faults)
    wanted = [mapping.channel[section.name] for section in rig.config.channel]
    channels = [
        imported_channel(
            table.column(each.source),
            rig.channel(section, (-section.range_v, section.range_v), (0.0, 1.0)),
            each.unit,
            each.factor,
        )
        for section, each in zip(rig.config.channel, wanted, strict=True)
    ]
    started_ns = next(
        start for start in (mapping.started_ns, table.started_ns, foreign.path.stat().st_mtime_ns) if start is not None
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
        "columns": {each.source: table.column(each.source).unit for each in mapping.channel.values()},
    }
    note = mapping.note or table.properties.get("note", "")
    items = imported_items(channels, rate, started_ns)
    if on_progress is not None:
        items = _report_progress(items, table.n_rows, on_progress)
    written = path if temporary_folder is None else temporary_folder / path.name
    write_run(written, replace(header, note=note), items, {IMPORTED_RECORD: origin})
    if temporary_folder is not None:
        move_without_overwriting(written, path)
    return run_id, path


def _report_progress(
    items: Iterator[SourceItem], n_rows: int, on_progress: Callable[[float], None]
) -> Iterator[SourceItem]:
    for item in items:
        if isinstance(item, SampleBlock):
            on_progress(item.first_sample / n_rows)
        yield item


def _header(rig: Rig, run_id: str, started_ns: int, rate: float, channels: list[ImportedChannel]) -> RunHeader:
    acquisition = Acquisition(
        device=Device(IMPORTED_BACKEND, "", "", "", simulated=False),
        rate=rate,
        convert_rate=SIMULTANEOUS_CONVERT_RATE,
        channels=tuple(each.channel for each in channels),
        tacho=replace(rig.tacho, counter=None),  # foreign files hold no counter timestamps
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
