"""What every command takes that looks at the graph: where that is, how long to look, and how to print.

    @group.command("type")
    @visiting
    def type_(at: Visit, topic: TopicArgument) -> None:
        with at.look() as graph:
            at.out.names(...)

has the options of `OPTIONS` besides its own argument. With `--robot ID` the graph is that of a robot elsewhere, as its
gateway tells it: the command says the same of either.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.gateway_http import GatewayOption
from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, RobotOption, SpinTime, ZenohPort
from metaros.cli.output import Output
from metaros.errors import UsageError

if TYPE_CHECKING:
    from metaros.cli.afar.graph import FarGraph
    from metaros.cli.afar.node import FarNode
    from metaros.cli.afar.place import RobotPlace
    from metaros.cli.listen import Listener
    from metaros.node import Context, Node
    from metaros.wire import Graph

__all__ = ["OPTIONS", "Visit", "visiting"]

OPTIONS: tuple[tuple[str, Any, Any], ...] = (
    ("zenoh_port", ZenohPort, DEFAULT_ZENOH_PORT),
    ("domain", Domain, 0),
    ("spin_time", SpinTime, 1.0),
    ("robot", RobotOption, ""),
    ("gateway", GatewayOption, ""),
    ("output", FormatOption, Format.TEXT),
)


@dataclass(frozen=True, slots=True)
class Visit:
    """One command's way to the graph, and its standard output."""

    zenoh_port: int
    domain: int
    spin_time: float
    out: Output
    place: RobotPlace | None = None  # the robot that is meant; None: this machine's graph

    def look(self) -> AbstractContextManager[Graph | FarGraph]:
        """The graph alone, settled: for commands that only look."""
        if self.place is not None:
            from metaros.cli.afar.graph import FarGraph

            return nullcontext(FarGraph(self.place.graph()))
        from metaros.cli.connection import look

        return look(self.zenoh_port, self.domain, spin_time=self.spin_time)

    def connect(self) -> AbstractContextManager[Context]:
        """A context whose graph has settled; UsageError for what cannot be done from afar."""
        if self.place is not None:
            raise UsageError("this needs the graph of this machine: leave --robot out")
        from metaros.cli.connection import connect

        return connect(self.zenoh_port, self.domain, spin_time=self.spin_time)

    @contextmanager
    def node(self) -> Iterator[Node | FarNode]:
        """A short-lived node that calls services, in a graph that has settled."""
        if self.place is not None:
            from metaros.cli.afar.node import FarNode

            yield FarNode(self.place)
            return
        from metaros.node import Node

        with self.connect() as context:
            with Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False) as own:
                yield own

    def listen(self, topic: str, type_name: str = "", *, raw: bool = False) -> Listener:
        """A topic's messages as they come; `raw`: only their bytes matter."""
        from metaros.cli.listen import GraphSource, Listener, Source

        source: Source
        if self.place is not None:
            from metaros.cli.afar.listen import FarSource

            source = FarSource(self.place, topic, type_name, raw=raw)
        else:
            where = {"zenoh_port": self.zenoh_port, "domain": self.domain}
            source = GraphSource(topic, type_name, **where, spin_time=self.spin_time, raw=raw)
        return Listener(source)

    def absolute(self, name: str) -> str:
        """A name as typed, from the root; of a robot elsewhere a relative one lies in its namespace."""
        if self.place is not None:
            return self.place.absolute(name)
        from metaros.cli.connection import absolute

        return absolute(name)


def visiting(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer: its own parameters, then the options that make the `Visit` it gets first."""
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
        place = _place(asked["robot"], asked["gateway"])
        at = Visit(said["zenoh_port"], said["domain"], said["spin_time"], Output(said["output"]), place)
        command(at, **given)

    visit.__signature__ = signature.replace(parameters=[*own, *shared])  # type: ignore[attr-defined]
    # typer asks for the hints, too
    visit.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, *shared)} | {"return": None}
    return visit


def _place(robot: str, gateway: str) -> RobotPlace | None:
    if not robot:
        return None
    from metaros.cli.afar.place import RobotPlace

    return RobotPlace(robot, gateway)
