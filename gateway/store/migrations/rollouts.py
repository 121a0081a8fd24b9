"""Migration 12: what robots may be updated to, and the rollouts that bring it to them.

The private keys of the two roles that the gateway signs are sealed under its master key, which lies in no database.
Signed documents are kept as they came or were made, byte for byte. A bundle's bytes are an object; its row says which.
"""

from __future__ import annotations

__all__ = ["ROLLOUTS"]

# update_metadata.role: root, targets, snapshot, timestamp, or robots/<group>. update_bundles.path: the target's path;
# withdrawn_ns: 0 while it may be fetched. duties: what only one gateway at a time does, and until when it is its turn.
# rollouts.document: the plan; rollouts.state: running, paused, halted, done, aborted. rollout_robots.state: waiting,
# starting, updating, done, failed, unreached. gateways: until when each is believed to live. presence: which gateway
# said last that the robot is linked to it (online 1), or is not any more, and since when: see
# gateway/store/fleet/presence.py.
ROLLOUTS = """
    CREATE TABLE update_keys (
        keyid TEXT PRIMARY KEY,
        role TEXT NOT NULL,
        public_key TEXT NOT NULL,
        sealed {blob} NOT NULL,
        made_ns {integer} NOT NULL
    );
    CREATE TABLE update_metadata (
        role TEXT NOT NULL,
        version {integer} NOT NULL,
        document {blob} NOT NULL,
        expires_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        PRIMARY KEY (role, version)
    );
    CREATE TABLE update_bundles (
        path TEXT PRIMARY KEY,
        kind TEXT NOT NULL,
        name TEXT NOT NULL,
        version TEXT NOT NULL,
        sha256 TEXT NOT NULL,
        size_bytes {integer} NOT NULL,
        manifest TEXT NOT NULL,
        object TEXT NOT NULL UNIQUE REFERENCES objects,
        uploaded_ns {integer} NOT NULL,
        uploaded_by TEXT NOT NULL,
        withdrawn_ns {integer} NOT NULL,
        reason TEXT NOT NULL
    );
    CREATE INDEX update_bundles_name ON update_bundles (kind, name);
    CREATE TABLE duties (
        duty TEXT PRIMARY KEY,
        holder TEXT NOT NULL,
        until_ns {integer} NOT NULL
    );
    CREATE TABLE rollouts (
        rollout TEXT PRIMARY KEY,
        state TEXT NOT NULL,
        reason TEXT NOT NULL,
        wave {integer} NOT NULL,
        document TEXT NOT NULL,
        created_by TEXT NOT NULL,
        created_ns {integer} NOT NULL,
        changed_ns {integer} NOT NULL,
        revision {integer} NOT NULL
    );
    CREATE INDEX rollouts_state ON rollouts (state);
    CREATE TABLE rollout_robots (
        rollout TEXT NOT NULL REFERENCES rollouts,
        robot TEXT NOT NULL,
        place {integer} NOT NULL,
        wave {integer} NOT NULL,
        state TEXT NOT NULL,
        since_ns {integer} NOT NULL,
        reason TEXT NOT NULL,
        PRIMARY KEY (rollout, robot)
    );
    CREATE TABLE gateways (gateway TEXT PRIMARY KEY, until_ns {integer} NOT NULL);
    CREATE TABLE presence (
        robot TEXT PRIMARY KEY,
        gateway TEXT NOT NULL,
        online {integer} NOT NULL,
        since_ns {integer} NOT NULL
    );
"""
