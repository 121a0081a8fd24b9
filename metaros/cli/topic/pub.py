"""`metaros topic pub`: publish values typed on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.shared.gateway_http import GatewayOption
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, RobotOption, ZenohPort
from metaros.concurrency.waiting import pause

if TYPE_CHECKING:
    from collections.abc import Callable

    from metaros.cli.remote.robot import RemoteRobot
    from metaros.cli.shared.output import Output
    from metaros.node import Context, Node

__all__ = ["pub"]

_ASK_S = 2.0  # for each node that is asked what its type is
_SETTLE_S = 1.0  # for the router to say who is there


def pub(
    topic: Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/cmd_vel.")],
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="std_msgs/msg/String, or std_msgs/String.")],
    values: Annotated[str, typer.Argument(metavar="YAML", help="Fields; what is left out keeps its default.")] = "",
    rate: Annotated[float, typer.Option("--rate", "-r", min=0.001, metavar="HZ", help="Messages a second.")] = 1.0,
    once: Annotated[bool, typer.Option("--once", "-1", help="Publish one message and end.")] = False,
    times: Annotated[
        int,
        typer.Option("-n", "--times", "-t", min=0, metavar="N", show_default=False, help="End after so many messages."),
    ] = 0,
    wait: Annotated[
        int | None,
        typer.Option(
            "--wait-matching-subscriptions", "-w", min=0, metavar="N", help="Wait for so many subscribers first."
        ),
    ] = None,
    wait_timeout: Annotated[
        float, typer.Option("--max-wait-time-secs", min=0.0, metavar="SECONDS", help="Publish anyway after so long.")
    ] = 3.0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Do not print what is published.")] = False,
    lease: Annotated[
        str,
        typer.Option("--lease", metavar="ID", show_default=False, help="With --robot, for what moves it."),
    ] = "",
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    robot: RobotOption = "",
    gateway: GatewayOption = "",
) -> None:
    """Publish to a topic; `--once` waits for a subscriber, so that the one message is heard."""
    from metaros.cli.remote.interfaces import find_remote_interface
    from metaros.cli.remote.robot import RemoteRobot
    from metaros.cli.shared.connection import absolute, connect
    from metaros.cli.shared.output import Output
    from metaros.cli.shared.types import expand
    from metaros.idl import default_catalogue, message_class
    from metaros.node import Node

    out, full = Output(), expand(type_name)
    kind = message_class(full) if full in default_catalogue() else None
    message = None if kind is None else _message(kind, values)  # what is wrong is said before anything is opened
    if robot:
        place = RemoteRobot(robot, gateway)
        if kind is None:
            kind = message_class(full, find_remote_interface(place, full)[0])
        message, send = _message(kind, values) if message is None else message, _remote(place, topic, kind, lease)
        _publish(send, message, out, rate=rate, times=1 if once else times, quiet=quiet)
        return
    name = absolute(topic)
    with (
        connect(zenoh_port, domain) as context,
        Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False) as node,
    ):
        kind = _as_told(node, name, full) if kind is None else kind
        message = _message(kind, values) if message is None else message
        publisher = node.create_publisher(kind, name, 10)
        needed = wait if wait is not None else int(once or times > 0)
        _wait_for_subscribers(context, name, full, needed, wait_timeout, out)
        _publish(publisher.publish, message, out, rate=rate, times=1 if once else times, quiet=quiet)


def _wait_for_subscribers(
    context: Context, topic: str, type_name: str, needed: int, timeout_s: float, out: Output
) -> None:
    def enough() -> bool:
        return sum(item.type_name == type_name for item in context.graph.endpoints(topic=topic, kind="MS")) >= needed

    if needed and not context.graph.wait_for(enough, timeout_s):
        out.note(f"no subscriber on {topic} within {timeout_s:g} s: publishing all the same")


def _message(kind: type[Any], values: str) -> Any:
    """What was typed."""
    from metaros.cli.shared.types import parse_values
    from metaros.idl.json import from_json

    return from_json(kind, parse_values(values, kind.__metaros_name__, kind.__metaros_catalogue__))


def _as_told(node: Node, topic: str, type_name: str) -> type[Any]:
    """A type that only nodes know: as those of the topic have it, else any; with near matches where none does."""
    from metaros.cli.shared.types import full_type
    from metaros.errors import UnknownTypeError
    from metaros.node.introspection import hash_in_use

    node.graph.settle(_SETTLE_S)
    if not hash_in_use(node, type_name):
        try:
            full_type(type_name)
        except UnknownTypeError as error:
            raise UnknownTypeError(f"{error}\nand no node that is there now uses it") from None
    heard = [end.type_hash for end in node.graph.endpoints(topic) if end.type_name == type_name]
    return node.fetch_interface(type_name, heard[0] if heard else "", timeout_s=_ASK_S)


def _remote(place: RemoteRobot, topic: str, kind: type[Any], lease: str) -> Callable[[Any], object]:
    """Sends messages to a remote robot, byte for byte; returns when the robot has published one."""
    from metaros.cdr import codec

    encode = codec(kind).encode
    query = {"topic": place.absolute(topic), "type": kind.__metaros_name__, "lease_id": lease or None}
    return lambda message: place.http.send_bytes(
        place.path("publish"), encode(message), kind="application/cdr", **query
    )


def _publish(
    publish: Callable[[Any], object], message: Any, out: Output, *, rate: float, times: int, quiet: bool
) -> None:
    from metaros.clock import SystemClock

    clock = SystemClock()
    due, count = clock.monotonic_s(), 0
    while True:
        publish(message)
        count += 1
        if not quiet:
            out.line(f"publishing #{count}: {message!r}")
        if count == times:
            break
        due = max(due + 1.0 / rate, clock.monotonic_s() - 1.0)  # catch up a second at most, never a whole night
        pause(due - clock.monotonic_s())
