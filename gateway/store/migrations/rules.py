"""Migration 17: rules, what they remember, when they fire next, hooks, and the secrets of both."""

from __future__ import annotations

__all__ = ["RULES"]

# rules.document, rules.maker: JSON. rule_head: the newest revision of all, by which gateways notice changes.
# rule_states: what a rule remembers of one group; `last` is the event that its timer fires on; due_ns 0: no timer.
# rule_stats: counted by each gateway for itself, so that none waits for another. rule_fires: schedules; 0 is never.
# rule_secrets.owner: "hook/NAME" or "target/RULE/ID"; sealed by the master key.
RULES = """
    CREATE TABLE rule_head (id {integer} PRIMARY KEY, revision {integer} NOT NULL);
    INSERT INTO rule_head VALUES (1, 0);
    CREATE TABLE rules (
        name TEXT PRIMARY KEY,
        revision {integer} NOT NULL,
        document TEXT NOT NULL,
        maker TEXT NOT NULL,
        changed_ns {integer} NOT NULL
    );
    CREATE TABLE rule_history (
        rule TEXT NOT NULL,
        revision {integer} NOT NULL,
        what TEXT NOT NULL,
        author TEXT NOT NULL,
        at_ns {integer} NOT NULL,
        document TEXT NOT NULL,
        PRIMARY KEY (rule, revision)
    );
    CREATE TABLE rule_states (
        rule TEXT NOT NULL,
        grp TEXT NOT NULL,
        token TEXT NOT NULL,
        state TEXT NOT NULL,
        last TEXT NOT NULL,
        due_ns {integer} NOT NULL,
        revision {integer} NOT NULL,
        PRIMARY KEY (rule, grp)
    );
    CREATE INDEX rule_states_due ON rule_states (due_ns) WHERE due_ns > 0;
    CREATE TABLE rule_stats (
        rule TEXT NOT NULL,
        gateway TEXT NOT NULL,
        matched {integer} NOT NULL,
        fired {integer} NOT NULL,
        errors {integer} NOT NULL,
        fired_ns {integer} NOT NULL,
        error TEXT NOT NULL,
        error_ns {integer} NOT NULL,
        PRIMARY KEY (rule, gateway)
    );
    CREATE TABLE rule_fires (
        rule TEXT PRIMARY KEY,
        token TEXT NOT NULL,
        next_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL
    );
    CREATE INDEX rule_fires_next ON rule_fires (next_ns) WHERE next_ns > 0;
    CREATE TABLE rule_secrets (owner TEXT PRIMARY KEY, sealed {blob} NOT NULL, made_ns {integer} NOT NULL);
    CREATE TABLE hooks (
        hook TEXT PRIMARY KEY,
        description TEXT NOT NULL,
        auth TEXT NOT NULL,
        robot TEXT NOT NULL,
        made_by TEXT NOT NULL,
        robots TEXT NOT NULL,
        made_ns {integer} NOT NULL,
        accepted {integer} NOT NULL,
        refused {integer} NOT NULL,
        used_ns {integer} NOT NULL
    );
"""
