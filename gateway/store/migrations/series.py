"""Migration 4: metric chunks with small columns and summaries."""

from __future__ import annotations

__all__ = ["SERIES"]

# encoding: how the blobs are to be read, see gateway/store/telemetry/chunks.py; 0 is what earlier programs wrote.
# valid, low, high, total: the summary of the values that are numbers; low_ns, high_ns: when the extremes first were.
# A row of an earlier program has no summary (valid is NULL) until it leaves by age.
# The index holds every summary: a bucket in which a chunk lies as a whole needs neither the row nor its blobs, and in
# SQLite a column behind a blob costs reading through the blob. PostgreSQL must find the chunk's number there, too.
# Chunks have 500 rows, not 1000: of a day in 1000 buckets a thousand chunks lie across an edge and must be read.
SERIES = """
    ALTER TABLE metric_chunks ADD COLUMN encoding {integer} NOT NULL DEFAULT 0;
    ALTER TABLE metric_chunks ADD COLUMN valid {integer};
    ALTER TABLE metric_chunks ADD COLUMN low DOUBLE PRECISION;
    ALTER TABLE metric_chunks ADD COLUMN high DOUBLE PRECISION;
    ALTER TABLE metric_chunks ADD COLUMN total DOUBLE PRECISION;
    ALTER TABLE metric_chunks ADD COLUMN low_ns {integer};
    ALTER TABLE metric_chunks ADD COLUMN high_ns {integer};
    DROP INDEX metric_chunks_open;
    CREATE INDEX metric_chunks_open ON metric_chunks (series) WHERE count < 500;
    DROP INDEX metric_chunks_range;
    CREATE INDEX metric_chunks_range
        ON metric_chunks (series, last_ns, first_ns, count, valid, low, high, total, low_ns, high_ns, chunk);
"""
