"""Migration 11: commands to robots, the durable ones until they have reached their end, all of them as history."""

from __future__ import annotations

__all__ = ["COMMANDS"]

# command: a ULID, whose 16 bytes are the id on the link. request: JSON as it was asked; wire: the frame's Command, ""
# once it is over. issuer: "user:ID" or "key:ID", whose idempotency keys are unique; digest: of what was asked, by
# which the same request is known again. state: issued, delivered, running, done, failed, expired, cancelled.
# expires_ns: 0 = not durable. Times of changes are 0 until they happened. result: JSON, "" = none.
COMMANDS = """
    CREATE TABLE commands (
        command TEXT PRIMARY KEY,
        robot {integer} NOT NULL REFERENCES robots,
        kind TEXT NOT NULL,
        request TEXT NOT NULL,
        wire {blob} NOT NULL,
        issuer TEXT NOT NULL,
        issued_by TEXT NOT NULL,
        idempotency TEXT,
        digest TEXT NOT NULL,
        durable {integer} NOT NULL,
        state TEXT NOT NULL,
        timeout_ms {integer} NOT NULL,
        expires_ns {integer} NOT NULL,
        issued_ns {integer} NOT NULL,
        delivered_ns {integer} NOT NULL,
        running_ns {integer} NOT NULL,
        ended_ns {integer} NOT NULL,
        code TEXT NOT NULL,
        message TEXT NOT NULL,
        result TEXT NOT NULL,
        UNIQUE (issuer, idempotency)
    );
    CREATE INDEX commands_robot ON commands (robot, command);
    CREATE INDEX commands_open ON commands (robot, command) WHERE ended_ns = 0;
    CREATE INDEX commands_ended ON commands (ended_ns);
"""
