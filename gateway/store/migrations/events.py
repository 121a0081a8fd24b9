"""Migration 13: the journal of what happened in the fleet."""

from __future__ import annotations

__all__ = ["EVENTS"]

# event_head: the newest event's number. Whoever appends locks it first, so that the gateways of one database number
# their events in the order in which they are committed: who reads on from a number misses none. robot: "" = the
# fleet's. data: a JSON object.
EVENTS = """
    CREATE TABLE event_head (id {integer} PRIMARY KEY, number {integer} NOT NULL);
    INSERT INTO event_head VALUES (1, 0);
    CREATE TABLE events (
        event {integer} PRIMARY KEY,
        kind TEXT NOT NULL,
        robot TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        gateway TEXT NOT NULL,
        data TEXT NOT NULL
    );
    CREATE INDEX events_robot ON events (robot, event);
"""
