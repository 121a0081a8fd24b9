"""The table of checks with what people set otherwise: merged, checked, and stored."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import orjson

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.watch.errors import UnknownCheckError
from gateway.alerting.watch.rows import CheckRow
from gateway.domain.finding import SEVERITIES
from gateway.errors import InvalidRequestError
from gateway.store.engine import StoreEngine

__all__ = ["FIELDS", "Change", "checked", "merged", "read_changes", "row_of", "write_change"]

log = logging.getLogger(__name__)

FIELDS = ("enabled", "low", "high", "for_s", "clear_s", "severity")
MAX_SPAN_S = 30 * 86_400.0
_BY_ID = {check.id: check for check in DEFAULT_CHECKS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What somebody set otherwise of one check."""

    values: Mapping[str, Any]
    by: str
    at_ns: int


def merged(changes: Mapping[str, Mapping[str, Any]]) -> tuple[Check, ...]:
    """The checks as they come, with these changes; those that do not fit the table of today are left out."""
    return tuple(_changed(check, changes.get(check.id, {})) for check in DEFAULT_CHECKS)


def row_of(check: Check, change: Change | None) -> CheckRow:
    """A check as it is in force, for people."""
    plain = _BY_ID[check.id]
    return CheckRow(
        id=check.id,
        title=check.title,
        unit=check.unit,
        **{name: getattr(check, name) for name in FIELDS},
        changed=tuple(name for name in FIELDS if getattr(check, name) != getattr(plain, name)),
        by=change.by if change is not None else "",
        at_ns=change.at_ns if change is not None else 0,
    )


def checked(check_id: str, before: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The changes of a check with new ones over them.

    Raises:
        UnknownCheckError: there is no such check.
        InvalidRequestError: a value that it cannot have.
    """
    if check_id not in _BY_ID:
        raise UnknownCheckError.of(check_id)
    takes = _BY_ID[check_id].fields
    if idle := [name for name in changes if name in FIELDS and name not in takes]:
        raise InvalidRequestError(
            f"check {check_id} has no {' and no '.join(idle)}: of it you may set {', '.join(takes)}"
        )
    wanted = {**before, **{name: _value(name, value) for name, value in changes.items()}}
    try:
        replace(_BY_ID[check_id], **wanted)
    except ValueError as error:
        raise InvalidRequestError(str(error)) from error
    return {name: value for name, value in wanted.items() if value != getattr(_BY_ID[check_id], name)}


def _changed(check: Check, values: Mapping[str, Any]) -> Check:
    try:
        return replace(check, **{name: value for name, value in values.items() if name in FIELDS})
    except ValueError:
        log.warning("what was set of check %s does not fit it any more", check.id)
        return check


def _value(name: str, value: Any) -> Any:
    if name == "enabled" and isinstance(value, bool):
        return value
    if name == "severity" and value in SEVERITIES:
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if name in ("low", "high") and (number or value is None):
        return None if value is None else float(value)
    if name in ("for_s", "clear_s") and number and 0 <= value <= MAX_SPAN_S:
        return float(value)
    raise InvalidRequestError(
        "a check has enabled (true or false), low and high (numbers), for_s and clear_s (0 to 2592000), "
        f"and severity (info, warning, error); not this {name}"
    )


def read_changes(engine: StoreEngine) -> dict[str, Change]:
    """What is stored, by check; in a transaction of its own."""
    with engine.transaction(write=False):
        rows = engine.fetch("SELECT id, document, changed_by, changed_ns FROM alert_checks ORDER BY id")
    return {row[0]: Change(values=orjson.loads(row[1]), by=row[2], at_ns=row[3]) for row in rows if row[0] in _BY_ID}


def write_change(engine: StoreEngine, check_id: str, change: Change) -> None:
    """Store what is otherwise of a check; without values it is as it comes again. In the caller's transaction."""
    engine.execute("DELETE FROM alert_checks WHERE id = ?", check_id)
    if change.values:
        document = orjson.dumps(dict(change.values)).decode()
        engine.execute("INSERT INTO alert_checks VALUES (?, ?, ?, ?)", check_id, document, change.by, change.at_ns)
