"""Rules, schedules and hooks as the API shows them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import orjson

from gateway.api.views.robots import rfc3339
from gateway.api.webhook_path import PREFIX
from gateway.automation.rules.dry_run import DryRun
from gateway.automation.rules.rule import Rule
from gateway.domain.automation.gateway_event import WEBHOOK
from gateway.domain.automation.rule import Hook, NextFire, RuleEntry, RuleStats, StoredRule
from gateway.outbound.webhook import Webhook

__all__ = ["document_view", "dry_run_view", "entry_view", "hook_view", "rule_view", "schedule_view"]

FIELDS: dict[str, Any] = {
    "description": "",
    "enabled": True,
    "pattern": None,
    "until": None,
    "topic": None,
    "metric": None,
    "schedule": None,
    "when": None,
    "event_format": "eventbridge",
}


def document_view(text: str, *, whole: bool) -> dict[str, Any]:
    """A rule's document with all its fields; what may be secret in URLs is hidden unless `whole`."""
    said: dict[str, Any] = orjson.loads(text)
    targets = [item if whole else _hidden(item) for item in said.get("targets") or []]
    return {"name": said["name"], **{name: said.get(name, plain) for name, plain in FIELDS.items()}, "targets": targets}


def rule_view(
    stored: StoredRule, stats: RuleStats, groups: int, fire: NextFire | None, *, whole: bool
) -> dict[str, Any]:
    """A rule with what it did."""
    return {
        **document_view(stored.document, whole=whole),
        "revision": stored.revision,
        "changed": rfc3339(stored.changed_ns),
        "maker": {"name": stored.maker.name, "role": stored.maker.role, "robots": list(stored.maker.robots)},
        "stats": {
            "matched": stats.matched,
            "fired": stats.fired,
            "errors": stats.errors,
            "last_fired": _time(stats.fired_ns),
            "last_error": stats.error,
            "last_error_at": _time(stats.error_ns),
            "groups": groups,
        },
        "next_fire": _time(fire.next_ns) if fire is not None else None,
    }


def entry_view(entry: RuleEntry, *, whole: bool) -> dict[str, Any]:
    """One change of a rule."""
    return {
        "revision": entry.revision,
        "what": entry.what,
        "by": entry.by,
        "at": rfc3339(entry.at_ns),
        "document": document_view(entry.document, whole=whole),
    }


def schedule_view(rule: Rule, fire: NextFire | None) -> dict[str, Any]:
    """When a rule fires by itself."""
    source = rule.schedule
    assert source is not None
    return {
        "rule": rule.name,
        "expression": source.expression,
        "timezone": source.timezone,
        "misfire": source.misfire,
        "enabled": rule.enabled,
        "next": _time(fire.next_ns) if fire is not None else None,
        "last": _time(fire.last_ns) if fire is not None else None,
    }


def hook_view(hook: Hook) -> dict[str, Any]:
    """A hook, without its secret."""
    return {
        "name": hook.name,
        "description": hook.description,
        "auth": hook.auth,
        "robot": hook.robot,
        "path": f"{PREFIX}{hook.name}",
        "source": f"{WEBHOOK}/{hook.name}",
        "type": WEBHOOK,
        "made": rfc3339(hook.made_ns),
        "made_by": hook.made_by,
        "last_used": _time(hook.used_ns),
        "accepted": hook.accepted,
        "refused": hook.refused,
    }


def dry_run_view(done: DryRun) -> dict[str, Any]:
    """What a dry run found."""
    return {
        "scanned": done.scanned,
        "matched": done.matched,
        "fired": done.fired,
        "errors": done.errors,
        "error": done.error,
        "truncated": done.cut,
        "firings": [
            {
                "at": rfc3339(one.at_ns),
                "happening": one.event_id,
                "type": one.type,
                "robot": one.robot,
                "group": one.group,
                "targets": [
                    {"id": target, "kind": kind, "payload": orjson.loads(payload)}
                    for target, kind, payload in one.payloads
                ],
            }
            for one in done.firings
        ],
    }


def _hidden(target: Mapping[str, Any]) -> dict[str, Any]:
    """Chats have their keys in the paths of URLs."""
    if target.get("kind") != "webhook":
        return dict(target)
    return {**target, "url": Webhook(url=str(target.get("url", ""))).target}


def _time(wall_ns: int) -> str | None:
    return rfc3339(wall_ns) if wall_ns else None
