"""The part of a node's API that commands need for a remote robot: service calls over the gateway."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from metaros.cli.remote.graph import RemoteGraph
from metaros.cli.remote.robot import RemoteRobot
from metaros.errors import RefusedError, TimeoutError_, UnavailableError

if TYPE_CHECKING:
    from metaros.node.parameters import ParameterClient

__all__ = ["RemoteClient", "RemoteNode"]


class RemoteNode:
    """What `metaros.Node` is to a command."""

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot
        self.graph = RemoteGraph(robot.graph())

    def resolve(self, name: str) -> str:
        """A name from the root."""
        return self._robot.absolute(name)

    def fetch_interface(self, type_name: str, type_hash: str = "", *, timeout_s: float = 5.0) -> Any:
        """The class of a type as the robot has it, see `metaros.Node.fetch_interface`; the gateway answers at once."""
        from metaros.cli.remote.interfaces import find_remote_interface
        from metaros.idl import message_class

        return message_class(type_name, find_remote_interface(self._robot, type_name, type_hash)[0])

    def create_client(self, service_type: Any, name: str, qos: object = None) -> RemoteClient:
        """A client of a service of the robot; the profile is the agent's business."""
        return RemoteClient(self._robot, self.graph, service_type, self.resolve(name))

    def create_parameter_client(self, target: str) -> ParameterClient:
        """Another node's parameters."""
        from metaros.node.parameters import ParameterClient

        return ParameterClient(self, target)  # type: ignore[arg-type]  # it calls services and looks, no more


class RemoteClient:
    """Calls one service."""

    def __init__(self, robot: RemoteRobot, graph: RemoteGraph, service_type: Any, name: str) -> None:
        self.service_type = service_type
        self._robot = robot
        self._graph = graph
        self._name = name

    def wait_for_service(self, timeout_s: float | None = None) -> bool:
        """Whether somebody serves it."""
        return bool(self._graph.endpoints(self._name, "SS"))

    def call(self, request: Any, *, timeout_s: float = 10.0) -> Any:
        """The response.

        Raises:
            UnavailableError: nobody serves it, or the robot is not there.
            TimeoutError_: no answer in time.
            RefusedError: the gateway says why not.
        """
        from metaros.idl.json import from_json, to_json

        body = {
            "service": self._name,
            "type": self.service_type.__metaros_name__,
            "request": to_json(request),
            "timeout_s": timeout_s,
        }
        try:
            answer = self._robot.http.post(self._robot.path("services", "call"), body)
        except RefusedError as error:
            if error.reason in ("robot_offline", "service_unavailable"):
                raise UnavailableError(str(error)) from error
            if error.reason in ("timeout", "command_timeout"):
                raise TimeoutError_(str(error)) from error
            raise
        return from_json(self.service_type.Response, answer["response"])

    def close(self) -> None:
        """Nothing is held."""
