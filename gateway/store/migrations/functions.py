"""Migration 19: functions with all that belongs to them, and where their code lies."""

from __future__ import annotations

__all__ = ["FUNCTIONS"]

# lambda_records: one row a function, version, alias, layer version, mapping or setting of one; owner: the function's or
# layer's name. document: what it is, as JSON, with "code" (a SHA-256) where it has code, which `code` repeats.
# lambda_code: object: its name in the object store, never used again; touched_ns: when somebody last wanted to keep it.
# lambda_changes: one row, counted up by every change, so that other gateways see that there was one.
FUNCTIONS = """
    CREATE TABLE lambda_records (
        kind TEXT NOT NULL,
        owner TEXT NOT NULL,
        id TEXT NOT NULL,
        code TEXT NOT NULL,
        document TEXT NOT NULL,
        PRIMARY KEY (kind, owner, id)
    ) {rowless};
    CREATE INDEX lambda_records_code ON lambda_records (code) WHERE code <> '';
    CREATE TABLE lambda_code (
        sha256 TEXT PRIMARY KEY,
        object TEXT NOT NULL,
        size_bytes {integer} NOT NULL,
        touched_ns {integer} NOT NULL
    );
    CREATE TABLE lambda_changes (one {integer} PRIMARY KEY, number {integer} NOT NULL);
    INSERT INTO lambda_changes VALUES (1, 0);
"""
