"""What brings a robot to rest when a critical node keeps dying: a short-lived program, run by its supervisor.

It publishes the zero message on topics, calls services, and runs a command: all that it was given, each whatever
becomes of the others. `python -m metaros.cli.safe_stop [--publish TOPIC=TYPE]… [--call SERVICE]… [-- COMMAND…]`
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from metaros.node import Node

__all__ = ["WITHIN_S", "main"]

WITHIN_S: Final = 8.0  # for each part; the supervisor ends the whole soon after
TIMES, EVERY_S = 10, 0.1  # the zero message is published: whoever starts to listen meanwhile hears it, too


def main(arguments: Sequence[str] | None = None) -> int:
    """0 where all of it was done."""
    options = _parser().parse_args(arguments)
    problems: list[str] = []
    if options.command:
        _try(problems, "command", lambda: _run(options.command))
    if options.publish or options.call:
        _try(problems, "network", lambda: _by_network(options, problems))
    if problems:
        sys.stderr.write("; ".join(problems) + "\n")
    return 1 if problems else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="metaros.cli.safe_stop", allow_abbrev=False)
    parser.add_argument("--namespace", default="/")
    parser.add_argument("--session", default="", help="a Zenoh session file: of whoever may drive")
    parser.add_argument("--publish", action="append", default=[], metavar="TOPIC=TYPE")
    parser.add_argument("--call", action="append", default=[], metavar="SERVICE")
    parser.add_argument("command", nargs="*")
    return parser


def _try(problems: list[str], what: str, act: Callable[[], object]) -> None:
    try:
        act()
    except Exception as error:  # whatever it is, the other parts have their turn
        problems.append(f"{what}: {error}")


def _run(command: Sequence[str]) -> None:
    code = subprocess.run(command, stdin=subprocess.DEVNULL, timeout=WITHIN_S, check=False).returncode
    if code:
        raise OSError(f"{command[0]} ended with exit code {code}")


def _by_network(options: argparse.Namespace, problems: list[str]) -> None:
    import os

    from metaros.node import Context, Node

    environ = {**os.environ, **({"ZENOH_SESSION_CONFIG_URI": options.session} if options.session else {})}
    with Context(environ=environ) as context:
        node = Node("safe_stop", namespace=options.namespace, context=context, enable_parameters=False)
        _publish(node, options.publish, problems)  # first: it takes a second, and a service may take long
        for service in options.call:
            _try(problems, service, lambda service=service: _call(node, service))  # type: ignore[misc]


def _publish(node: Node, wanted: Sequence[str], problems: list[str]) -> None:
    from metaros.concurrency.waiting import pause
    from metaros.idl import message_class

    publishers = []
    for text in wanted:
        topic, _, name = text.partition("=")

        def make(topic: str = topic, name: str = name) -> None:
            kind = message_class(name)
            publishers.append((node.create_publisher(kind, topic), kind()))

        _try(problems, topic, make)
    for _ in range(TIMES if publishers else 0):
        for publisher, zero in publishers:
            publisher.publish(zero)
        pause(EVERY_S)


def _call(node: Node, service: str) -> None:
    from metaros.interfaces.std_srvs.srv import Trigger

    client = node.create_client(Trigger, service)
    response = client.call(Trigger.Request(), WITHIN_S)
    if not response.success:
        raise OSError(f"refused: {response.message}")


if __name__ == "__main__":
    sys.exit(main())
