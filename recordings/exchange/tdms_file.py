"""TDMS, LabVIEW's binary format: waveform channels in groups; columns are named "group/channel"."""

from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.progress import Progress

GROUP = "run"


def read(path: Path) -> Table:
    """Return the table of a file; channels without numbers are left out."""
    file = TdmsFile.read(path)
    _require_whole(file)
    columns, steps, starts = [], set(), set()
    for group in file.groups():
        for channel in group.channels():
            values = channel[:]
            if not len(values) or not np.issubdtype(values.dtype, np.number):
                continue
            unit = str(channel.properties.get("unit_string", ""))
            is_code = values.dtype == np.int16
            columns.append(
                Column(f"{group.name}/{channel.name}", unit, values if is_code else values.astype(np.float64))
            )
            if "wf_increment" in channel.properties:
                steps.add(float(channel.properties["wf_increment"]))
            if "wf_start_time" in channel.properties:
                starts.add(int(np.datetime64(channel.properties["wf_start_time"], "ns").astype(np.int64)))
    if len(steps) > 1:
        raise ForeignFormatError(f"channels of different rates: wf_increment {sorted(steps)} s")
    properties = {name: str(value) for name, value in file.properties.items()}
    rate = float(properties["rate_hz"]) if "rate_hz" in properties else (1 / steps.pop() if steps else None)
    return Table(tuple(columns), rate, min(starts, default=None), properties)


def _require_whole(file: TdmsFile) -> None:
    """Raise ForeignFormatError if the last segment has fewer values than it declares."""
    for path, status in (file.file_status.channel_statuses or {}).items():
        if status.read_length < status.expected_length:
            read, expected = status.read_length, status.expected_length
            raise ForeignFormatError(f"is cut short: {read:,} of {expected:,} values in the last segment of {path}")


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a table to a new file: one group, one channel per column."""
    waveform: dict[str, object] = {}
    properties: dict[str, object] = dict(table.properties)
    if table.rate is not None:
        properties["rate_hz"] = table.rate
        waveform |= {"wf_increment": 1 / table.rate, "wf_start_offset": 0.0, "wf_samples": table.n_rows}
    if table.started_ns is not None:
        waveform["wf_start_time"] = np.datetime64(table.started_ns, "ns")
    with path.open("xb") as file, TdmsWriter(file) as writer:
        channels = [
            ChannelObject(GROUP, column.name, column.values, waveform | {"unit_string": column.unit})
            for column in table.columns
        ]
        writer.write_segment([RootObject(properties), GroupObject(GROUP), *channels])
        on_progress(1.0)
