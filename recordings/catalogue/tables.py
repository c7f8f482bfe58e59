"""Tables of the catalogue, the same on SQLite and PostgreSQL."""

from sqlalchemy import BigInteger, Boolean, Column, Float, ForeignKeyConstraint, Integer, MetaData, String, Table, Text

VERSION = 2
"""Version of the tables; a catalogue of another version is deleted and built again from the files."""

ID_LENGTH = 128
FOLDER_LENGTH = 512

METADATA = MetaData()

SCHEMA = Table("rig_schema", METADATA, Column("version", Integer, primary_key=True))

REVISION = Table(  # incremented with every change of a folder's rows: cached entries hold as long as it stays
    "rig_revision",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("number", BigInteger, nullable=False),
)

SETUP = Table(
    "rig_setup",
    METADATA,
    Column("id", String(64), primary_key=True),  # SHA-256 of the JSON document
    Column("document", Text, nullable=False),  # header as JSON, without the keys of a single run
)

RUN = Table(
    "rig_run",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("id", String(ID_LENGTH), primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("changed_ns", BigInteger, nullable=False),
    Column("started_ns", BigInteger, nullable=False),
    Column("setup", String(64)),  # null if the file cannot be read
    Column("run", Text, nullable=False, default=""),  # the id in the header: a renamed copy has another file name
    Column("rig", Text, nullable=False, default=""),
    Column("note", Text, nullable=False, default=""),  # the operator's note, stored in the recording
    Column("serial", Text, nullable=False, default=""),
    Column("calibration", String(64), nullable=False, default=""),  # `calibration_identity`
    Column("duration_s", Float, nullable=False),
    Column("samples", BigInteger, nullable=False),
    Column("is_complete", Boolean, nullable=False),
    Column("is_gap_free", Boolean, nullable=False),
    Column("fault", Text, nullable=False),
    Column("remark", Text, nullable=False, default=""),  # added after recording
    Column("remarked_ns", BigInteger, nullable=False, default=0),  # modification time of the annotations file
    Column("verdict", String(16), nullable=False, default=""),  # empty if not verified
    Column("is_summarised", Boolean, nullable=False, default=False),
    Column("lowest_speed_rpm", Float),
    Column("highest_speed_rpm", Float),
    Column("largest_peak_to_peak_um", Float),
    Column("severity", String(16)),
)


def _run_table(table: str, *columns: Column[object]) -> Table:
    """Return a table whose rows belong to a run and are deleted with it."""
    return Table(
        table,
        METADATA,
        Column("folder", String(FOLDER_LENGTH), primary_key=True),
        Column("id", String(ID_LENGTH), primary_key=True),
        *columns,
        ForeignKeyConstraint(["folder", "id"], [RUN.c.folder, RUN.c.id], ondelete="CASCADE"),
    )


TAG = _run_table("rig_tag", Column[object]("tag", String(64), primary_key=True))

FINDING = _run_table(  # sub-synchronous components
    "rig_finding",
    Column[object]("number", Integer, primary_key=True),
    Column[object]("order", Float, nullable=False),
    Column[object]("is_forward", Boolean, nullable=False),
    Column[object]("onset_rpm", Float, nullable=False),
    Column[object]("end_rpm", Float, nullable=False),
    Column[object]("largest_peak_um", Float, nullable=False),
)

MARKER = _run_table(
    "rig_mark",
    Column[object]("number", Integer, primary_key=True),
    Column[object]("segment", Integer, nullable=False),
    Column[object]("sample", BigInteger, nullable=False),
    Column[object]("text", Text, nullable=False),
)

CACHED = Table(  # results computed from a run, valid for the file of this size and modification time
    "rig_document",
    METADATA,
    Column("folder", String(FOLDER_LENGTH), primary_key=True),
    Column("id", String(ID_LENGTH), primary_key=True),
    Column("name", String(64), primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("changed_ns", BigInteger, nullable=False),
    Column("document", Text, nullable=False),
)
