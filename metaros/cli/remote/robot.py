"""A remote robot: its REST address at the gateway, and the namespace of its relative names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.gateway_http import GatewayClient, open_gateway, path_part

if TYPE_CHECKING:
    from metaros.cli.shared.topic_rates import TopicRates

__all__ = ["RemoteRobot"]


class RemoteRobot:
    """Sends no request before one is needed: a local command pays nothing for `--robot`."""

    def __init__(self, robot: str, gateway: str = "") -> None:
        """`gateway`: its address; "": the current context's, else the one that runs on this machine."""
        self.robot = robot
        self._gateway = gateway

    @cached_property
    def http(self) -> GatewayClient:
        """The gateway."""
        return open_gateway(self._gateway)

    @cached_property
    def namespace(self) -> str:
        """Of the robot's agent; RefusedError for a robot that is not there."""
        return str(self.http.get(self.path())["namespace"])

    def path(self, *parts: str) -> str:
        """The address of something of the robot's."""
        return "/".join(["/api/v1/robots", path_part(self.robot), *map(path_part, parts)])

    def absolute(self, name: str) -> str:
        """A name as typed, from the root; a relative one lies in the robot's namespace."""
        from metaros.idl import names

        namespace = "/" if name.startswith("/") else self.namespace
        return names.resolve(name, namespace=namespace, node="metaros_cli")

    def rates(self) -> dict[str, TopicRates]:
        """How often and how much is published on each topic, as the agent sees it on the robot."""
        from metaros.cli.shared.topic_rates import TopicRates

        topics = self.http.get(self.path("topics"))["topics"]
        return {item["topic"]: TopicRates(item["rate_hz"] or 0.0, item["bytes_per_s"] or 0.0) for item in topics}

    def graph(self) -> Mapping[str, Any]:
        """The robot's graph as REST returns it."""
        found: Mapping[str, Any] = self.http.get(self.path("graph"))
        return found
