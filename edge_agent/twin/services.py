"""A robot's other nodes as the twin needs them: which are there, their parameters, their lifecycle."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Protocol

from edge_agent.forwarding.scope import Scope
from metaros.idl import message_class
from metaros.node import Node
from metaros.node.parameters import ParameterClient, SetResult

__all__ = ["NodeServices", "RosServices"]

TIMEOUT_S: Final = 5.0
LIFE_SERVICES: Final = ("set_parameters", "get_state")


class NodeServices(Protocol):
    """What is asked of the nodes. Every coroutine may raise a MetarosError: the node is gone, or does not answer."""

    def lives(self) -> dict[str, str]:
        """The nodes in the robot's scope by full name; the text is another one after a node was started again."""

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back, from any thread, when nodes come or go; returns how to stop that."""

    async def get(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        """Values by name; None for what is not declared."""

    async def set(self, node: str, values: Mapping[str, Any]) -> Mapping[str, SetResult]:
        """Set each for itself; None takes one away."""

    async def state(self, node: str) -> str:
        """The label of the node's lifecycle state."""

    async def change(self, node: str, transition: int) -> bool:
        """Ask for a transition; whether it was taken."""


class RosServices:
    """The same over the agent's own node."""

    def __init__(self, node: Node, scope: Scope) -> None:
        self._node = node
        self._scope = scope

    def lives(self) -> dict[str, str]:
        """See NodeServices."""
        found: dict[str, str] = {}
        for endpoint in self._node.graph.endpoints(kind="SS"):
            owner = endpoint.node_full_name
            if endpoint.topic.removeprefix(f"{owner}/") in LIFE_SERVICES and self._scope.includes(owner):
                found[owner] = max(found.get(owner, ""), endpoint.gid.hex())
        return found

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """See NodeServices."""
        return self._node.graph.on_change(callback)

    async def get(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        """See NodeServices; name by name, as some nodes answer nothing at all where one is unknown."""
        client = ParameterClient(self._node, node)
        with contextlib.closing(client):
            found = dict(await client.get_async(names, timeout_s=TIMEOUT_S)) if names else {}
            if len(names) > 1 and all(value is None for value in found.values()):
                for name in names:
                    found.update(await client.get_async([name], timeout_s=TIMEOUT_S))
            return found

    async def set(self, node: str, values: Mapping[str, Any]) -> Mapping[str, SetResult]:
        """See NodeServices."""
        client = ParameterClient(self._node, node)
        with contextlib.closing(client):
            return await client.set_async(values, timeout_s=TIMEOUT_S)

    async def state(self, node: str) -> str:
        """See NodeServices."""
        return str((await self._call(node, "GetState", "get_state", {})).current_state.label)

    async def change(self, node: str, transition: int) -> bool:
        """See NodeServices."""
        wanted = message_class("lifecycle_msgs/msg/Transition")(id=transition)
        return bool((await self._call(node, "ChangeState", "change_state", {"transition": wanted})).success)

    async def _call(self, node: str, kind: str, name: str, request: Mapping[str, Any]) -> Any:
        service = message_class(f"lifecycle_msgs/srv/{kind}")
        client = self._node.create_client(service, f"{node}/{name}")
        with contextlib.closing(client):
            return await client.call_async(service.Request(**request), TIMEOUT_S)
