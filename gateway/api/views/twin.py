"""Twins and templates as the API shows them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import orjson

from gateway.api.views.robots import rfc3339
from gateway.domain.fleet.twin import Template, TemplateEntry, TwinEntry
from gateway.fleet.twins.cache import reported_values
from gateway.fleet.twins.manager import TwinState
from gateway.fleet.twins.plan import Outcome
from metaros.fleet.twin import Change, canonical, diff, read
from metaros.limits import LIMITS

__all__ = [
    "brief_view",
    "history_view",
    "outcome_view",
    "outcomes_view",
    "template_history_view",
    "template_view",
    "twin_view",
]

SHOWN_CHANGES = 100  # of one robot in one answer
SHOWN_ROBOTS = 10_000


def brief_view(state: TwinState) -> dict[str, Any]:
    """One line of a list."""
    item = state.reported
    return {
        "robot": state.desired.robot,
        "revision": state.desired.revision,
        "edition": state.desired.edition,
        "in_step": state.in_step,
        "state": item.state if item is not None else "",
        "applied": item.applied if item is not None else 0,
        "code": item.code if item is not None else "",
        "message": item.message if item is not None else "",
        "templates": list(state.desired.templates),
        "labels": dict(state.labels),
        "problem": state.desired.problem,
    }


def twin_view(state: TwinState) -> dict[str, Any]:
    """Everything about one robot's twin."""
    desired, item = state.desired, state.reported
    return {
        "robot": desired.robot,
        "revision": desired.revision,
        "edition": desired.edition,
        "in_step": state.in_step,
        "own": orjson.loads(desired.own),
        "desired": orjson.loads(desired.document),
        "templates": list(desired.templates),
        "labels": dict(state.labels),
        "own_labels": dict(desired.labels),
        "problem": desired.problem,
        "author": desired.author,
        "at": rfc3339(desired.at_ns) if desired.at_ns else None,
        "reason": desired.reason,
        "confirm_within_s": desired.confirm_within_s,
        "reported": None
        if item is None
        else {
            "at": rfc3339(item.at_ns),
            "revision": item.revision,
            "applied": item.applied,
            "state": item.state,
            "code": item.code,
            "message": item.message,
            "values": reported_values(item),
        },
        "behind": [change.as_json() for change in state.behind[:SHOWN_CHANGES]],
    }


def outcome_view(item: Outcome, *, dry_run: bool) -> dict[str, Any]:
    """What an edit did, or would do, to one robot."""
    changes, own = item.changes, item.own_changes
    return {
        "robot": item.after.robot,
        "dry_run": dry_run,
        "revision": item.after.revision,
        "edition": item.after.edition,
        "changed": item.changed,
        "changes": _shown(changes),
        "own_changes": _shown(own),
        "own_labels": dict(item.after.labels),
        "more": max(0, len(changes) - SHOWN_CHANGES) + max(0, len(own) - SHOWN_CHANGES),
    }


def outcomes_view(items: Sequence[Outcome], *, dry_run: bool) -> dict[str, Any]:
    """The same of many robots; those whose documents are alike share the work."""
    views: dict[tuple[bytes, ...], dict[str, Any]] = {}
    results = []
    for item in items[:SHOWN_ROBOTS]:
        key = item.before.document, item.after.document, item.before.own, item.after.own
        view = views.get(key)
        if view is None:
            view = views[key] = outcome_view(item, dry_run=dry_run)
        names = {"robot": item.after.robot, "revision": item.after.revision, "edition": item.after.edition}
        labels = dict(item.after.labels)
        results.append({**view, **names, "changed": item.changed, "own_labels": labels})
    changed = sum(1 for item in items if item.changed)
    return {"dry_run": dry_run, "robots": len(items), "changed": changed, "results": results}


def history_view(entries: Sequence[TwinEntry], *, limit: int) -> dict[str, Any]:
    """The newest `limit` of a robot's history; each against the one before it, the first of all against nothing."""
    before = [*(entry.document for entry in entries[1:]), b"{}"]
    shown = _page([len(entry.own) + len(entry.document) for entry in entries[:limit]])
    views = [
        {
            "revision": entry.revision,
            "edition": entry.edition,
            "at": rfc3339(entry.at_ns),
            "author": entry.author,
            "reason": entry.reason,
            "changes": _shown(diff(read(old), read(entry.document))) if old != entry.document else [],
            "own": orjson.loads(entry.own),
            "desired": orjson.loads(entry.document),
        }
        for entry, old in zip(entries[:shown], before, strict=False)
    ]
    return {"entries": views, "more": len(entries[:limit]) - shown}


def template_view(item: Template) -> dict[str, Any]:
    """A template."""
    return {
        "name": item.name,
        "selector": item.selector.text,
        "priority": item.priority,
        "revision": item.revision,
        "author": item.author,
        "at": rfc3339(item.at_ns),
        "reason": item.reason,
        "document": dict(item.document),
    }


def template_history_view(entries: Sequence[TemplateEntry], *, limit: int) -> dict[str, Any]:
    """The newest `limit` of a template's history; each against the one before it, the first of all against nothing."""
    before = [*(entry.document for entry in entries[1:]), {}]
    shown = _page([len(canonical(dict(entry.template.document))) for entry in entries[:limit]])
    views = [
        {
            **template_view(entry.template),
            "removed": entry.removed,
            "changes": _shown(diff(dict(old), dict(entry.document))),
        }
        for entry, old in zip(entries[:shown], before, strict=False)
    ]
    return {"entries": views, "more": len(entries[:limit]) - shown}


def _page(sizes: Sequence[int]) -> int:
    """How many of so large entries go into one answer; one at the least."""
    total, count = 0, 0
    for size in sizes:
        total += size
        if count and total > LIMITS.twin_page_bytes:
            break
        count += 1
    return count


def _shown(changes: Sequence[Change]) -> list[dict[str, Any]]:
    return [change.as_json() for change in changes[:SHOWN_CHANGES]]
