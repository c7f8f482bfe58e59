"""Formats of measurement programs: LabVIEW's TDMS, the universal file format (UFF), WAV (read only)."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table, library_errors
from recordings.file_operations import Progress

TDMS_GROUP = "run"
UFF_EMPTY = "NONE"


def read_tdms(path: Path) -> Table:
    """Return the table of a TDMS file, with columns named "group/channel"; channels without numbers are left out."""
    from nptdms import TdmsFile  # noqa: PLC0415 - an extra

    with library_errors(path):
        file = TdmsFile.read(path)
        channels = [(channel, channel[:]) for group in file.groups() for channel in group.channels()]
    for name, status in (file.file_status.channel_statuses or {}).items():
        if status.read_length < status.expected_length:
            counts = f"{status.read_length:,} of {status.expected_length:,} values"
            raise ForeignFormatError(f"is truncated: {counts} in the last segment of {name}")
    columns, steps, starts = [], set(), set()
    for channel, values in channels:
        if not len(values) or not np.issubdtype(values.dtype, np.number):
            continue
        name = f"{channel.group_name}/{channel.name}"
        kind = np.int16 if values.dtype == np.int16 else np.float64  # int16: codes
        columns.append(Column(name, str(channel.properties.get("unit_string", "")), values.astype(kind, copy=False)))
        step, start = channel.properties.get("wf_increment"), channel.properties.get("wf_start_time")
        if step is not None:
            if not isinstance(step, int | float | np.number) or not step > 0:
                raise ForeignFormatError(f"{name}: wf_increment {step!r}, expected a positive number")
            steps.add(float(step))
        if isinstance(start, np.datetime64):
            starts.add(int(start.astype("datetime64[ns]").astype(np.int64)))
    if len(steps) > 1:
        raise ForeignFormatError(f"channels of different rates: wf_increment {sorted(steps)} s")
    properties = {name: str(value) for name, value in file.properties.items()}
    table = Table.from_properties(columns, properties, 1 / steps.pop() if steps else None)
    return table if table.started_ns is not None else replace(table, started_ns=min(starts, default=None))


def write_tdms(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a TDMS file: one group, a waveform channel for each column."""
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter  # noqa: PLC0415 - an extra

    waveform: dict[str, Any] = {}
    properties: dict[str, Any] = dict(table.properties)
    if table.rate is not None:
        properties["rate_hz"] = table.rate
        waveform |= {"wf_increment": 1 / table.rate, "wf_start_offset": 0.0, "wf_samples": table.n_rows}
    if table.started_ns is not None:
        waveform["wf_start_time"] = np.datetime64(table.started_ns, "ns")
    with path.open("xb") as file, TdmsWriter(file) as writer:
        channels = [
            ChannelObject(TDMS_GROUP, column.name, column.values, waveform | {"unit_string": column.unit})
            for column in table.columns
        ]
        writer.write_segment([RootObject(properties), GroupObject(TDMS_GROUP), *channels])
        on_progress(1.0)


def read_uff(path: Path) -> Table:
    """Return the table of the data sets 58 of a universal file, evenly spaced in time."""
    import pyuff  # noqa: PLC0415 - an extra

    path.open("rb").close()  # raises OSError, as `pyuff` does not
    with library_errors(path):
        file = pyuff.UFF(str(path))
        set_types = [int(set_type) for set_type in file.get_set_types()]
    columns, rates, properties = [], set(), dict[str, str]()
    for number in (number for number, set_type in enumerate(set_types) if set_type == 58):
        with library_errors(path):
            data = file.read_sets(number)
            values, times = np.real(data["data"]).astype(np.float64), data["x"]
        if len(times) < 2 or not times[1] > times[0]:
            raise ForeignFormatError(f"data set {number + 1}: times {times[:2]}, expected at least two, rising")
        name = str(data.get("id1", "")).strip() or str(number + 1)
        unit = str(data.get("ordinate_axis_units_lab", "")).strip()
        columns.append(Column(name, "" if unit == UFF_EMPTY else unit, values))
        rates.add(round(1 / float(times[1] - times[0]), 6))
        lines = (str(data.get(line, "")).partition(": ") for line in ("id4", "id5"))
        properties |= {key.strip(): value.strip() for key, separator, value in lines if separator}
    if not columns:
        raise ForeignFormatError("has no data set 58")
    if len(rates) > 1:
        raise ForeignFormatError(f"data sets of different rates: {sorted(rates)} Hz")
    return Table.from_properties(columns, properties, rates.pop())


def write_uff(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a universal file in text with twelve digits: a time response for each column, named in its first line."""
    import pyuff  # noqa: PLC0415 - an extra

    times = np.arange(table.n_rows) / table.rate if table.rate is not None else table.column("time_s").values
    columns = [column for column in table.columns if column.name != "time_s"]  # the abscissa of the others
    file = pyuff.UFF(str(path))
    for number, column in enumerate(columns, 1):
        data_set = pyuff.prepare_58(
            binary=0,
            id1=column.name,
            id2=table.properties.get("run", "")[:80] or UFF_EMPTY,
            id3=table.properties.get("rig", "")[:80] or UFF_EMPTY,
            id4=UFF_EMPTY if table.rate is None else f"rate_hz: {table.rate!r}",
            id5=UFF_EMPTY if table.started_ns is None else f"started_ns: {table.started_ns}",
            func_type=1,  # time response
            rsp_node=number,
            rsp_dir=0,
            ref_dir=0,
            ref_node=0,
            rsp_ent_name=UFF_EMPTY,
            ref_ent_name=UFF_EMPTY,
            ord_data_type=4,  # double
            num_pts=table.n_rows,
            abscissa_spacing=0 if table.rate is None else 1,  # 1: even
            abscissa_min=0.0,
            abscissa_inc=0.0 if table.rate is None else 1 / table.rate,
            z_axis_value=0.0,
            abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s",
            ordinate_spec_data_type=8,
            ordinate_axis_units_lab=(column.unit or UFF_EMPTY).replace("µ", "u"),
            orddenom_spec_data_type=0,
            z_axis_spec_data_type=0,
            data=column.values,
            x=times,
        )
        file.write_sets([data_set], mode="overwrite" if number == 1 else "add")
        on_progress(number / len(columns))


def read_wav(path: Path) -> Table:
    """Return the table of a WAV file: columns "1", "2" …; 16-bit values are codes, others are scaled to -1 to 1."""
    from scipy.io import wavfile  # noqa: PLC0415 - slow to import

    with library_errors(path), warnings.catch_warnings():
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        try:
            rate, values = wavfile.read(path)
        except wavfile.WavFileWarning as error:
            raise ForeignFormatError(f"is truncated: {error}") from error
    if values.dtype == np.uint8:  # 8-bit values are unsigned
        values = (values.astype(np.float64) - 128) / 128
    elif values.dtype == np.int32:  # so are 24-bit values: the upper bits
        values = values.astype(np.float64) / 2**31
    elif values.dtype != np.int16:
        values = values.astype(np.float64)
    rows = np.atleast_2d(values.T)
    return Table(tuple(Column(str(k), "", np.ascontiguousarray(row)) for k, row in enumerate(rows, 1)), float(rate))
