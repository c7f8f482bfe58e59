"""File formats: a round trip keeps values, units, rate and start; invalid files raise ForeignFormatError."""

import csv
import random
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat, wavfile

from recordings.errors import ForeignFormatError
from recordings.exchange.formats import IMPORT_FORMATS, read_table, write_table
from recordings.exchange.table import Column, Table

RATE = 20_000.0 / 3
STARTED_NS = 1_795_511_527_123_456_789
PRECISION = {".csv": 0.0, ".tdms": 0.0, ".mat": 0.0, ".uff": 1e-11}


@pytest.fixture
def table() -> Table:
    random = np.random.default_rng(1)
    times = Column("time_s", "s", np.arange(500) / RATE)
    x = Column("x_um", "µm", -500 + 30 * random.standard_normal(500))
    tacho = Column("tacho_v", "V", random.random(500) * 5)
    return Table((times, x, tacho), RATE, STARTED_NS, {"run": "2026-a", "rig": "gj90c", "note": "cold oil, µ"})


@pytest.mark.parametrize("suffix", PRECISION)
def test_round_trip_keeps_values_units_rate_and_start(tmp_path: Path, table: Table, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    write_table(path, table)
    back = read_table(path)
    group = "run/" if suffix == ".tdms" else ""
    for column in table.columns[1:]:
        read = back.column(group + column.name)
        assert read.unit == (column.unit.replace("µ", "u") if suffix == ".uff" else column.unit)
        np.testing.assert_allclose(
            read.values.astype(np.float64), column.values.astype(np.float64), rtol=PRECISION[suffix], atol=0
        )
    assert back.rate == RATE
    assert back.started_ns is not None
    assert abs(back.started_ns - STARTED_NS) < 1000  # TDMS counts in 2^-64 s
    if suffix != ".uff":
        assert {name: back.properties[name] for name in ("run", "rig", "note")} == dict(table.properties)


def test_parquet_and_hdf5_are_readable_with_their_libraries(tmp_path: Path, table: Table) -> None:
    write_table(tmp_path / "run.parquet", table)
    write_table(tmp_path / "run.h5", table)
    read = pq.read_table(tmp_path / "run.parquet")
    assert read.schema.metadata[b"rate_hz"] == repr(RATE).encode()
    assert read.schema.metadata[b"note"].decode() == "cold oil, µ"
    assert read.schema.field("x_um").metadata[b"unit"].decode() == "µm"
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["rate_hz"] == RATE
        assert file.attrs["started_ns"] == STARTED_NS
        assert file["x_um"].attrs["unit"] == "µm"
        for column in table.columns:
            np.testing.assert_array_equal(file[column.name][:], column.values)
            np.testing.assert_array_equal(read.column(column.name).to_numpy(), column.values)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".h5", ".tdms", ".mat", ".uff"])
def test_progress_of_writing_increases_to_one(tmp_path: Path, table: Table, suffix: str) -> None:
    fractions: list[float] = []
    write_table(tmp_path / f"run{suffix}", table, fractions.append)
    assert fractions
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_long_tables_with_text_columns_are_written_in_pieces(tmp_path: Path) -> None:
    size = 120_000
    numbers = Column("order", "", np.arange(size) / 7)
    texts = Column("direction", "", np.where(np.arange(size) % 2, "run-up", "run, down"))
    fractions: list[float] = []
    write_table(tmp_path / "long.csv", Table((numbers, texts)), fractions.append)
    assert len(fractions) == 3
    with (tmp_path / "long.csv").open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    np.testing.assert_array_equal([float(row[0]) for row in rows], numbers.values)
    assert [row[1] for row in rows] == texts.values.tolist()
    write_table(tmp_path / "long.parquet", Table((numbers, texts)))
    read = pq.read_table(tmp_path / "long.parquet")
    assert read.column("direction").to_pylist() == texts.values.tolist()
    np.testing.assert_array_equal(read.column("order").to_numpy(), numbers.values)


def test_existing_files_are_not_overwritten(tmp_path: Path, table: Table) -> None:
    (tmp_path / "run.csv").write_text("precious")
    with pytest.raises(ForeignFormatError, match=r"run\.csv: exists already"):
        write_table(tmp_path / "run.csv", table)
    with pytest.raises(ForeignFormatError, match=r"run\.csv: cannot be written"):
        write_table(tmp_path / "nowhere" / "run.csv", table)


def test_an_unknown_suffix_is_reported_with_the_known_ones(tmp_path: Path, table: Table) -> None:
    with pytest.raises(ForeignFormatError, match=r"suffix '\.xls', expected one of \.csv, \.parquet"):
        write_table(tmp_path / "run.xls", table)
    with pytest.raises(ForeignFormatError, match=r"suffix '\.h5', expected one of \.tdms, \.lvm"):
        read_table(tmp_path / "run.h5")


@pytest.mark.parametrize("suffix", [".tdms", ".lvm", ".csv", ".mat", ".uff", ".wav"])
@pytest.mark.parametrize("content", [b"", b"nonsense\nand\x00more nonsense\n" * 20])
def test_missing_and_invalid_files_are_reported_with_their_name(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    with pytest.raises(ForeignFormatError, match=f"run{suffix}: "):
        read_table(path)
    path.write_bytes(content)
    with pytest.raises(ForeignFormatError, match=f"run{suffix}: "):
        read_table(path)


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
Multi_Headings\tYes
X_Columns\t{columns}
Time_Pref\tRelative
Operator\tWiemer
Date\t2012/05/01
Time\t10:30:00{decimal}25
***End_of_Header***\t

Channels\t2\t\t
Samples\t3\t3\t
Date\t2012/05/01\t2012/05/01\t
Time\t10:30:00{decimal}25\t10:30:00{decimal}25\t
Y_Unit_Label\tVolts\tVolts\t
X_Dimension\tTime\tTime\t
X0\t0{decimal}0000000000000000E+0\t0{decimal}0000000000000000E+0\t
Delta_X\t1{decimal}000000E-4\t1{decimal}000000E-4\t
***End_of_Header***\t\t\t
{titles}
"""


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("columns", ["No", "One", "Multi"])
def test_lvm_files_with_any_x_columns_and_decimal_sign_are_read(tmp_path: Path, decimal: str, columns: str) -> None:
    x = {"No": ("", ""), "One": ("0.0001", ""), "Multi": ("0.0001", "0.0001\t")}[columns]
    titles = (
        "X_Value\tVoltage_0\tX_Value\tVoltage_1\tComment" if columns == "Multi" else "X_Value\tVoltage_0\tVoltage_1"
    )
    rows = [(1.5, -2.25), (0.001, 3.0), (-4.0, 5e-3)]
    text = LVM.format(decimal=decimal, columns=columns, titles=titles)
    body = "".join(f"{x[0]}\t{a!r}\t{x[1]}{b!r}\n" for a, b in rows).replace(".", decimal)
    path = tmp_path / "run.lvm"
    path.write_text(text + body + "\n" + text.split("***\t\n", 1)[1].lstrip("\n") + body, encoding="latin-1")
    table = read_table(path)
    assert [(column.name, column.unit) for column in table.columns] == [("Voltage_0", "Volts"), ("Voltage_1", "Volts")]
    np.testing.assert_array_equal(table.column("Voltage_0").values, [1.5, 0.001, -4.0] * 2)
    np.testing.assert_array_equal(table.column("Voltage_1").values, [-2.25, 3.0, 5e-3] * 2)
    assert table.rate == 10_000.0
    assert table.properties["Operator"] == "Wiemer"
    assert table.started_ns is not None
    assert table.started_ns % 1_000_000_000 == 250_000_000


def test_an_lvm_header_without_end_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "run.lvm").write_text(LVM.split("***", maxsplit=1)[0])
    with pytest.raises(ForeignFormatError, match="a header does not end with"):
        read_table(tmp_path / "run.lvm")


WAV_VALUES: dict[str, tuple[list[float], list[float]]] = {
    "int16": ([-32768, 0, 32767], [-32768, 0, 32767]),
    "uint8": ([0, 128, 255], [-1.0, 0.0, 127 / 128]),
    "int32": ([-(2**31), 0, 2**31 - 1], [-1.0, 0.0, 1 - 2**-31]),
    "float32": ([-0.5, 0.0, 0.25], [-0.5, 0.0, 0.25]),
}


@pytest.mark.parametrize("dtype", WAV_VALUES)
def test_wav_files_of_every_sample_width_are_read(tmp_path: Path, dtype: str) -> None:
    values, expected = WAV_VALUES[dtype]
    wavfile.write(tmp_path / "run.wav", 8000, np.array([values, values], dtype=dtype).T)
    table = read_table(tmp_path / "run.wav")
    assert table.rate == 8000.0
    assert [column.name for column in table.columns] == ["1", "2"]
    np.testing.assert_array_equal(table.column("2").values, expected)
    assert (table.column("1").values.dtype == np.int16) == (dtype == "int16")


def test_each_column_of_a_matlab_matrix_is_a_column(tmp_path: Path) -> None:
    values = np.arange(12.0).reshape(6, 2)
    savemat(tmp_path / "run.mat", {"signals": values, "short": np.arange(3.0), "fs": 50.0, "word": "text"})
    table = read_table(tmp_path / "run.mat")
    assert [column.name for column in table.columns] == ["signals:1", "signals:2"]
    np.testing.assert_array_equal(table.column("signals:2").values, values[:, 1])
    assert table.rate == 50.0
    with pytest.raises(ForeignFormatError, match="no column 'z'; there are 'signals:1', 'signals:2'"):
        table.column("z")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3\n", "a row of 1 values, expected 2"),
        ("a,b\n1,x\n", "'x', expected a number"),
        ("a,b\n", "has no rows"),
        ("time_s,b\n0,1\n1,2\n5,3\n", "not evenly spaced"),
        ("time_s,b\n2,1\n1,2\n", "expected at least two, rising"),
    ],
)
def test_an_invalid_csv_file_is_an_error(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(ForeignFormatError, match=message):
        read_table(tmp_path / "run.csv")


def test_csv_with_semicolons_and_decimal_commas_is_read(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s;Weg x [µm]\n0,000;1,5\n0,001;-2,5\n", encoding="utf-8-sig")
    table = read_table(tmp_path / "run.csv")
    assert table.rate == 1000.0
    assert table.columns[1].unit == "µm"
    np.testing.assert_array_equal(table.column("Weg x").values, [1.5, -2.5])


def test_columns_of_different_lengths_are_an_error() -> None:
    with pytest.raises(ForeignFormatError, match="columns of different lengths"):
        Table((Column("a", "", np.zeros(2)), Column("b", "", np.zeros(3))))


def cut(path: Path, size: int) -> Path:
    """Truncate a file to this size."""
    path.write_bytes(path.read_bytes()[:size])
    return path


@pytest.mark.parametrize("lost", [1, 2, 9])
def test_a_csv_file_without_its_last_line_end_is_an_error(tmp_path: Path, table: Table, lost: int) -> None:
    path = tmp_path / "run.csv"
    write_table(path, table)
    lines = len(path.read_text(encoding="utf-8").splitlines())
    with pytest.raises(ForeignFormatError, match=rf"run\.csv: line {lines}, the last one, has no line end"):
        read_table(cut(path, path.stat().st_size - lost))
    path.write_bytes(path.read_bytes() + b"\n")
    assert read_table(path).n_rows == table.n_rows


def test_an_invalid_csv_row_is_reported_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("# note: cold\n\nx [V],y [V]\n1,2\n3\n", encoding="utf-8")
    with pytest.raises(ForeignFormatError, match="line 5: a row of 1 values, expected 2"):
        read_table(path)
    path.write_text("x [V],y [V]\n1,2\n3,-\n", encoding="utf-8")
    with pytest.raises(ForeignFormatError, match="line 3: '-', expected a number"):
        read_table(path)


def test_a_cut_lvm_file_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "run.lvm"
    whole = (
        LVM.format(decimal=".", columns="No", titles="X_Value\tV_0\tV_1") + "\t1.5\t-2.25\n\t0.5\t3.25\n\t4.5\t5.75\n"
    )
    path.write_text(whole, encoding="utf-8")
    assert read_table(path).n_rows == 3
    with pytest.raises(ForeignFormatError, match=rf"line {len(whole.splitlines())}, the last one"):
        read_table(cut(path, path.stat().st_size - 2))
    path.write_text(whole.removesuffix("\t4.5\t5.75\n"), encoding="utf-8")
    with pytest.raises(ForeignFormatError, match="truncated: a section of 2 rows, expected 3"):
        read_table(path)


def test_cut_wav_and_tdms_files_are_an_error(tmp_path: Path, table: Table) -> None:
    write_table(tmp_path / "run.tdms", table)
    with pytest.raises(ForeignFormatError, match="is truncated: 499 of 500 values in the last segment"):
        read_table(cut(tmp_path / "run.tdms", (tmp_path / "run.tdms").stat().st_size - 8))
    wavfile.write(tmp_path / "run.wav", 1000, np.zeros((100, 2), np.int16))
    with pytest.raises(ForeignFormatError, match="is truncated"):
        read_table(cut(tmp_path / "run.wav", (tmp_path / "run.wav").stat().st_size - 4))


def damaged(content: bytes, number: int) -> bytes:
    """Return a content truncated, or with bytes changed."""
    choices = random.Random(number)  # noqa: S311 - damage of a file
    if number % 2:
        return content[: choices.randrange(len(content))]
    changed = bytearray(content)
    for _ in range(choices.choice((1, 3, 20))):
        changed[choices.randrange(len(changed) if number % 4 else min(600, len(changed)))] = choices.randrange(256)
    return bytes(changed)


@pytest.mark.parametrize("suffix", [".csv", ".lvm", ".tdms", ".mat", ".uff", ".wav"])
def test_damaged_files_are_read_or_reported_whatever_the_library_raises(
    tmp_path: Path, table: Table, suffix: str
) -> None:
    short = Table(tuple(Column(c.name, c.unit, c.values[:20]) for c in table.columns), RATE, STARTED_NS)
    path = tmp_path / f"run{suffix}"
    if suffix == ".wav":
        wavfile.write(path, 1000, np.zeros((20, 2), np.int16))
    elif suffix == ".lvm":
        path.write_text(LVM.format(decimal=".", columns="No", titles="X_Value\tV_0\tV_1") + "\t1.5\t-2.25\n" * 3)
    else:
        write_table(path, short)  # MATLAB: compressed, as scipy may end the process at changed bytes of another one
    content = path.read_bytes()
    reported = 0
    for number in range(150):
        path.write_bytes(damaged(content, number))
        with suppress(ForeignFormatError):
            read_table(path)
            reported -= 1
        reported += 1
    assert reported > 0


def test_defect_of_a_reader_is_not_reported_as_a_fault_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def defective(path: Path) -> Table:
        raise KeyError(path.name)

    monkeypatch.setitem(IMPORT_FORMATS, ".wav", defective)
    with pytest.raises(KeyError, match="run"):
        read_table(tmp_path / "run.wav")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.csv", "# rate_hz: fast\na,b\n1,2\n", "property rate_hz: 'fast', expected a number"),
        ("run.csv", "a,b\n1," + "2" * 200_000 + "\n", "line 2: field larger than field limit"),
        ("run.lvm", LVM.replace("Channels\t2", "Channels\t9999999999"), "Channels '9999999999', expected 0 to 10000"),
    ],
)
def test_unusable_property_of_a_text_file_is_reported(tmp_path: Path, name: str, content: str, message: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(ForeignFormatError, match=message):
        read_table(tmp_path / name)
