"""`metaros graph`: who talks to whom, and who cannot."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from typing import Annotated

import typer

from metaros.cli.options import DEFAULT_ZENOH_PORT, Domain, SpinTime, ZenohPort

__all__ = ["register"]


class GraphFormat(StrEnum):
    """How the graph is printed."""

    TEXT = "text"
    JSON = "json"
    DOT = "dot"


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("graph")(graph)


def graph(
    word: Annotated[str, typer.Argument(metavar="WORD", help="Only what has to do with names that contain this.")] = "",
    everything: Annotated[
        bool, typer.Option("--all", "-a", help="Also what every node has: /rosout, parameter services, hidden names.")
    ] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    output: Annotated[
        GraphFormat,
        typer.Option("--output", "-o", metavar="text|json|dot", help="A tree, a document, or graphviz's language."),
    ] = GraphFormat.TEXT,
) -> None:
    """Show nodes, what they publish and serve, and who reads it; what does not match is marked with the reason."""
    from metaros.cli.connection import closest, look
    from metaros.cli.graph_model import draw, restrict
    from metaros.cli.graph_text import dot, summary, tree
    from metaros.cli.options import Format
    from metaros.cli.output import Output
    from metaros.errors import UnavailableError

    out = Output(Format.JSON if output is GraphFormat.JSON else Format.TEXT)
    with look(zenoh_port, domain, spin_time=spin_time) as found:
        whole = draw([node.full_name for node in found.nodes()], found.tokens(), everything=everything)
    picture = restrict(whole, word) if word else whole
    if word and not picture.nodes:
        names = [*whole.nodes, *(link.name for link in whole.links)]
        raise UnavailableError(f"no name in the graph contains {word!r}\n{closest(word, names) or 'try --all'}")
    if output is GraphFormat.JSON:
        out.objects(asdict(picture))
    elif output is GraphFormat.DOT:
        out.line("\n".join(dot(picture)))
    elif not picture.nodes:
        out.note("no nodes: start one, or `metaros up`")
    else:
        out.line("\n".join(tree(picture, out.style)))
        out.line(f"\n{summary(picture, out.style)}")
