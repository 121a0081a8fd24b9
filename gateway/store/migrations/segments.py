"""Migration 3: the object store's ledger, and segments with the runs of samples inside them.

Messages live twice in their life, never twice at once: a received batch is inserted as it came into `sample_batches`;
compaction writes many of them into one MCAP object and, in one transaction, deletes those batches and inserts the
object's `segments` row with its `segment_runs`.
"""

from __future__ import annotations

__all__ = ["SEGMENTS"]

# objects.state: 'uploading' before the first byte leaves, 'stored' with the transaction that refers to it, 'doomed'
# with the transaction that no longer does; the row goes after its object. objects.since_ns: when it got that state
# (of an upload: when it was last known to go on).
# segment_runs.place: where in the uncompressed chunk the run's first message record begins; size_bytes: of payloads.
# channels.longest_ns: no run of the channel in a segment lasts longer, so those across an instant are found near it.
SEGMENTS = """
    ALTER TABLE channels ADD COLUMN longest_ns {integer} NOT NULL DEFAULT 0;
    CREATE TABLE objects (
        name TEXT PRIMARY KEY,
        kind TEXT NOT NULL,
        state TEXT NOT NULL,
        size_bytes {integer} NOT NULL,
        sha256 TEXT NOT NULL,
        since_ns {integer} NOT NULL
    );
    CREATE INDEX objects_state ON objects (state, since_ns);
    CREATE TABLE segments (
        segment {number},
        object TEXT NOT NULL UNIQUE REFERENCES objects,
        robot {integer} NOT NULL REFERENCES robots,
        event {integer} NOT NULL,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        messages {integer} NOT NULL
    );
    CREATE INDEX segments_age ON segments (event, stored_ns);
    CREATE TABLE segment_runs (
        segment {integer} NOT NULL REFERENCES segments,
        channel {integer} NOT NULL REFERENCES channels,
        robot {integer} NOT NULL REFERENCES robots,
        stream_id {integer} NOT NULL,
        epoch {integer} NOT NULL,
        first_seq {integer} NOT NULL,
        count {integer} NOT NULL,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        receive_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        chunk_start {integer} NOT NULL,
        chunk_bytes {integer} NOT NULL,
        place {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        UNIQUE (robot, stream_id, epoch, first_seq)
    );
    CREATE INDEX segment_runs_end ON segment_runs (channel, last_ns, first_ns, count, size_bytes);
    CREATE INDEX segment_runs_begin ON segment_runs (channel, first_ns);
    CREATE INDEX segment_runs_segment ON segment_runs (segment);
    CREATE INDEX sample_batches_due ON sample_batches (robot, event, stored_ns);
    CREATE INDEX gaps_range ON gaps (robot, to_ns);
"""
