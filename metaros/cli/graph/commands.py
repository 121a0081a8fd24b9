"""`metaros graph`: who talks to whom, and who cannot; as a tree, a document or a drawing."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from metaros.cli.shared.gateway_http import GatewayOption
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, RobotOption, SpinTime, ZenohPort
from metaros.concurrency.waiting import pause

if TYPE_CHECKING:
    from metaros.cli.graph.model import GraphModel
    from metaros.cli.shared.output import Output
    from metaros.cli.shared.topic_rates import TopicRates
    from metaros.wire import WireSession

__all__ = ["register"]

STDOUT = "-"


class GraphFormat(StrEnum):
    """How the graph is printed."""

    TEXT = "text"
    JSON = "json"
    DOT = "dot"
    MERMAID = "mermaid"


class GraphCommand(TyperCommand):
    """`--svg` may stand without a file: then the drawing goes to stdout."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give a bare `--svg` its value."""
        full = []
        for argument, following in zip(args, [*args[1:], "--"], strict=True):
            full.append(argument)
            if argument == "--svg" and (following.startswith("-") and following != STDOUT):
                full.append(STDOUT)
        return super().parse_args(ctx, full)


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("graph", cls=GraphCommand)(graph)


def graph(
    word: Annotated[str, typer.Argument(metavar="WORD", help="Only what has to do with names that contain this.")] = "",
    everything: Annotated[
        bool, typer.Option("--all", "-a", help="Also what every node has: /rosout, parameter services, hidden names.")
    ] = False,
    svg: Annotated[
        str, typer.Option("--svg", metavar="[FILE]", help="Draw it, with rates: to a file, or to stdout.")
    ] = "",
    services: Annotated[
        bool, typer.Option("--services", help="In the drawing also services that nobody calls.")
    ] = False,
    measure: Annotated[
        float,
        typer.Option("--measure", min=0.0, max=60.0, metavar="SECONDS", help="How long, for the drawing's rates."),
    ] = 2.0,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    robot: RobotOption = "",
    gateway: GatewayOption = "",
    output: Annotated[
        GraphFormat,
        typer.Option(
            "--output",
            "-o",
            metavar="text|json|dot|mermaid",
            help="A tree, a document, graphviz's or Mermaid's language.",
        ),
    ] = GraphFormat.TEXT,
) -> None:
    """Show nodes, what they publish and serve, and who reads it; what does not match is marked with the reason."""
    from metaros.cli.shared.options import Format
    from metaros.cli.shared.output import Output

    _check_svg(svg)
    out = Output(Format.JSON if output is GraphFormat.JSON else Format.TEXT)
    seconds = measure if svg else 0.0
    if robot:
        whole, rates = _remote(robot, gateway, everything=everything)
    else:
        whole, rates = _here(zenoh_port, domain, spin_time, seconds, everything=everything)
    picture = _part(whole, word)
    if svg:
        picture = picture if services or everything else picture.without_idle_services()
        _draw(out, picture, rates if seconds else None, svg, f"robot {robot}" if robot else f"domain {domain}")
    else:
        _print(out, picture, output)


def _here(
    zenoh_port: int, domain: int, spin_time: float, seconds: float, *, everything: bool
) -> tuple[GraphModel, dict[str, TopicRates]]:
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.shared.connection import open_graph_and_session

    with open_graph_and_session(zenoh_port, domain, spin_time=spin_time) as (session, found):
        rates = _rates(session, seconds) if seconds else {}
        return build_graph_model(
            [node.full_name for node in found.nodes()], found.tokens(), everything=everything
        ), rates


def _remote(robot: str, gateway: str, *, everything: bool) -> tuple[GraphModel, dict[str, TopicRates]]:
    """The graph and the rates that the robot's agent has reported."""
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.cli.remote.robot import RemoteRobot

    place = RemoteRobot(robot, gateway)
    found = RemoteGraph(place.graph())
    return build_graph_model(
        [node.full_name for node in found.nodes()], found.tokens(), everything=everything
    ), place.rates()


def _check_svg(file: str) -> None:
    from metaros.errors import UsageError

    if file and file != STDOUT and not file.endswith(".svg"):
        raise UsageError(f"{file!r} does not end in .svg\nfor a WORD write: metaros graph {file} --svg")
    if file and file != STDOUT and not Path(file).absolute().parent.is_dir():
        raise UsageError(f"there is no directory {Path(file).absolute().parent}")


def _rates(session: WireSession, seconds: float) -> dict[str, TopicRates]:
    from metaros.cli.shared.topic_rates import RateMeter, TopicCounter
    from metaros.clock import SystemClock

    counts, meter, clock = TopicCounter(session), RateMeter(), SystemClock()
    try:
        meter.look(clock.monotonic_s(), {})
        pause(seconds)
        return meter.look(clock.monotonic_s(), counts.by_topic())
    finally:
        counts.close()


def _part(whole: GraphModel, word: str) -> GraphModel:
    from metaros.cli.graph.model import restrict
    from metaros.cli.shared.connection import closest
    from metaros.errors import UnavailableError

    picture = restrict(whole, word) if word else whole
    if word and not picture.nodes:
        names = [*whole.nodes, *(link.name for link in whole.links)]
        raise UnavailableError(f"no name in the graph contains {word!r}\n{closest(word, names) or 'try --all'}")
    return picture


def _draw(out: Output, picture: GraphModel, rates: dict[str, TopicRates] | None, file: str, where: str) -> None:
    from metaros.cli.graph.svg import svg
    from metaros.cli.graph.text import summary

    counts = summary(picture, lambda words, _: words).replace("  ", " · ")
    text = svg(picture, rates, heading=f"ROS graph\n{counts} · {where}")
    if file == STDOUT:
        out.line(text.rstrip("\n"))
    else:
        Path(file).write_text(text, encoding="utf-8")
        out.note(f"drawn: {file}")


def _print(out: Output, picture: GraphModel, output: GraphFormat) -> None:
    from metaros.cli.graph.text import dot, mermaid, summary, tree

    if output is GraphFormat.JSON:
        out.objects(asdict(picture))
    elif output is GraphFormat.DOT:
        out.line("\n".join(dot(picture)))
    elif output is GraphFormat.MERMAID:
        out.line("\n".join(mermaid(picture)))
    elif not picture.nodes:
        out.note("no nodes: start one, or `metaros up`")
    else:
        out.line("\n".join(tree(picture, out.style)))
        out.line(f"\n{summary(picture, out.style)}")
