"""Migration 14: what was made under which Idempotency-Key."""

from __future__ import annotations

__all__ = ["ONCE"]

# issuer: "user:ID" or "key:ID"; digest: of what was asked, without secrets; made: the id of what it made.
ONCE = """
    CREATE TABLE made_once (
        issuer TEXT NOT NULL,
        idempotency TEXT NOT NULL,
        digest TEXT NOT NULL,
        made TEXT NOT NULL,
        made_ns {integer} NOT NULL,
        PRIMARY KEY (issuer, idempotency)
    );
    CREATE INDEX made_once_age ON made_once (made_ns);
"""
