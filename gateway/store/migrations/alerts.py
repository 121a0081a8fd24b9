"""Migration 15: alerts, what people said of them, silences, what notices told whom, and changed checks."""

from __future__ import annotations

__all__ = ["ALERTS"]

# alerts.robot: "" = the fleet's. alerts.live: 1 while it is not resolved, or a finding of it is not over.
# alerts.document: the rest of it, as JSON. alert_notices: what a route was told of an alert last; silences.robots,
# silences.causes: JSON lists. alert_checks.document: the settings that somebody changed.
ALERTS = """
    CREATE TABLE alerts (
        alert TEXT PRIMARY KEY,
        robot TEXT NOT NULL,
        cause TEXT NOT NULL,
        state TEXT NOT NULL,
        severity TEXT NOT NULL,
        title TEXT NOT NULL,
        reason TEXT NOT NULL,
        quiet {integer} NOT NULL,
        live {integer} NOT NULL,
        opened_ns {integer} NOT NULL,
        changed_ns {integer} NOT NULL,
        resolved_ns {integer} NOT NULL,
        document TEXT NOT NULL,
        revision {integer} NOT NULL
    );
    CREATE UNIQUE INDEX alerts_unresolved ON alerts (robot, cause) WHERE state <> 'resolved';
    CREATE INDEX alerts_live ON alerts (alert) WHERE live = 1;
    CREATE INDEX alerts_resolved ON alerts (resolved_ns);
    CREATE INDEX alerts_robot ON alerts (robot, alert);
    CREATE TABLE alert_remarks (
        alert TEXT NOT NULL REFERENCES alerts,
        number {integer} NOT NULL,
        at_ns {integer} NOT NULL,
        author TEXT NOT NULL,
        kind TEXT NOT NULL,
        text TEXT NOT NULL,
        PRIMARY KEY (alert, number)
    );
    CREATE TABLE silences (
        silence TEXT PRIMARY KEY,
        robots TEXT NOT NULL,
        causes TEXT NOT NULL,
        up_to TEXT NOT NULL,
        from_ns {integer} NOT NULL,
        until_ns {integer} NOT NULL,
        author TEXT NOT NULL,
        reason TEXT NOT NULL
    );
    CREATE INDEX silences_end ON silences (until_ns);
    CREATE TABLE alert_notices (
        alert TEXT NOT NULL REFERENCES alerts,
        route TEXT NOT NULL,
        stage TEXT NOT NULL,
        severity TEXT NOT NULL,
        times {integer} NOT NULL,
        told_ns {integer} NOT NULL,
        PRIMARY KEY (alert, route)
    );
    CREATE TABLE alert_checks (
        id TEXT PRIMARY KEY,
        document TEXT NOT NULL,
        changed_by TEXT NOT NULL,
        changed_ns {integer} NOT NULL
    );
"""
