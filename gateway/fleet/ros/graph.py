"""A robot's part of the ROS graph, as its agent reports it: nodes, who publishes and subscribes, services, actions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from metaros.errors import MetarosError
from metaros.idl import Catalogue, schema_text
from metaros.idl.known import catalogue_of

__all__ = ["ActionInfo", "Endpoint", "RobotGraph", "ServiceInfo"]

SEND_GOAL: Final = "_SendGoal"  # a robot tells an action under the name and hash of this service of it


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscription, service server or client. `node` is "" where it is none of the robot's."""

    node: str
    type_name: str
    type_hash: str
    qos: str


@dataclass(frozen=True, slots=True)
class ServiceInfo:
    """A service of the robot, with the type of its first server, or of its first client while there is none."""

    type_name: str
    type_hash: str
    servers: tuple[Endpoint, ...]
    clients: tuple[Endpoint, ...]

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes that serve it."""
        return tuple(server.node for server in self.servers)


@dataclass(frozen=True, slots=True)
class ActionInfo:
    """An action of the robot; `type_hash` is that of its X_SendGoal service."""

    type_name: str
    type_hash: str
    servers: tuple[str, ...]
    clients: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotGraph:
    """How the graph stood at one moment. Topics and services of actions (`X/_action/…`) are under `actions` alone."""

    robot: str
    revision: int = 0
    nodes: tuple[str, ...] = ()
    publishers: Mapping[str, tuple[Endpoint, ...]] = field(default_factory=dict)
    subscribers: Mapping[str, tuple[Endpoint, ...]] = field(default_factory=dict)
    services: Mapping[str, ServiceInfo] = field(default_factory=dict)
    actions: Mapping[str, ActionInfo] = field(default_factory=dict)
    left_out: int = 0
    types: Mapping[tuple[str, str], Catalogue] = field(default_factory=dict, repr=False)

    def catalogue_of(self, type_name: str, type_hash: str = "") -> Catalogue | None:
        """Where that type is defined: the catalogue that everybody has, or what the robot's nodes told; else None."""
        found = self.types.get((type_name, type_hash))
        return found if found is not None else catalogue_of(type_name, type_hash)

    def told(self, type_name: str) -> Catalogue | None:
        """Where a message, service or action is defined as the robot's nodes told it last; None where they did not."""
        named = f"{type_name}{SEND_GOAL}" if "/action/" in type_name and SEND_GOAL not in type_name else type_name
        return next((self.types[key] for key in reversed(list(self.types)) if key[0] == named), None)

    def schema(self, type_name: str, type_hash: str = "") -> str:
        """The ros2msg text of a message, or of a part such as `X_Request` (with X's hash); "" where it is not known.

        The hash that goes with parts of an action, such as `X_Goal`, is that of `X_SendGoal`.
        """
        root, _, part = type_name.rpartition("_")
        whole = root if part in ("Request", "Response") else type_name
        if part in ("Goal", "Result", "Feedback"):
            whole = f"{root}{SEND_GOAL}"
        catalogue = self.catalogue_of(whole, type_hash)
        try:
            return schema_text(type_name, catalogue) if catalogue is not None else ""
        except MetarosError:  # a whole service or action has none
            return ""

    @property
    def topics(self) -> list[str]:
        """Every topic that somebody publishes or subscribes, by name."""
        return sorted({*self.publishers, *self.subscribers})
