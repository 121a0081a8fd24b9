"""Robots' graphs as the API shows them: JSON-able, every list by name."""

from __future__ import annotations

from typing import Any

from gateway.api.views.robots import rfc3339
from gateway.fleet.ros.goal import Goal, GoalEvent
from gateway.fleet.ros.graph import ActionInfo, Endpoint, RobotGraph, ServiceInfo

__all__ = ["action_view", "endpoint_view", "goal_event_view", "goal_view", "graph_view", "service_view"]


def endpoint_view(endpoint: Endpoint) -> dict[str, str]:
    """As the API shows it."""
    return {
        "node": endpoint.node,
        "type": endpoint.type_name,
        "type_hash": endpoint.type_hash,
        "qos": endpoint.qos,
    }


def graph_view(graph: RobotGraph) -> dict[str, Any]:
    """As the API shows it; every list by name."""
    return {
        "robot": graph.robot,
        "revision": graph.revision,
        "nodes": list(graph.nodes),
        "topics": [_topic_view(graph, topic) for topic in graph.topics],
        "services": [service_view(name, info) for name, info in sorted(graph.services.items())],
        "actions": [action_view(name, info) for name, info in sorted(graph.actions.items())],
        "left_out": graph.left_out,
    }


def service_view(name: str, info: ServiceInfo) -> dict[str, Any]:
    """A service as the API shows it."""
    return {
        "service": name,
        "type": info.type_name,
        "type_hash": info.type_hash,
        "nodes": list(info.nodes),
        "servers": [endpoint_view(server) for server in info.servers],
        "clients": [endpoint_view(client) for client in info.clients],
    }


def action_view(name: str, info: ActionInfo) -> dict[str, Any]:
    """An action as the API shows it."""
    return {"action": name, "type": info.type_name, "servers": list(info.servers), "clients": list(info.clients)}


def _topic_view(graph: RobotGraph, topic: str) -> dict[str, Any]:
    publishers, subscribers = graph.publishers.get(topic, ()), graph.subscribers.get(topic, ())
    return {
        "topic": topic,
        "types": sorted({end.type_name for end in (*publishers, *subscribers)}),
        "publishers": [endpoint_view(end) for end in publishers],
        "subscribers": [endpoint_view(end) for end in subscribers],
    }


def goal_view(goal: Goal) -> dict[str, Any]:
    """A goal as the API shows it."""
    feedback = goal.newest_feedback
    return {
        "goal": goal.id,
        "robot": goal.robot,
        "action": goal.action,
        "type": goal.type_name,
        "status": goal.status,
        "ended": goal.ended,
        "reachable": goal.reachable,
        "begun": rfc3339(goal.started_ns),
        "by": goal.by,
        "feedback": feedback.value if feedback is not None else None,
        "result": goal.result,
        "message": goal.message,
        "skipped": goal.skipped,
    }


def goal_event_view(goal: Goal, event: GoalEvent) -> dict[str, Any]:
    """Something that was told of a goal."""
    view: dict[str, Any] = {"goal": goal.id, "status": event.status, "message": event.message}
    if event.stamp_ns:
        view["stamp_ms"] = event.stamp_ns / 1e6
    return view if event.kind == "status" else {**view, event.kind: event.value}
