"""Universal file format, data set 58: one time response per column, its name in the first identification line."""

from pathlib import Path

import numpy as np
import pyuff

from recordings.errors import ForeignFormatError
from recordings.exchange.table import Column, Table
from recordings.progress import Progress

TIME_RESPONSE = 1
DOUBLE = 4
EVEN, UNEVEN = 1, 0
EMPTY = "NONE"


def read(path: Path) -> Table:
    """Return the table of the data sets 58 of a file, evenly spaced in time."""
    if not path.is_file():
        raise FileNotFoundError(2, "there is no such file")
    file = pyuff.UFF(str(path))
    columns, rates, properties = [], set(), dict[str, str]()
    for number, set_type in enumerate(file.get_set_types()):
        if int(set_type) != 58:
            continue
        data = file.read_sets(number)
        name = str(data.get("id1", "")).strip() or str(number + 1)
        unit = str(data.get("ordinate_axis_units_lab", "")).strip()
        values = np.real(data["data"]).astype(np.float64)
        columns.append(Column(name, "" if unit == EMPTY else unit, values))
        times = np.asarray(data["x"], dtype=np.float64)
        rates.add(round(1 / (times[1] - times[0]), 6))
        for line in ("id4", "id5"):
            key, separator, value = str(data.get(line, "")).partition(": ")
            if separator:
                properties[key.strip()] = value.strip()
    if not columns:
        raise ForeignFormatError("has no data set 58")
    if len(rates) > 1:
        raise ForeignFormatError(f"data sets of different rates: {sorted(rates)} Hz")
    rate = float(properties["rate_hz"]) if "rate_hz" in properties else rates.pop()
    started_ns = int(properties["started_ns"]) if "started_ns" in properties else None
    return Table(tuple(columns), rate, started_ns, properties)


def write(path: Path, table: Table, on_progress: Progress) -> None:
    """Write a table to a new file, in text with twelve digits."""
    times = None if table.rate is not None else table.column("time_s").values
    sets: list[dict[str, object]] = []
    for column in table.columns:
        if column.name == "time_s":  # the abscissa of the other columns
            continue
        sets.append(
            pyuff.prepare_58(
                binary=0,
                id1=column.name,
                id2=table.properties.get("run", "")[:80] or EMPTY,
                id3=table.properties.get("rig", "")[:80] or EMPTY,
                id4=EMPTY if table.rate is None else f"rate_hz: {table.rate!r}",
                id5=EMPTY if table.started_ns is None else f"started_ns: {table.started_ns}",
                func_type=TIME_RESPONSE,
                rsp_node=len(sets) + 1,
                rsp_dir=0,
                ref_dir=0,
                ref_node=0,
                rsp_ent_name=EMPTY,
                ref_ent_name=EMPTY,
                ord_data_type=DOUBLE,
                num_pts=table.n_rows,
                abscissa_spacing=EVEN if times is None else UNEVEN,
                abscissa_min=0.0,
                abscissa_inc=0.0 if table.rate is None else 1 / table.rate,
                z_axis_value=0.0,
                abscissa_spec_data_type=17,
                abscissa_axis_units_lab="s",
                ordinate_spec_data_type=8,
                ordinate_axis_units_lab=(column.unit or EMPTY).replace("µ", "u"),
                orddenom_spec_data_type=0,
                z_axis_spec_data_type=0,
                data=column.values,
                x=np.arange(table.n_rows) / table.rate if table.rate is not None else times,
            )
        )
    file = pyuff.UFF(str(path))
    for number, data_set in enumerate(sets):
        file.write_sets([data_set], mode="add" if number else "overwrite")
        on_progress((number + 1) / len(sets))
