"""Alerts in the database. Every function runs inside a transaction of the caller's.

An alert is saved only over the revision that was read: of two who change it at once, the second reads it again. That
no robot has two unresolved alerts of one cause is the database's to keep, whichever gateway opens them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from math import nan
from typing import Any

import orjson

from gateway.domain.alert import EVERY_ALERT, Alert, AlertFilter, Evidence
from gateway.domain.finding import Finding
from gateway.errors import UnstorableError
from gateway.store.engine import Row, StoreEngine, placeholders, slices

__all__ = [
    "alert_revisions",
    "find_unresolved",
    "list_alerts",
    "live_alerts",
    "purge_alerts",
    "read_alert",
    "read_alerts",
    "save_alert",
]

_OWN = ("state", "severity", "title", "reason", "opened_ns", "changed_ns", "resolved_ns")  # columns of their own
_NAMED = ("robot", "cause", *_OWN)
_COLUMNS = f"alert, {', '.join(_NAMED)}, document, revision"
_IN_DOCUMENT = tuple(item.name for item in fields(Alert) if item.name not in {*_NAMED, "id", "revision", "findings"})
_PAGE = 512
_REST = ("alert_remarks", "alert_notices")


def save_alert(engine: StoreEngine, alert: Alert) -> bool:
    """Keep an alert over the revision it has, as the next one; 0 is a new one.

    False when it is not at that revision any more, or another one of its robot and cause is not resolved: then nothing
    was kept.
    """
    own = [getattr(alert, name) for name in _OWN]
    state = [int(alert.quiet), int(alert.unresolved or not alert.clear_ns), _document(alert)]
    if not alert.revision:
        return bool(
            engine.execute(
                f"INSERT INTO alerts (alert, robot, cause, {', '.join(_OWN)}, quiet, live, document, revision)"
                f" VALUES ({placeholders(6 + len(_OWN))}, 1) ON CONFLICT DO NOTHING",
                alert.id,
                alert.robot,
                alert.cause,
                *own,
                *state,
            )
        )
    sets = ", ".join(f"{name} = ?" for name in (*_OWN, "quiet", "live", "document"))
    sql = f"UPDATE alerts SET {sets}, revision = revision + 1 WHERE alert = ? AND revision = ?"
    values = [*own, *state, alert.id, alert.revision]
    if alert.unresolved:
        sql += (
            " AND NOT EXISTS (SELECT 1 FROM alerts AS o"
            " WHERE o.robot = ? AND o.cause = ? AND o.state <> 'resolved' AND o.alert <> ?)"
        )
        values += [alert.robot, alert.cause, alert.id]
    return bool(engine.execute(sql, *values))


def read_alert(engine: StoreEngine, alert_id: str) -> Alert | None:
    """One alert."""
    rows = engine.fetch(f"SELECT {_COLUMNS} FROM alerts WHERE alert = ?", alert_id)
    return _alert(rows[0]) if rows else None


def read_alerts(engine: StoreEngine, alert_ids: Sequence[str]) -> list[Alert]:
    """Those of many alerts that there are."""
    found: dict[str, Alert] = {}
    for some in slices(alert_ids):
        sql = f"SELECT {_COLUMNS} FROM alerts WHERE alert IN ({placeholders(len(some))})"
        found |= {row[0]: _alert(row) for row in engine.fetch(sql, *some)}
    return list(found.values())


def find_unresolved(engine: StoreEngine, robot: str, cause: str) -> Alert | None:
    """The one alert of a robot and cause that is not resolved."""
    sql = f"SELECT {_COLUMNS} FROM alerts WHERE robot = ? AND cause = ? AND state <> 'resolved'"
    rows = engine.fetch(sql, robot, cause)
    return _alert(rows[0]) if rows else None


def live_alerts(engine: StoreEngine, *, resolved_after_ns: int, limit: int) -> list[Alert]:
    """All that can still change by themselves, the oldest first: not resolved, with a finding that is not over, or
    resolved only a moment ago. Of more than `limit` the newest.
    """
    sql = f"SELECT {_COLUMNS} FROM alerts WHERE live = 1 ORDER BY alert DESC LIMIT ?"
    found = {row[0]: _alert(row) for row in engine.fetch(sql, limit)}
    sql = f"SELECT {_COLUMNS} FROM alerts WHERE resolved_ns > ? AND live = 0 ORDER BY resolved_ns DESC LIMIT ?"
    found |= {row[0]: _alert(row) for row in engine.fetch(sql, resolved_after_ns, limit)}
    return [found[key] for key in sorted(found)]


def alert_revisions(engine: StoreEngine) -> dict[str, int]:
    """The alerts that can still change, and how often each was stored."""
    rows = engine.fetch("SELECT alert, revision FROM alerts WHERE live = 1")
    return {row[0]: int(row[1]) for row in rows}


def list_alerts(
    engine: StoreEngine, wanted: AlertFilter = EVERY_ALERT, *, limit: int, before: str | None = None
) -> list[Alert]:
    """The newest alerts that somebody wants and may see, the newest first; `before` is the id after which to go on."""
    conditions, values = _where(wanted)
    last, found = before, list[Alert]()
    while True:
        where = [*conditions, *["alert < ?"] * (last is not None)]
        sql = f"SELECT {_COLUMNS} FROM alerts WHERE {' AND '.join(where) or '1 = 1'} ORDER BY alert DESC LIMIT ?"
        rows = engine.fetch(sql, *values, *([last] if last is not None else []), _PAGE)
        for row in rows:
            if wanted.sees is not None and not wanted.sees(row[1]):
                continue
            alert = _alert(row)
            if wanted.matches(alert):
                found.append(alert)
            if len(found) == limit:
                return found
        if len(rows) < _PAGE:
            return found
        last = rows[-1][0]


def purge_alerts(engine: StoreEngine, *, before_ns: int, most: int, limit: int = 500) -> int:
    """Delete the alerts that were over longest, with all that belongs to them; how many went.

    Those that were resolved before a time, and of more than `most` the oldest.
    """
    over = "resolved_ns > 0 AND live = 0"
    count = int(engine.fetch(f"SELECT count(*) FROM alerts WHERE {over}")[0][0])
    sql = f"SELECT alert FROM alerts WHERE {over} ORDER BY resolved_ns LIMIT ?"
    going = [row[0] for row in engine.fetch(sql, min(limit, max(0, count - most)))]
    sql = f"SELECT alert FROM alerts WHERE {over} AND resolved_ns < ? ORDER BY resolved_ns LIMIT ?"
    going = list(dict.fromkeys([*going, *(row[0] for row in engine.fetch(sql, before_ns, limit))]))
    for some in slices(going):
        within = placeholders(len(some))
        for table in (*_REST, "alerts"):
            engine.execute(f"DELETE FROM {table} WHERE alert IN ({within})", *some)
    return len(going)


def _where(wanted: AlertFilter) -> tuple[list[str], list[Any]]:
    conditions: list[str] = []
    values: list[Any] = []
    for column, items in (("state", wanted.states), ("severity", wanted.severities), ("robot", wanted.robots)):
        if items:
            conditions.append(f"{column} IN ({placeholders(len(items))})")
            values += items
    if wanted.from_ns:
        conditions.append("(resolved_ns = 0 OR resolved_ns >= ?)")
        values.append(wanted.from_ns)
    if wanted.until_ns:
        conditions.append("opened_ns < ?")
        values.append(wanted.until_ns)
    if wanted.quiet is not None:
        conditions.append("quiet = ?")
        values.append(int(wanted.quiet))
    return conditions, values


def _document(alert: Alert) -> str:
    document: dict[str, Any] = {name: getattr(alert, name) for name in _IN_DOCUMENT}
    document["findings"] = [
        {**asdict(item.finding), "told_ns": item.told_ns, "ended_ns": item.ended_ns} for item in alert.findings
    ]
    try:
        return orjson.dumps(document).decode()  # NaN becomes null
    except TypeError as error:
        raise UnstorableError(f"alert {alert.id}: {error}") from error


def _alert(row: Row) -> Alert:
    document = orjson.loads(row[len(_NAMED) + 1])
    named = dict(zip(_NAMED, row[1:], strict=False))
    findings = tuple(_evidence(item) for item in document.pop("findings"))
    return replace(Alert(id=row[0], **named, **document), findings=findings, revision=int(row[len(_NAMED) + 2]))


def _evidence(item: dict[str, Any]) -> Evidence:
    reported_ns, ended_ns = item.pop("told_ns"), item.pop("ended_ns")
    numbers = {name: nan if item[name] is None else item[name] for name in ("value", "low", "high")}
    return Evidence(finding=Finding(**{**item, **numbers}), told_ns=reported_ns, ended_ns=ended_ns)
