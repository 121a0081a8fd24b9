"""`metaros action send_goal`: one goal from sending to result, with its feedback; Ctrl-C cancels it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.visit import Visit, visiting
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from metaros.cli.afar.graph import FarGraph
    from metaros.cli.afar.place import RobotPlace
    from metaros.cli.output import Output
    from metaros.node import Node
    from metaros.node.action import ClientGoal
    from metaros.wire import Graph

__all__ = ["send_goal", "show_part"]

_SLICE_S = 0.05
_CANCEL_S = 5.0


class _Heard:
    """Feedback between the executor's thread and the printing one; when it is full new feedback is dropped."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Any] = queue.Queue(LIMITS.service_backlog)
        self.dropped = 0

    def put(self, message: Any) -> None:
        """Never waits: the executor must be able to end."""
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self.dropped += 1

    def get(self) -> Any:
        """The next one within a moment, or None."""
        try:
            return self._queue.get(timeout=_SLICE_S)
        except queue.Empty:
            return None


@visiting
def send_goal(
    at: Visit,
    action: Annotated[str, typer.Argument(metavar="ACTION", help="Such as /fibonacci.")],
    type_or_values: Annotated[str, typer.Argument(metavar="TYPE", help="Taken from the graph if left out.")] = "",
    values: Annotated[str, typer.Argument(metavar="YAML", help="The goal's fields.")] = "",
    feedback: Annotated[bool, typer.Option("--feedback", "-f", help="Print feedback as it comes.")] = False,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="How long to wait for the server to accept.")
    ] = 10.0,
) -> None:
    """Send a goal and wait for its result; Ctrl-C cancels it. Exit code 1 unless it succeeds."""
    from metaros.cli import running
    from metaros.cli.types import full_type, parse_values
    from metaros.errors import TimeoutError_
    from metaros.idl import message_class
    from metaros.idl.json import from_json
    from metaros.node import Node

    out, name = at.out, at.absolute(action)
    if type_or_values.lstrip().startswith("{"):  # the type was left out
        type_or_values, values = "", type_or_values
    if at.place is not None:
        _send_afar(at, at.place, name, type_or_values, values, feedback=feedback, timeout_s=timeout)
        return
    with at.connect() as context:
        full = _type_of(context.graph, name, full_type(type_or_values, "action") if type_or_values else "")
        kind: Any = message_class(full)
        goal = from_json(kind.Goal, parse_values(values, f"{full}_Goal"))
        with Node("metaros_cli", context=context, enable_rosout=False) as node, _spinning(node):
            heard = _Heard()
            client = node.create_action_client(kind, name)
            if not client.wait_for_server(min(timeout, max(at.spin_time, 0.1))):
                raise TimeoutError_(f"{name} is not complete: its server may be starting or stopping; try again")
            show_part(out, "Sending goal", goal)
            with running.stop_on_signals() as stop:  # from here on there is a goal to cancel
                handle = client.send_goal(goal, feedback=heard.put if feedback else None, timeout_s=timeout).wait()
                _follow(out, handle, heard, stop)


def _send_afar(
    at: Visit, place: RobotPlace, name: str, type_name: str, values: str, *, feedback: bool, timeout_s: float
) -> None:
    """The same to a robot elsewhere."""
    from metaros.cli.afar.goal import follow_goal
    from metaros.cli.types import full_type, parse_values
    from metaros.idl import message_class
    from metaros.idl.json import from_json

    with at.look() as graph:
        full = _type_of(graph, name, full_type(type_name, "action") if type_name else "")
    kind: Any = message_class(full)
    goal = from_json(kind.Goal, parse_values(values, f"{full}_Goal"))
    follow_goal(place, at.out, name, kind, goal, feedback=feedback, timeout_s=timeout_s)


def _type_of(graph: Graph | FarGraph, name: str, wanted: str) -> str:
    """The type that the action's server declares; UnavailableError where there is none."""
    from metaros.cli.graph_model import draw
    from metaros.cli.names import no_such
    from metaros.errors import UsageError

    links = {link.name: link for link in draw([], graph.tokens()).links if link.kind == "action" and link.sources}
    if name not in links:
        raise no_such("action", name, links)
    types = links[name].types
    if wanted and wanted not in types:
        raise UsageError(f"{name} is a {' or '.join(types)}, not a {wanted}")
    return wanted or types[0]


@contextmanager
def _spinning(node: Node) -> Iterator[None]:
    """Feedback arrives while the node spins."""
    from metaros.executor import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, name="metaros-cli")
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


def _follow(out: Output, handle: ClientGoal, heard: _Heard, stop: threading.Event) -> None:
    """Print what happens until the goal has ended, and exit by how it did."""
    from metaros.errors import PeerError

    if not handle.accepted:
        raise PeerError("the server rejected the goal\nits log may say why: metaros topic echo /rosout")
    goal_id = handle.goal_id.hex()
    if out.json:
        out.object_line({"goal_id": goal_id, "accepted": True})
    else:
        out.line(f"Goal accepted with ID: {goal_id}\n")
    ended = _wait(out, handle, heard, stop)
    interrupted = ended is None
    if interrupted:
        out.note("cancelling the goal …")
        handle.cancel(_CANCEL_S).wait()
        ended = handle.result(_CANCEL_S).wait()
    if out.json:
        from metaros.cli.render import plain

        out.object_line({"status": ended.status.name, "result": plain(ended.result)})
    else:
        show_part(out, "Result", ended.result)
        good = ended.status.name == "SUCCEEDED"
        out.line(f"Goal finished with status: {out.style(ended.status.name, '32' if good else '31')}")
    if ended.status.name != "SUCCEEDED":
        raise typer.Exit(130 if interrupted else 1)


def _wait(out: Output, handle: ClientGoal, heard: _Heard, stop: threading.Event) -> Any:
    """The goal's end, None when asked to stop; feedback that came before it is printed before it."""
    reply = handle.result()
    while not stop.is_set():
        done = reply.done
        message = heard.get()
        if message is not None:
            show_part(out, "Feedback", message)
        elif done:
            if heard.dropped:
                out.note(f"{heard.dropped} feedback messages came faster than they could be printed and are left out")
            return reply.wait()
    return None


def show_part(out: Output, title: str, message: Any) -> None:
    """A goal, feedback or result under its title; machines get feedback here, and the rest in the lines around it."""
    from metaros.cli.render import message_yaml, plain

    if out.json:
        if title == "Feedback":
            out.object_line({"feedback": plain(message)})
        return
    body = message_yaml(message).replace("\n", "\n    ")
    out.line(f"{out.style(f'{title}:', '1')}\n    {body or '(no fields)'}\n")
