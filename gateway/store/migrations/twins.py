"""Migration 9: twins and templates.

A document is stored once, by its hash, however many robots and entries of their histories share it. Whatever changes a
twin first takes the lock of `twin_changes`: so changes have an order in which they are committed, and each gateway on
the database sees in one small query what changed since it last looked.
"""

from __future__ import annotations

__all__ = ["TWINS"]

# twin_changes.templates: the newest change of any template. twins.own, twins.document: hashes in twin_documents, the
# robot's own part and the whole that it gets. twins.templates, labels: JSON. twins.confirm_ms: the confirm window.
# twin_reports: the last TwinReport of each robot. template_history.revision is the change that it was; a removed
# template has a row, too, with what it was.
TWINS = """
    CREATE TABLE twin_changes (
        id {integer} PRIMARY KEY,
        change {integer} NOT NULL,
        templates {integer} NOT NULL
    );
    INSERT INTO twin_changes VALUES (1, 0, 0);
    CREATE TABLE twin_documents (hash TEXT PRIMARY KEY, document {blob} NOT NULL);
    CREATE TABLE twins (
        robot TEXT PRIMARY KEY,
        revision {integer} NOT NULL,
        edition {integer} NOT NULL,
        change {integer} NOT NULL,
        own TEXT NOT NULL REFERENCES twin_documents,
        document TEXT NOT NULL REFERENCES twin_documents,
        labels TEXT NOT NULL,
        templates TEXT NOT NULL,
        problem TEXT NOT NULL,
        author TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        reason TEXT NOT NULL,
        confirm_ms {integer} NOT NULL
    );
    CREATE INDEX twins_change ON twins (change);
    CREATE TABLE twin_history (
        robot TEXT NOT NULL,
        edition {integer} NOT NULL,
        revision {integer} NOT NULL,
        at_ns {integer} NOT NULL,
        author TEXT NOT NULL,
        reason TEXT NOT NULL,
        own TEXT NOT NULL REFERENCES twin_documents,
        document TEXT NOT NULL REFERENCES twin_documents,
        PRIMARY KEY (robot, edition)
    ) {rowless};
    CREATE TABLE templates (
        name TEXT PRIMARY KEY,
        priority {integer} NOT NULL,
        selector TEXT NOT NULL,
        document {blob} NOT NULL,
        revision {integer} NOT NULL,
        author TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        reason TEXT NOT NULL
    );
    CREATE TABLE template_history (
        revision {integer} PRIMARY KEY,
        name TEXT NOT NULL,
        removed {integer} NOT NULL,
        priority {integer} NOT NULL,
        selector TEXT NOT NULL,
        document {blob} NOT NULL,
        author TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        reason TEXT NOT NULL
    );
    CREATE INDEX template_history_name ON template_history (name, revision);
    CREATE TABLE twin_reports (
        robot TEXT PRIMARY KEY,
        at_ns {integer} NOT NULL,
        revision {integer} NOT NULL,
        applied {integer} NOT NULL,
        state TEXT NOT NULL,
        code TEXT NOT NULL,
        message TEXT NOT NULL,
        hash TEXT NOT NULL,
        reported {blob} NOT NULL
    );
"""
