"""Rules in the database, and what they did. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict

import orjson

from gateway.domain.automation.rule import Maker, RuleEntry, RuleStats, StoredRule
from gateway.store.engine import Row, StoreEngine

__all__ = [
    "add_stats",
    "read_rule",
    "read_rules",
    "read_stats",
    "remove_rule",
    "rule_head",
    "rule_history",
    "write_rule",
]

_SELECT = "SELECT name, revision, document, maker, changed_ns FROM rules"
_PUT = """
    INSERT INTO rules VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (name) DO UPDATE SET revision = excluded.revision, document = excluded.document,
        maker = excluded.maker, changed_ns = excluded.changed_ns
"""
_COUNT = """
    INSERT INTO rule_stats AS s VALUES (?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (rule, gateway) DO UPDATE SET matched = s.matched + excluded.matched,
        fired = s.fired + excluded.fired, errors = s.errors + excluded.errors,
        fired_ns = CASE WHEN excluded.fired_ns > 0 THEN excluded.fired_ns ELSE s.fired_ns END,
        error = CASE WHEN excluded.error_ns > 0 THEN excluded.error ELSE s.error END,
        error_ns = CASE WHEN excluded.error_ns > 0 THEN excluded.error_ns ELSE s.error_ns END
"""


def rule_head(engine: StoreEngine) -> int:
    """The newest revision of all rules: as long as it stays, no rule has changed."""
    return int(engine.fetch("SELECT revision FROM rule_head WHERE id = 1")[0][0])


def read_rules(engine: StoreEngine) -> list[StoredRule]:
    """Every rule, by name."""
    return [_rule(row) for row in engine.fetch(f"{_SELECT} ORDER BY name")]


def read_rule(engine: StoreEngine, name: str) -> StoredRule | None:
    """One rule."""
    rows = engine.fetch(f"{_SELECT} WHERE name = ?", name)
    return _rule(rows[0]) if rows else None


def write_rule(engine: StoreEngine, rule: StoredRule, *, what: str, by: str, most_entries: int) -> int:
    """Store a rule, whatever its revision says, under the next one, and return that; what a former one of the same
    name remembers is the caller's to forget.
    """
    revision = _next(engine)
    maker = orjson.dumps(asdict(rule.maker)).decode()
    engine.execute(_PUT, rule.name, revision, rule.document, maker, rule.changed_ns)
    _note(engine, rule, revision, what, by, rule.changed_ns, most_entries)
    return revision


def remove_rule(engine: StoreEngine, rule: StoredRule, *, by: str, now_ns: int, most_entries: int) -> None:
    """Take a rule away, with all that it counted, but not its history; what it remembers is the caller's to forget."""
    engine.execute("DELETE FROM rules WHERE name = ?", rule.name)
    engine.execute("DELETE FROM rule_stats WHERE rule = ?", rule.name)
    engine.execute("DELETE FROM rule_fires WHERE rule = ?", rule.name)
    mine = f"target/{rule.name}/"
    engine.execute("DELETE FROM rule_secrets WHERE substr(owner, 1, ?) = ?", len(mine), mine)
    _note(engine, rule, _next(engine), "deleted", by, now_ns, most_entries)


def rule_history(engine: StoreEngine, name: str, *, limit: int, before: int | None = None) -> list[RuleEntry]:
    """A rule's changes, the newest first, also of one that is gone; `before` is the revision after which to go on."""
    rows = engine.fetch(
        "SELECT revision, what, author, at_ns, document FROM rule_history WHERE rule = ? AND revision < ?"
        " ORDER BY revision DESC LIMIT ?",
        name,
        before if before is not None else 1 << 62,
        limit,
    )
    return [RuleEntry(revision=row[0], what=row[1], by=row[2], at_ns=row[3], document=row[4]) for row in rows]


def add_stats(engine: StoreEngine, gateway: str, news: Mapping[str, RuleStats]) -> None:
    """Count what rules did since this gateway counted last."""
    rows = [
        (rule, gateway, one.matched, one.fired, one.errors, one.fired_ns, one.error, one.error_ns)
        for rule, one in sorted(news.items())
    ]
    engine.many(_COUNT, rows)


def read_stats(engine: StoreEngine, names: Iterable[str] | None = None) -> dict[str, RuleStats]:
    """What rules have done, at all gateways together; of all rules, or of some."""
    wanted = None if names is None else set(names)
    found: dict[str, RuleStats] = {}
    sql = "SELECT rule, matched, fired, errors, fired_ns, error, error_ns FROM rule_stats"
    for name, matched, fired, errors, fired_ns, error, error_ns in engine.fetch(sql):
        if wanted is not None and name not in wanted:
            continue
        known = found.get(name, RuleStats())
        newer = error_ns > known.error_ns
        found[name] = RuleStats(
            matched=known.matched + matched,
            fired=known.fired + fired,
            errors=known.errors + errors,
            fired_ns=max(known.fired_ns, fired_ns),
            error=error if newer else known.error,
            error_ns=error_ns if newer else known.error_ns,
        )
    return found


def _next(engine: StoreEngine) -> int:
    engine.execute("UPDATE rule_head SET revision = revision + 1 WHERE id = 1")
    return rule_head(engine)


def _note(engine: StoreEngine, rule: StoredRule, revision: int, what: str, by: str, at_ns: int, most: int) -> None:
    engine.execute(
        "INSERT INTO rule_history VALUES (?, ?, ?, ?, ?, ?)", rule.name, revision, what, by, at_ns, rule.document
    )
    old = engine.fetch(
        "SELECT revision FROM rule_history WHERE rule = ? ORDER BY revision DESC LIMIT 1 OFFSET ?", rule.name, most
    )
    if old:
        engine.execute("DELETE FROM rule_history WHERE rule = ? AND revision <= ?", rule.name, old[0][0])


def _rule(row: Row) -> StoredRule:
    maker = orjson.loads(row[3])
    return StoredRule(
        name=row[0],
        revision=row[1],
        document=row[2],
        maker=Maker(**{**maker, "robots": tuple(maker["robots"])}),
        changed_ns=row[4],
    )
