"""What a handler asks of its robot: `{"publish": [{topic, type, message}], "call": [{service, type, request}]}`.

All of it is checked before any of it is done. It is done in that order, at least once: a robot that dies in the middle
does it again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from metaros.automation.robot.policy import FunctionPolicy
from metaros.errors import MetarosError
from metaros.idl import message_class
from metaros.idl.json import from_json, to_json
from metaros.limits import LIMITS, Limits
from metaros.node import Client, Node, Publisher

__all__ = ["Action", "ActionError", "ActionExecutor", "read_actions"]

KEPT: Final = 64
SETTLE_S: Final = 1.0  # in which those who listen to a topic learn of a new publisher


class ActionError(MetarosError):
    """What the handler asks for is refused; trying again changes nothing."""

    code = "action_refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One of them, checked: `content` is a message, or a request."""

    kind: Literal["publish", "call"]
    name: str
    type: type[Any]
    content: Any


def read_actions(
    returned: Any, policy: FunctionPolicy, resolve: Callable[[str], str], *, limits: Limits = LIMITS
) -> tuple[Action, ...]:
    """What a handler's answer asks for; none where it is no object with `publish` or `call`. Raises ActionError."""
    if not isinstance(returned, dict):
        return ()
    rows = [("publish", row) for row in _rows(returned, "publish")] + [("call", row) for row in _rows(returned, "call")]
    if len(rows) > limits.robot_actions:
        raise ActionError(f"{len(rows)} actions are asked for, at most {limits.robot_actions}")
    return tuple(_action(kind, row, policy, resolve) for kind, row in rows)


def _rows(returned: Mapping[str, Any], key: str) -> list[Any]:
    rows = returned.get(key, [])
    if not isinstance(rows, list):
        raise ActionError(f"{key}: a list is due")
    return rows


def _action(kind: str, row: Any, policy: FunctionPolicy, resolve: Callable[[str], str]) -> Action:
    name_key, content_key = ("topic", "message") if kind == "publish" else ("service", "request")
    if not isinstance(row, dict) or not isinstance(row.get(name_key), str) or not isinstance(row.get("type"), str):
        raise ActionError(f"{kind}: an object with {name_key}, type and {content_key} is due")
    try:
        name = resolve(row[name_key])
        cls = message_class(row["type"])
        if (part := cls if kind == "publish" else getattr(cls, "Request", None)) is None:
            raise ActionError(f"{row['type'][:80]} is no type of a service")
        content = from_json(part, row.get(content_key, {}))
    except ActionError:
        raise
    except MetarosError as error:
        raise ActionError(f"{kind} {row[name_key][:80]}: {error}") from error
    if objection := policy.objection(name):
        raise ActionError(f"{kind}: {objection}")
    return Action(kind="publish" if kind == "publish" else "call", name=name, type=cls, content=content)


class ActionExecutor:
    """Does them; blocks, so it belongs into a thread, one call at a time."""

    def __init__(self, node: Node, *, limits: Limits = LIMITS) -> None:
        self._node, self._limits = node, limits
        self._publishers: dict[tuple[str, type[Any]], Publisher] = {}
        self._clients: dict[tuple[str, type[Any]], Client] = {}

    def do(self, action: Action) -> dict[str, Any]:
        """One action; what goes into the result. Raises MetarosError where it could not be done now."""
        said: dict[str, Any] = {"kind": action.kind, "name": action.name}
        if action.kind == "publish":
            self._publisher(action).publish(action.content)
            return said
        client = self._client(action)
        client.wait_for_service(min(5.0, self._limits.robot_call_s))
        return {**said, "response": to_json(client.call(action.content, self._limits.robot_call_s))}

    def _publisher(self, action: Action) -> Publisher:
        key = (action.name, action.type)
        found = self._publishers.get(key)
        if found is None:
            found = self._publishers[key] = self._node.create_publisher(action.type, action.name)
            _keep_newest(self._publishers)
            # Zenoh keeps back what nobody is known to want: whoever subscribes is known in a moment.
            self._node.graph.wait_for(lambda: bool(self._node.graph.endpoints(action.name, "MS")), SETTLE_S)
        return found

    def _client(self, action: Action) -> Client:
        key = (action.name, action.type)
        found = self._clients.get(key)
        if found is None:
            found = self._clients[key] = self._node.create_client(action.type, action.name)
            _keep_newest(self._clients)
        return found


def _keep_newest(kept: dict[tuple[str, type[Any]], Any]) -> None:
    if len(kept) > KEPT:
        kept.pop(next(iter(kept))).close()
