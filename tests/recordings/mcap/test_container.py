"""ChunkTable: decoding of chunk indexes, and search by time."""

import pytest
from mcap.records import ChunkIndex

from recordings.mcap.chunk_writer import encode_records
from recordings.mcap.container import RECORD, ChunkLocation, ChunkTable

LATE = 1 << 63  # does not fit a signed 64-bit integer


def content(offset: int, start_ns: int, channels: list[int]) -> bytes:
    """Return the content of a chunk index record."""
    index = ChunkIndex(
        chunk_length=100,
        chunk_start_offset=offset,
        compression="zstd",
        compressed_size=60,
        message_end_time=start_ns + 1,
        message_index_length=26,
        message_index_offsets=dict.fromkeys(channels, offset + 100),
        message_start_time=start_ns,
        uncompressed_size=90,
    )
    return encode_records(index)[RECORD.size :]


CASES = [
    (10, 5, [1]),
    (210, 7, [1, 2]),
    (410, 6, [3, 4]),
    (610, LATE + 1, [2, 1]),
    (810, 9, []),
    (1010, 10, [513, 1, 65535]),
]


def test_table_from_index_has_all_chunks() -> None:
    table = ChunkTable.from_index([content(*case) for case in CASES])
    assert len(table) == len(CASES)
    assert [*table] == [
        ChunkLocation(offset + RECORD.size, 100 - RECORD.size, start_ns, frozenset(channels))
        for offset, start_ns, channels in CASES
    ]
    assert [*table.starting_at(4)] == [table[4], table[5]]
    assert [chunk.offset for chunk in reversed(table)] == [chunk.offset for chunk in table][::-1]


def test_table_from_locations_has_all_chunks() -> None:
    locations = [
        ChunkLocation(9, 100, 5, frozenset({1})),
        ChunkLocation(200, 50, 7, None),
        ChunkLocation(300, 50, 8, frozenset({1})),
    ]
    table = ChunkTable.from_locations(locations)
    assert [*table] == locations
    assert [chunk.may_contain(frozenset({2})) for chunk in table] == [False, True, False]


def test_last_chunk_before_a_time_is_found_among_other_channels() -> None:
    samples, results = frozenset({1}), frozenset({3, 4})
    starts = [(0, [1]), (10, [1]), (3, [3]), (20, [1, 2]), (13, [3, 4]), (30, [1])]
    table = ChunkTable.from_index([content(100 * k, start, channels) for k, (start, channels) in enumerate(starts)])
    found = {0: 0, 9: 0, 10: 1, 19: 1, 20: 3, 29: 3, 30: 5, 1000: 5, -1: 0}
    assert {time_ns: table.last_before(samples, time_ns) for time_ns in found} == found
    assert [table.last_before(results, time_ns) for time_ns in (0, 3, 12, 13, 99)] == [2, 2, 2, 4, 4]
    assert table.last_before(frozenset({7}), 10) == 0


@pytest.mark.parametrize("table", [ChunkTable.from_index([]), ChunkTable.from_locations([])], ids=["index", "walk"])
def test_empty_table(table: ChunkTable) -> None:
    assert [*table] == []
    assert table.last_before(frozenset({1}), 5) == 0
