"""What every command takes that looks at the graph: where that is, how long to look, and how to print.

    @group.command("type")
    @visiting
    def type_(at: Visit, topic: TopicArgument) -> None:
        with at.look() as graph:
            at.out.names(...)

has the four options of `OPTIONS` besides its own argument.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, SpinTime, ZenohPort
from metaros.cli.output import Output

if TYPE_CHECKING:
    from metaros.node import Context
    from metaros.wire import Graph

__all__ = ["OPTIONS", "Visit", "visiting"]

OPTIONS: tuple[tuple[str, Any, Any], ...] = (
    ("zenoh_port", ZenohPort, DEFAULT_ZENOH_PORT),
    ("domain", Domain, 0),
    ("spin_time", SpinTime, 1.0),
    ("output", FormatOption, Format.TEXT),
)


@dataclass(frozen=True, slots=True)
class Visit:
    """One command's way to the graph, and its standard output."""

    zenoh_port: int
    domain: int
    spin_time: float
    out: Output

    def look(self) -> AbstractContextManager[Graph]:
        """The graph alone, settled: for commands that only look."""
        from metaros.cli.connection import look

        return look(self.zenoh_port, self.domain, spin_time=self.spin_time)

    def connect(self) -> AbstractContextManager[Context]:
        """A context whose graph has settled."""
        from metaros.cli.connection import connect

        return connect(self.zenoh_port, self.domain, spin_time=self.spin_time)


def visiting(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer: its own parameters, then the options that make the `Visit` it gets first."""
    signature = inspect.signature(command, eval_str=True)
    own = [parameter.replace(kind=parameter.KEYWORD_ONLY) for parameter in list(signature.parameters.values())[1:]]
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, annotation, default in OPTIONS
    ]

    @functools.wraps(command)
    def visit(**given: Any) -> None:
        zenoh_port, domain, spin_time, output = (given.pop(name) for name, _, _ in OPTIONS)
        command(Visit(zenoh_port, domain, spin_time, Output(output)), **given)

    visit.__signature__ = signature.replace(parameters=[*own, *shared])  # type: ignore[attr-defined]
    # typer asks for the hints, too
    visit.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, *shared)} | {"return": None}
    return visit
