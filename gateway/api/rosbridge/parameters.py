"""Parameters of robots' nodes as rosapi names them: `/node:parameter`, with values as JSON texts."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson

from gateway.api.robot_access import ResolvedName, RobotAccess
from gateway.api.rosbridge.client_graph import ClientGraph
from gateway.domain.fleet.parameter import plain
from gateway.errors import InvalidRequestError, RobotError
from metaros.limits import LIMITS

__all__ = ["Parameters"]

AT_ONCE = 4  # nodes that are asked for their names at a time
MOST_NODES = 256


class Parameters:
    """Of one client's robots."""

    def __init__(self, access: RobotAccess, client_graph: ClientGraph) -> None:
        self._access = access
        self._client_graph = client_graph

    async def names(self) -> list[str]:
        """Every parameter of every node; a node that gives no answer is left out."""
        limit, nodes = asyncio.Semaphore(AT_ONCE), self._client_graph.parameter_nodes()[:MOST_NODES]

        async def of(shown: str, resolved: ResolvedName) -> list[str]:
            async with limit:
                try:
                    listed = await self._ask(
                        resolved, "ListParameters", "list_parameters", {"depth": 0, "prefixes": []}
                    )
                except RobotError:
                    return []
                return [f"{shown}:{name}" for name in listed["result"]["names"]]

        found = await asyncio.gather(*(of(shown, resolved) for shown, resolved in nodes))
        return sorted(name for names in found for name in names)

    async def get(self, full: str) -> tuple[bool, Any]:
        """Whether there is such a parameter, and its value as JSON.

        Raises:
            InvalidRequestError: the name is not of the form /node:parameter.
            RobotError: the robot or the node gives no answer.
        """
        resolved, name = self._resolve(full)
        answer = await self._ask(resolved, "GetParameters", "get_parameters", {"names": [name]})
        kind, value = plain(answer["values"][0]) if answer["values"] else ("not_set", None)
        return kind != "not_set", value

    async def set(self, full: str, text: str) -> tuple[bool, str]:
        """Set one to a JSON text; whether the node took it, and why not. "" takes it away."""
        _, name = self._resolve(full)
        try:
            value = orjson.loads(text) if text else None
        except orjson.JSONDecodeError as error:
            raise InvalidRequestError(f"value is a JSON text: {error}") from None
        (result,) = await self._access.set_parameters(full.rpartition(":")[0], {name: value})
        return result.successful, result.reason

    def _resolve(self, full: str) -> tuple[ResolvedName, str]:
        node, colon, name = full.rpartition(":")
        if not colon or not node or not name or "\0" in name or len(name) > LIMITS.ros_name_chars:
            raise InvalidRequestError(f"a parameter's name is /node:parameter, not {full[:80]!r}")
        candidates = self._access.candidates(node)
        known = {resolved for _, resolved in self._client_graph.parameter_nodes()}
        return next((resolved for resolved in candidates if resolved in known), candidates[0]), name

    async def _ask(self, resolved: ResolvedName, kind: str, service: str, request: dict[str, Any]) -> Any:
        self._access.require("nodes.read", resolved.robot)
        return await self._access.services.fleet.call(
            resolved.robot,
            f"{resolved.name}/{service}",
            type_name=f"rcl_interfaces/srv/{kind}",
            request=request,
            timeout_s=LIMITS.node_call_s,
            look=True,
        )
