"""Migration 5: recordings cut from a robot's black box.

A row exists from the request on, whether the robot is there or not; its file lies in the object store once `state` is
'stored', and only then `object` names it. What has come so far of a file that is on its way lies on the disk of the
gateway that has the robot's link, and nowhere in these tables.
"""

from __future__ import annotations

__all__ = ["RECORDINGS"]

# recordings.state: requested, cutting, transferring, stored, failed. from_ns and to_ns: what was asked, by the robot's
# clock; first_ns and last_ns: what its black box had of it, 0 until it said so. topics: a JSON list of patterns.
# live_ns: when something last happened to it, by which unfinished ones are given up.
RECORDINGS = """
    CREATE TABLE recordings (
        recording TEXT PRIMARY KEY,
        robot {integer} NOT NULL REFERENCES robots,
        state TEXT NOT NULL,
        from_ns {integer} NOT NULL,
        to_ns {integer} NOT NULL,
        topics TEXT NOT NULL,
        requested_ns {integer} NOT NULL,
        live_ns {integer} NOT NULL,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        received_bytes {integer} NOT NULL,
        messages {integer} NOT NULL,
        sha256 TEXT NOT NULL,
        code TEXT NOT NULL,
        message TEXT NOT NULL,
        object TEXT UNIQUE REFERENCES objects
    );
    CREATE INDEX recordings_robot ON recordings (robot, requested_ns);
    CREATE INDEX recordings_age ON recordings (state, requested_ns);
"""
