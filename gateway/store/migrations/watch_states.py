"""Migration 20: what detectors learned of each robot, and which gateway has them."""

from __future__ import annotations

__all__ = ["WATCH_STATES"]

# owner: the gateway that judges the robot, "" nobody; its right ends with its row in `gateways`. fence: grows whenever
# the owner changes, so that what a former one still writes does not count. marks, JSON: up to which number the robot's
# metric streams were judged when `state` was saved; newest_ns: likewise, by the robot's clock. version: of `state`; 0:
# there is none yet.
WATCH_STATES = """
    CREATE TABLE watch_states (
        robot TEXT PRIMARY KEY,
        owner TEXT NOT NULL,
        fence {integer} NOT NULL,
        version {integer} NOT NULL,
        saved_ns {integer} NOT NULL,
        newest_ns {integer} NOT NULL,
        marks TEXT NOT NULL,
        state {blob} NOT NULL
    );
    CREATE INDEX watch_states_owner ON watch_states (owner);
"""
