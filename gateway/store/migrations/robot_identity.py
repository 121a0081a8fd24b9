"""Migration 7: robots' identities: enrolment tokens, certificates, and the state of the gateway's own CA.

A robot has one identity, from its enrolment on, and any number of certificates one after another. Every change of an
identity gets the next revision, in the order in which the changes are committed: so each gateway on the database sees
in one small query what changed since it last looked.
"""

from __future__ import annotations

__all__ = ["ROBOT_IDENTITY"]

# authorities.sealed_key: sealed by the data directory's master key; empty where the key was supplied as a file.
# enrolment_tokens.robot: the only robot it is for, '' for any that has no identity. used_key, certificates.key_hash:
# SHA-256 of the public key. certificates.parent: the serial of the certificate that was renewed, '' for one that came
# with a token; a certificate is renewed once. how: token, renewal or grace. *_ns of 0: not so far.
# robot_identities.alarm: what looks like a copy of the robot, '' for nothing.
ROBOT_IDENTITY = """
    CREATE TABLE identity_changes (id {integer} PRIMARY KEY, revision {integer} NOT NULL);
    INSERT INTO identity_changes VALUES (1, 0);
    CREATE TABLE authorities (
        authority TEXT PRIMARY KEY,
        root TEXT NOT NULL,
        certificate TEXT NOT NULL,
        sealed_key {blob} NOT NULL,
        made_ns {integer} NOT NULL,
        not_after_ns {integer} NOT NULL
    );
    CREATE TABLE enrolment_tokens (
        token TEXT PRIMARY KEY,
        secret_hash TEXT NOT NULL,
        robot TEXT NOT NULL,
        made_by TEXT NOT NULL,
        made_ns {integer} NOT NULL,
        expires_ns {integer} NOT NULL,
        used_ns {integer} NOT NULL,
        used_robot TEXT NOT NULL,
        used_key TEXT NOT NULL
    );
    CREATE TABLE robot_identities (
        robot TEXT PRIMARY KEY,
        enrolled_ns {integer} NOT NULL,
        revoked_ns {integer} NOT NULL,
        reason TEXT NOT NULL,
        alarm TEXT NOT NULL,
        alarm_ns {integer} NOT NULL,
        revision {integer} NOT NULL
    );
    CREATE INDEX robot_identities_revision ON robot_identities (revision);
    CREATE TABLE certificates (
        serial TEXT PRIMARY KEY,
        robot TEXT NOT NULL REFERENCES robot_identities,
        key_hash TEXT NOT NULL,
        parent TEXT NOT NULL,
        how TEXT NOT NULL,
        issued_ns {integer} NOT NULL,
        not_after_ns {integer} NOT NULL,
        revoked_ns {integer} NOT NULL,
        certificate TEXT NOT NULL
    );
    CREATE INDEX certificates_robot ON certificates (robot, issued_ns);
    CREATE UNIQUE INDEX certificates_parent ON certificates (parent) WHERE parent <> '';
"""
