"""Migration 18: calls of functions, how far event source mappings have read, and canaries."""

from __future__ import annotations

__all__ = ["INVOCATIONS"]

# invocations.log: the call's last lines. mapping_cursors.seq: the newest number of that stream and epoch that is done
# with; tries and failed_ns are of the batch that follows it. function_canaries.document: the rest of it, as JSON.
INVOCATIONS = """
    CREATE TABLE invocations (
        invocation TEXT PRIMARY KEY,
        request TEXT NOT NULL,
        function TEXT NOT NULL,
        version TEXT NOT NULL,
        qualifier TEXT NOT NULL,
        kind TEXT NOT NULL,
        robot TEXT NOT NULL,
        status TEXT NOT NULL,
        error_type TEXT NOT NULL,
        error_message TEXT NOT NULL,
        began_ns {integer} NOT NULL,
        duration_ms DOUBLE PRECISION NOT NULL,
        init_ms DOUBLE PRECISION NOT NULL,
        max_memory_mb {integer} NOT NULL,
        log TEXT NOT NULL
    ) {rowless};
    CREATE INDEX invocations_function ON invocations (function, invocation);
    CREATE TABLE mapping_starts (mapping TEXT PRIMARY KEY, started_ns {integer} NOT NULL) {rowless};
    CREATE TABLE mapping_cursors (
        mapping TEXT NOT NULL,
        robot TEXT NOT NULL,
        stream_id {integer} NOT NULL,
        epoch {integer} NOT NULL,
        seq {integer} NOT NULL,
        tries {integer} NOT NULL,
        most_seq {integer} NOT NULL,
        updated_ns {integer} NOT NULL,
        PRIMARY KEY (mapping, robot, stream_id, epoch)
    ) {rowless};
    CREATE TABLE function_canaries (
        function TEXT NOT NULL,
        alias TEXT NOT NULL,
        document TEXT NOT NULL,
        revision {integer} NOT NULL,
        PRIMARY KEY (function, alias)
    ) {rowless};
"""
