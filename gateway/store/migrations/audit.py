"""Migration 8: the audit log, a chain of rows in which each holds the hash of the one before.

Both databases refuse to change or delete a row. Who may drop a trigger can do it all the same: that is what the chain
shows, and what the heads in the object store are compared with.
"""

from __future__ import annotations

__all__ = ["AUDIT"]

# audit_head: the newest row's number and hash. Whoever appends locks it first, so the gateways of one database write
# one chain. Numbers have no holes. The hash is SHA-256 in hexadecimal over the hash of the row before and every other
# column, see gateway/store/accounts/audit.py. status: as in HTTP; 101 is a socket that opened. code: of a refusal.
AUDIT = """
    CREATE TABLE audit_head (id {integer} PRIMARY KEY, number {integer} NOT NULL, hash TEXT NOT NULL);
    INSERT INTO audit_head VALUES (1, 0, '');
    CREATE TABLE audit (
        number {integer} PRIMARY KEY,
        at_ns {integer} NOT NULL,
        gateway TEXT NOT NULL,
        kind TEXT NOT NULL,
        actor TEXT NOT NULL,
        name TEXT NOT NULL,
        role TEXT NOT NULL,
        address TEXT NOT NULL,
        action TEXT NOT NULL,
        method TEXT NOT NULL,
        target TEXT NOT NULL,
        status {integer} NOT NULL,
        code TEXT NOT NULL,
        detail TEXT NOT NULL,
        hash TEXT NOT NULL
    );
    CREATE INDEX audit_action ON audit (action, number);
    CREATE INDEX audit_name ON audit (name, number);
    {append_only}
"""
