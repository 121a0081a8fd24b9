"""Migration 10: leases of migratable nodes. A row stays when its unit is gone, so that its epoch never goes back."""

from __future__ import annotations

__all__ = ["LEASES"]

# scope: a template's name, or robot/ID; with the node's name it is what runs once. renewals: grows with every write,
# by which other gateways see that a lease goes on. keeper: the gateway that renews it, one word for each of its lives.
LEASES = """
    CREATE TABLE node_leases (
        scope TEXT NOT NULL,
        node TEXT NOT NULL,
        robot TEXT NOT NULL,
        lease TEXT NOT NULL,
        epoch {integer} NOT NULL,
        renewals {integer} NOT NULL,
        keeper TEXT NOT NULL,
        since_ns {integer} NOT NULL,
        PRIMARY KEY (scope, node)
    );
"""
