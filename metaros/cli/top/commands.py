"""`metaros top`: nodes and topics with their rates, live."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

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
from metaros.concurrency.waiting import pause

if TYPE_CHECKING:
    from collections.abc import Callable

    from metaros.cli.shared.output import Output
    from metaros.cli.top.rows import Screenful

__all__ = ["register"]


class Sort(StrEnum):
    """What comes first."""

    NAME = "name"
    RATE = "rate"
    BANDWIDTH = "bandwidth"


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("top")(top)


def top(
    word: Annotated[str, typer.Argument(metavar="WORD", help="Only names that contain this.")] = "",
    once: Annotated[bool, typer.Option("--once", help="Measure for one interval, print, end.")] = False,
    interval: Annotated[
        float, typer.Option("--interval", min=0.1, max=60.0, metavar="SECONDS", help="Between two looks.")
    ] = 1.0,
    sort: Annotated[
        Sort, typer.Option("--sort", "-s", metavar="name|rate|bandwidth", help="Order of the topics.")
    ] = Sort.NAME,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    spin_time: SpinTime = 1.0,
    robot: RobotOption = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Show topics with rate, bandwidth, publishers and subscribers, nodes with the CPU of their process, and who drops.

    It receives what is published in the domain while it runs, and counts it. Of a robot elsewhere it shows what its
    agent counts; processes and drops stay there.
    """
    from metaros.cli.shared.output import Output

    out = Output(output)
    watch = _remote(robot, gateway, word, sort) if robot else _watch(zenoh_port, domain, spin_time, word, sort)
    with suppress(KeyboardInterrupt), watch as look:
        if once:
            pause(interval)
            screenful = look()
            out.objects(asdict(screenful)) if out.json else _print(out, screenful)
        elif out.json or not out.tty:
            while True:
                pause(interval)
                screenful = look()
                out.object_line(asdict(screenful)) if out.json else _print(out, screenful)
        else:
            from metaros.cli.top.screen import live

            live(look, lambda: pause(interval))


def _print(out: Output, screenful: Screenful) -> None:
    from metaros.cli.top.drops import DROP_COLUMNS, drop_cells
    from metaros.cli.top.screen import TOPIC_COLUMNS, node_cells, node_columns, summary, topic_cells

    out.table(TOPIC_COLUMNS, [topic_cells(row) for row in screenful.topics], right=(2, 3, 4, 5))
    out.line()
    columns = node_columns(screenful)
    out.table(columns, [node_cells(row)[: len(columns)] for row in screenful.nodes], right=range(1, len(columns)))
    if screenful.dropping:
        out.line()
        out.table(DROP_COLUMNS, [drop_cells(row) for row in screenful.dropping], right=range(2, len(DROP_COLUMNS)))
    out.note(f"\n{summary(screenful)}")


@contextmanager
def _remote(robot: str, gateway: str, word: str, sort: Sort) -> Iterator[Callable[[], Screenful]]:
    """The same for a remote robot."""
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.cli.remote.robot import RemoteRobot
    from metaros.cli.top.rows import Screenful, node_rows, topic_rows

    place = RemoteRobot(robot, gateway)

    def look() -> Screenful:
        graph = RemoteGraph(place.graph())
        ends = graph.endpoints()
        return Screenful(
            topic_rows(ends, place.rates(), word=word, sort=sort.value),
            node_rows(graph.nodes(), ends, {}, word=word),
            len(build_graph_model([], graph.tokens()).faults),
        )

    yield look


@contextmanager
def _watch(zenoh_port: int, domain: int, spin_time: float, word: str, sort: Sort) -> Iterator[Callable[[], Screenful]]:
    """A function that measures since it was last called."""
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.shared.connection import open_graph_and_session
    from metaros.cli.shared.topic_rates import RateMeter, TopicCounter
    from metaros.cli.top.drops import ask, drop_rows
    from metaros.cli.top.processes import Processes
    from metaros.cli.top.rows import Screenful, node_rows, topic_rows
    from metaros.clock import SystemClock

    with ExitStack() as stack:
        session, graph = stack.enter_context(open_graph_and_session(zenoh_port, domain, spin_time=spin_time))
        counts, meter, clock, processes = TopicCounter(session), RateMeter(), SystemClock(), Processes(session)
        stack.callback(counts.close)
        processes.look()  # the first look only starts the clocks of the CPU shares
        meter.look(clock.monotonic_s(), counts.by_topic())

        def look() -> Screenful:
            rates = meter.look(clock.monotonic_s(), counts.by_topic())
            ends, nodes, answers = graph.endpoints(), graph.nodes(), ask(session)
            return Screenful(
                topic_rows(ends, rates, word=word, sort=sort.value),
                node_rows(nodes, ends, processes.look(), word=word),
                len(build_graph_model([], graph.tokens()).faults),
                drop_rows(answers, word=word),
            )

        yield look
