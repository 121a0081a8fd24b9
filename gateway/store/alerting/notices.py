"""What each route of notices was told of alerts, in the database. Inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.store.engine import Row, StoreEngine, placeholders

__all__ = ["keep_told", "told_rows"]

_COLUMNS = "alert, route, stage, severity, times, told_ns"


def keep_told(engine: StoreEngine, rows: Sequence[Row]) -> None:
    """Keep what routes were told last: alert, route, stage, severity, times, told_ns; not of alerts that are gone."""
    for row in rows:
        if engine.fetch("SELECT 1 FROM alerts WHERE alert = ?", row[0]):
            engine.execute("DELETE FROM alert_notices WHERE alert = ? AND route = ?", row[0], row[1])
            engine.execute(f"INSERT INTO alert_notices ({_COLUMNS}) VALUES ({placeholders(6)})", *row)


def told_rows(engine: StoreEngine, *, resolved_after_ns: int) -> list[Row]:
    """What routes were told of alerts that are not over, were not told to be, or are over only since a moment."""
    columns = ", ".join(f"n.{name.strip()}" for name in _COLUMNS.split(","))
    sql = (
        f"SELECT {columns} FROM alert_notices AS n JOIN alerts AS a ON a.alert = n.alert"
        " WHERE n.stage <> 'resolved' OR a.live = 1 OR a.resolved_ns > ? ORDER BY n.alert, n.route"
    )
    return [tuple(row) for row in engine.fetch(sql, resolved_after_ns)]
