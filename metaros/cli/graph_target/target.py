"""`GraphTarget`: the graph that a command reads, with the options that say which one, and its output.

    @group.command("type")
    @graph_command
    def type_(target: GraphTarget, topic: TopicArgument) -> None:
        with target.open_graph() as graph:
            target.out.names(...)

has the options of `OPTIONS` besides its own argument. With `--robot ID` the graph is that of a remote robot,
read from its gateway; the command prints the same for either.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.gateway_http import GatewayOption
from metaros.cli.shared.options import (
    DEFAULT_ZENOH_PORT,
    Domain,
    Format,
    FormatOption,
    RobotOption,
    SpinTime,
    ZenohPort,
)
from metaros.cli.shared.output import Output
from metaros.errors import UsageError

if TYPE_CHECKING:
    from metaros.cli.graph_target.listener import Listener
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.cli.remote.node import RemoteNode
    from metaros.cli.remote.robot import RemoteRobot
    from metaros.node import Context, Node
    from metaros.wire import Graph

__all__ = ["OPTIONS", "GraphTarget", "graph_command"]

OPTIONS: tuple[tuple[str, Any, Any], ...] = (
    ("zenoh_port", ZenohPort, DEFAULT_ZENOH_PORT),
    ("domain", Domain, 0),
    ("spin_time", SpinTime, 1.0),
    ("robot", RobotOption, ""),
    ("gateway", GatewayOption, ""),
    ("output", FormatOption, Format.TEXT),
)


@dataclass(frozen=True, slots=True)
class GraphTarget:
    """The local or remote graph that one command reads, and its standard output."""

    zenoh_port: int
    domain: int
    spin_time: float
    out: Output
    robot: RemoteRobot | None = None  # the robot that is meant; None: this machine's graph

    def open_graph(self) -> AbstractContextManager[Graph | RemoteGraph]:
        """The graph alone, settled: for commands that only look."""
        if self.robot is not None:
            from metaros.cli.remote.graph import RemoteGraph

            return nullcontext(RemoteGraph(self.robot.graph()))
        from metaros.cli.shared.connection import open_graph

        return open_graph(self.zenoh_port, self.domain, spin_time=self.spin_time)

    def connect(self) -> AbstractContextManager[Context]:
        """A context whose graph has settled; UsageError for a remote robot."""
        if self.robot is not None:
            raise UsageError("this needs the graph of this machine: leave --robot out")
        from metaros.cli.shared.connection import connect

        return connect(self.zenoh_port, self.domain, spin_time=self.spin_time)

    @contextmanager
    def node(self) -> Iterator[Node | RemoteNode]:
        """A short-lived node that calls services, in a graph that has settled."""
        if self.robot is not None:
            from metaros.cli.remote.node import RemoteNode

            yield RemoteNode(self.robot)
            return
        from metaros.node import Node

        with self.connect() as context:
            with Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False) as own:
                yield own

    def listen(self, topic: str, type_name: str = "", *, raw: bool = False) -> Listener:
        """A topic's messages as they come; `raw`: only their bytes matter."""
        from metaros.cli.graph_target.listener import Listener, LocalTopicSource, TopicSource

        source: TopicSource
        if self.robot is not None:
            from metaros.cli.remote.topic_source import RemoteTopicSource

            source = RemoteTopicSource(self.robot, topic, type_name, raw=raw)
        else:
            where = {"zenoh_port": self.zenoh_port, "domain": self.domain}
            source = LocalTopicSource(topic, type_name, **where, spin_time=self.spin_time, raw=raw)
        return Listener(source)

    def absolute(self, name: str) -> str:
        """A name as typed, from the root; of a remote robot a relative one lies in its namespace."""
        if self.robot is not None:
            return self.robot.absolute(name)
        from metaros.cli.shared.connection import absolute

        return absolute(name)


def graph_command(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer: its own parameters, then the options that make the `GraphTarget` it gets first."""
    signature = inspect.signature(command, eval_str=True)
    own = [parameter.replace(kind=parameter.KEYWORD_ONLY) for parameter in list(signature.parameters.values())[1:]]
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, annotation, default in OPTIONS
        if name not in signature.parameters
    ]

    @functools.wraps(command)
    def visit(**given: Any) -> None:
        said = {parameter.name: given.pop(parameter.name) for parameter in shared}
        asked = {**given, **said}  # a command may have its own words for --robot
        robot = _robot(asked["robot"], asked["gateway"])
        target = GraphTarget(said["zenoh_port"], said["domain"], said["spin_time"], Output(said["output"]), robot)
        command(target, **given)

    visit.__signature__ = signature.replace(parameters=[*own, *shared])  # type: ignore[attr-defined]
    # typer asks for the hints, too
    visit.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, *shared)} | {"return": None}
    return visit


def _robot(robot: str, gateway: str) -> RemoteRobot | None:
    if not robot:
        return None
    from metaros.cli.remote.robot import RemoteRobot

    return RemoteRobot(robot, gateway)
