"""Migration 21: levels, what many chunks of a series hold in the cells of a time grid."""

from __future__ import annotations

__all__ = ["LEVELS"]

# first_chunk, last_chunk: the numbers of the chunks that are summed up, all that the series has between them;
# behind_chunk: the last one of the level before. first_ns, last_ns: between which stamps their rows lie. shift: a cell
# is 2^shift nanoseconds; NULL: they cannot be read, and this row only says that nobody need try again. cells: see
# gateway/store/telemetry/levels.py.
# The index finds the chunks of a series that are no part of a level yet.
LEVELS = """
    CREATE TABLE metric_levels (
        series {integer} NOT NULL REFERENCES series,
        first_chunk {integer} NOT NULL,
        last_chunk {integer} NOT NULL,
        behind_chunk {integer} NOT NULL,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        shift {integer},
        cells {blob} NOT NULL,
        PRIMARY KEY (series, first_chunk)
    );
    CREATE INDEX metric_levels_range ON metric_levels (series, last_ns, first_ns);
    CREATE INDEX metric_chunks_order ON metric_chunks (series, chunk, count, stored_ns);
"""
