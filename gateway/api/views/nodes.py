"""Robots' nodes as the API shows them. What a robot said is brought into shape: nothing of it is to be believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gateway.api.problem import error_code
from gateway.api.views.robots import rfc3339
from gateway.api.views.twin import outcome_view
from gateway.domain.fleet.node import Difference, NodeState
from gateway.domain.fleet.parameter import Bounds
from gateway.fleet.nodes.logs import LogPage
from gateway.fleet.nodes.manager import RobotNodes
from gateway.fleet.nodes.values import Lifecycle, Parameter
from gateway.fleet.nodes.verbs import Result
from metaros.fleet.twin.document import NodeSpec

__all__ = [
    "crash_view",
    "lifecycle_view",
    "log_view",
    "node_view",
    "nodes_view",
    "parameter_view",
    "result_view",
    "results_view",
]

TEXT_CHARS = 4096
MOST_NS = 1 << 62  # of a robot's clock: after that there are no dates


def node_view(node: NodeState, *, in_own: bool) -> dict[str, Any]:
    """One node, both sides."""
    return {
        "robot": node.robot,
        "name": node.name,
        "ros_name": node.ros_name,
        "online": node.online,
        "state": node.state[:TEXT_CHARS],
        "wanted": node.wanted,
        "in_step": not node.differs,
        "differs": [_row(item) for item in node.differs],
        "in_own": in_own,
        "desired": _row(node.desired) if node.desired is not None else None,
        "reported": _reported(node.reported) if node.reported is not None else None,
        "reported_at": _time(node.reported_ns),
        "holder": node.holder,
    }


def nodes_view(item: RobotNodes) -> dict[str, Any]:
    """One robot's."""
    standing = item.standing
    return {
        "robot": standing.robot,
        "online": standing.online,
        "namespace": standing.namespace,
        "revision": standing.revision,
        "applied": standing.applied,
        "in_step": standing.in_step,
        "nodes": [node_view(node, in_own=node.name in item.own) for node in item.nodes],
    }


def result_view(item: Result) -> dict[str, Any]:
    """What became of a verb at one robot."""
    edited = outcome_view(item.edited, dry_run=item.dry_run) if item.edited is not None else None
    return {
        "robot": item.robot,
        "node": item.action.node,
        "verb": item.action.verb,
        "dry_run": item.dry_run,
        "outcome": item.outcome,
        "told": item.told,
        "changed": edited is not None and edited["changed"],
        "revision": edited["revision"] if edited is not None else None,
        "changes": edited["changes"] if edited is not None else [],
        "code": error_code(item.error) if item.error is not None else "",
        "message": str(item.error) if item.error is not None else "",
    }


def results_view(items: Sequence[Result]) -> dict[str, Any]:
    """The same of a group."""
    first = items[0]
    return {
        "verb": first.action.verb,
        "node": first.action.node,
        "dry_run": first.dry_run,
        "robots": len(items),
        "done": sum(1 for item in items if item.outcome == "done"),
        "results": [result_view(item) for item in items],
    }


def log_view(page: LogPage) -> dict[str, Any]:
    """A page of a log."""
    lines = [{"at": _time(at_ns), "at_ns": str(at_ns), "text": text} for at_ns, text in page.lines]
    return {"lines": lines, "cursor": page.cursor, "more": page.more}


def crash_view(found: Mapping[str, Any]) -> dict[str, Any]:
    """A report of a crash."""
    env, ran_s = found.get("env"), found.get("ran_s")
    return {
        "at": _time(_whole(found.get("at_ns"))),
        "reason": _text(found.get("reason")),
        "pid": _whole(found.get("pid")) or None,
        "ran_s": float(ran_s) if isinstance(ran_s, int | float) else None,
        "version": _text(found.get("version")),
        "argv": _texts(found.get("argv")),
        "env": {key[:TEXT_CHARS]: _text(value) for key, value in env.items()} if isinstance(env, dict) else {},
        "lines": _texts(found.get("lines")),
    }


def parameter_view(item: Parameter) -> dict[str, Any]:
    """A parameter with its rules."""
    rules = item.rules
    return {
        "name": rules.name,
        "type": rules.kind if item.kind == "not_set" else item.kind,
        "value": item.value,
        **({"desired": item.wanted["value"]} if item.wanted else {}),
        "description": rules.description,
        "constraints": rules.constraints,
        "read_only": rules.read_only,
        "dynamic_typing": rules.dynamic_typing,
        "integer_range": _bounds(rules.integer_range),
        "floating_point_range": _bounds(rules.floating_point_range),
    }


def lifecycle_view(robot: str, node: str, item: Lifecycle) -> dict[str, Any]:
    """A managed node's state."""
    return {
        "robot": robot,
        "node": node,
        "managed": item.managed,
        "state": item.state,
        "wanted": item.wanted,
        "transitions": [label for _, label in item.transitions],
    }


def _row(item: Difference | NodeSpec) -> dict[str, Any]:
    """Its fields as they are; dataclasses.asdict copies them deeply, and a fleet has very many."""
    return {name: getattr(item, name) for name in item.__slots__}


def _reported(said: Mapping[str, Any]) -> dict[str, Any]:
    waits_for, update = said.get("waits_for"), said.get("update")
    waiting = waits_for.split(", ") if isinstance(waits_for, str) and waits_for else _texts(waits_for)
    return {
        "state": _text(said.get("state")),
        "why": _text(said.get("why")),
        "pid": _whole(said.get("pid")) or None,
        "restarts": _whole(said.get("restarts")),
        "since": _time(_whole(said.get("since_ns"))),
        "last_exit": _text(said.get("last_exit")),
        "version": _text(said.get("version")),
        "waits_for": waiting,
        "lease_id": _text(said.get("lease_id")),
        "nice": said["nice"] if type(said.get("nice")) is int else None,
        "quarantined": said.get("quarantined") is True,
        "crashes": _whole(said.get("crashes")),
        "safe_stop": _text(said.get("safe_stop")),
        "update": {key: _text(update.get(key)) for key in ("state", "version", "code", "message")}
        if isinstance(update, dict)
        else None,
    }


def _bounds(found: Bounds | None) -> dict[str, float] | None:
    return None if found is None else {"from": found.low, "to": found.high, "step": found.step}


def _time(wall_ns: int) -> str | None:
    return rfc3339(wall_ns) if 0 < wall_ns < MOST_NS else None


def _whole(value: Any) -> int:
    return value if type(value) is int and 0 <= value < MOST_NS else 0


def _text(value: Any) -> str:
    return value[:TEXT_CHARS] if isinstance(value, str) else ""


def _texts(value: Any) -> list[str]:
    return [_text(item) for item in value] if isinstance(value, list) else []
