"""Migration 16: what is on its way to targets, what set it off, and what is delivered once more."""

from __future__ import annotations

__all__ = ["DELIVERIES"]

# deliveries.holder: the life of a gateway (its id, "/", a name of that life) that works on it until until_ns; "" while
# nobody does. size_bytes: what counts towards the queue's bounds. context, policy: JSON. The indexes hold what waits
# only: what it costs to find the next of a target does not grow with what is done.
# queue_totals: rows and bytes by gateway, so that gateways of one database never wait for each other's count; their
# sum is what there is. replays: at_ns, place and number are the event behind which it goes on.
DELIVERIES = """
    CREATE TABLE deliveries (
        delivery TEXT PRIMARY KEY,
        kind TEXT NOT NULL,
        target TEXT NOT NULL,
        state TEXT NOT NULL,
        due_ns {integer} NOT NULL,
        expires_ns {integer} NOT NULL,
        born_ns {integer} NOT NULL,
        ended_ns {integer} NOT NULL,
        until_ns {integer} NOT NULL,
        holder TEXT NOT NULL,
        attempts {integer} NOT NULL,
        tries {integer} NOT NULL,
        losses {integer} NOT NULL,
        redrives {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        happening TEXT NOT NULL,
        robot TEXT NOT NULL,
        dedup TEXT NOT NULL,
        code TEXT NOT NULL,
        message TEXT NOT NULL,
        policy TEXT NOT NULL,
        context TEXT NOT NULL,
        payload {blob} NOT NULL
    );
    CREATE INDEX deliveries_due ON deliveries (kind, target, due_ns) WHERE state = 'waiting';
    CREATE INDEX deliveries_expiry ON deliveries (expires_ns) WHERE state = 'waiting';
    CREATE INDEX deliveries_lease ON deliveries (until_ns) WHERE state = 'leased';
    CREATE INDEX deliveries_done ON deliveries (ended_ns) WHERE state = 'done';
    CREATE INDEX deliveries_dead ON deliveries (ended_ns, delivery) WHERE state = 'dead';
    CREATE UNIQUE INDEX deliveries_dedup ON deliveries (kind, target, dedup) WHERE dedup <> '';
    CREATE TABLE queue_totals (
        gateway TEXT NOT NULL,
        what TEXT NOT NULL,
        count {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        PRIMARY KEY (gateway, what)
    );
    CREATE TABLE happenings (
        happening {number},
        source TEXT NOT NULL,
        id TEXT NOT NULL,
        type TEXT NOT NULL,
        robot TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        size_bytes {integer} NOT NULL,
        data TEXT NOT NULL,
        UNIQUE (source, id)
    );
    CREATE INDEX happenings_at ON happenings (at_ns, happening);
    CREATE INDEX happenings_age ON happenings (stored_ns);
    CREATE INDEX events_at ON events (at_ns, event);
    CREATE TABLE replays (
        replay TEXT PRIMARY KEY,
        span TEXT NOT NULL,
        spec TEXT NOT NULL,
        made_ns {integer} NOT NULL,
        read {integer} NOT NULL,
        put {integer} NOT NULL,
        ended_ns {integer} NOT NULL,
        code TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        place {integer} NOT NULL,
        number {integer} NOT NULL
    );
"""
