"""Parameters of robots' nodes under the names that Foxglove users see: `/node.parameter`."""

from __future__ import annotations

import asyncio
import base64
import binascii
from collections.abc import Iterable, Sequence
from typing import Any

from gateway.api.foxglove.requests import Parameter
from gateway.api.robot_access import RobotAccess
from gateway.errors import InvalidRequestError
from metaros.errors import MetarosError

__all__ = ["Values", "shown_value", "split_name", "wanted_value"]

NODES = 64  # of which all parameters are told at once; with more of them, a client has to choose a robot
AT_ONCE = 8
_LIST = "/list_parameters"


class Values:
    """Reads and sets parameters for one client."""

    def __init__(self, access: RobotAccess) -> None:
        self._access = access

    def nodes(self) -> list[str]:
        """The shown names of nodes that have parameters, as far as their robots told; of online robots only."""
        online = {record.robot.id for record in self._access.robots() if record.online}
        return [
            self._access.names.shown(graph.robot, name.removesuffix(_LIST))
            for graph in self._access.graphs()
            if graph.robot in online
            for name, info in graph.services.items()
            if name.endswith(_LIST) and info.servers
        ]

    async def read(self, names: Sequence[str]) -> list[Parameter]:
        """The parameters of those names that there are; no names: all. What cannot be asked now is left out.

        Raises:
            InvalidRequestError: all are asked for, of more nodes than can be asked.
        """
        if names:
            nodes = sorted({node for node, _ in map(split_name, names) if node})
            wanted = set(names)
        else:
            nodes, wanted = self.nodes(), set()
        if len(nodes) > NODES:
            raise InvalidRequestError(f"{len(nodes)} nodes have parameters, at most {NODES} are asked: choose a robot")
        limit = asyncio.Semaphore(AT_ONCE)
        found = await asyncio.gather(*(self._of_node(node, limit) for node in nodes))
        return [item for some in found for item in some if not wanted or item.name in wanted]

    async def write(self, parameters: Iterable[Parameter]) -> list[str]:
        """Set them, node by node; returns why some were not."""
        by_node: dict[str, dict[str, Any]] = {}
        faults = []
        for item in parameters:
            node, name = split_name(item.name)
            try:
                by_node.setdefault(node, {})[name] = wanted_value(item)
            except InvalidRequestError as error:
                faults.append(str(error))
        for node, values in by_node.items():
            try:
                results = await self._access.set_parameters(node, values)
            except MetarosError as error:
                faults.append(f"{node or 'a name without a node'}: {error}")
            else:
                faults += [f"{node}.{item.name}: {item.reason}" for item in results if not item.successful]
        return faults

    async def _of_node(self, node: str, limit: asyncio.Semaphore) -> list[Parameter]:
        async with limit:
            try:
                found = await self._access.parameters(node)
            except MetarosError:
                return []
        return [shown_value(f"{node}.{item.rules.name}", item.kind, item.value) for item in found]


def split_name(shown: str) -> tuple[str, str]:
    """(node, parameter) of a shown name; a parameter's own name may have dots, a node's has none."""
    node, _, name = shown.partition(".")
    return (node, name) if name else ("", shown)


def shown_value(name: str, kind: str, value: Any) -> Parameter:
    """A value of a ROS parameter's kind as Foxglove has it."""
    if kind == "double":
        return Parameter(name, value, "float64")
    if kind == "double_array":
        return Parameter(name, value, "float64_array")
    if kind == "byte_array" and isinstance(value, list):
        return Parameter(name, base64.b64encode(bytes(value)).decode(), "byte_array")
    return Parameter(name, value)


def wanted_value(item: Parameter) -> Any:
    """A value that a client sets, as the node's own rules read it."""
    if item.type == "byte_array" and item.value is not None:
        try:
            return list(base64.b64decode(str(item.value), validate=True))
        except (binascii.Error, ValueError):
            raise InvalidRequestError(f"{item.name}: a byte_array is base64") from None
    if item.type == "float64" and isinstance(item.value, int) and not isinstance(item.value, bool):
        return float(item.value)
    return item.value
