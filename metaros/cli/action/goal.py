"""`metaros action send_goal`: one goal from sending to result, with its feedback; Ctrl-C cancels it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command
from metaros.cli.shared.goal_view import show_accepted, show_part, show_status
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.cli.remote.robot import RemoteRobot
    from metaros.cli.shared.output import Output
    from metaros.node import Node
    from metaros.node.action import ClientGoal
    from metaros.wire import Graph

__all__ = ["send_goal"]

_SLICE_S = 0.05
_CANCEL_S = 5.0


class _FeedbackBuffer:
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


@graph_command
def send_goal(
    target: GraphTarget,
    action: Annotated[str, typer.Argument(metavar="ACTION", help="Such as /fibonacci.")],
    type_or_values: Annotated[str, typer.Argument(metavar="TYPE", help="Taken from the graph if left out.")] = "",
    values: Annotated[str, typer.Argument(metavar="YAML", help="The goal's fields.")] = "",
    feedback: Annotated[bool, typer.Option("--feedback", "-f", help="Print feedback as it comes.")] = False,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="How long to wait for the server to accept.")
    ] = 10.0,
) -> None:
    """Send a goal and wait for its result; Ctrl-C cancels it. Exit code 1 unless it succeeds."""
    from metaros.cli.shared import running
    from metaros.errors import TimeoutError_
    from metaros.node import Node

    out, name = target.out, target.absolute(action)
    if type_or_values.lstrip().startswith("{"):  # the type was left out
        type_or_values, values = "", type_or_values
    if target.robot is not None:
        _send_remote(target, target.robot, name, type_or_values, values, feedback=feedback, timeout_s=timeout)
        return
    with target.connect() as context:
        full = _type_of(context.graph, name, type_or_values)
        with Node("metaros_cli", context=context, enable_rosout=False) as node, _spinning(node):
            hashes = [end.type_hash for end in context.graph.endpoints(f"{name}/_action/send_goal", "SS")]
            kind: Any = node.fetch_interface(full, hashes[0] if hashes else "", timeout_s=timeout)
            goal, buffer = _goal(kind, values), _FeedbackBuffer()
            client = node.create_action_client(kind, name)
            if not client.wait_for_server(min(timeout, max(target.spin_time, 0.1))):
                raise TimeoutError_(f"{name} is not complete: its server may be starting or stopping; try again")
            show_part(out, "Sending goal", goal)
            with running.stop_on_signals() as stop:  # from here on there is a goal to cancel
                handle = client.send_goal(goal, feedback=buffer.put if feedback else None, timeout_s=timeout).wait()
                _follow(out, handle, buffer, stop)


def _send_remote(
    target: GraphTarget, robot: RemoteRobot, name: str, type_name: str, values: str, *, feedback: bool, timeout_s: float
) -> None:
    """The same for a remote robot."""
    from metaros.cli.remote.goal import follow_goal
    from metaros.cli.remote.interfaces import find_remote_interface
    from metaros.idl import message_class

    with target.open_graph() as graph:
        full = _type_of(graph, name, type_name)
    kind: Any = message_class(full, find_remote_interface(robot, full)[0])
    follow_goal(robot, target.out, name, kind, _goal(kind, values), feedback=feedback, timeout_s=timeout_s)


def _goal(kind: Any, values: str) -> Any:
    """The goal that was typed."""
    from metaros.cli.shared.types import parse_values
    from metaros.idl.json import from_json

    part = kind.Goal
    return from_json(part, parse_values(values, part.__metaros_name__, part.__metaros_catalogue__))


def _type_of(graph: Graph | RemoteGraph, name: str, typed: str) -> str:
    """The type that the action's server declares; UnavailableError where there is none."""
    from metaros.cli.graph.model import build_graph_model
    from metaros.cli.shared.names import no_such
    from metaros.cli.shared.types import type_in_use

    links = {
        link.name: link
        for link in build_graph_model([], graph.tokens()).links
        if link.kind == "action" and link.sources
    }
    if name not in links:
        raise no_such("action", name, links)
    return type_in_use(name, typed, "action", links[name].types)


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


def _follow(out: Output, handle: ClientGoal, buffer: _FeedbackBuffer, stop: threading.Event) -> None:
    """Print what happens until the goal has ended, and exit by how it did."""
    from metaros.errors import PeerError

    if not handle.accepted:
        raise PeerError("the server rejected the goal\nits log may say why: metaros topic echo /rosout")
    show_accepted(out, handle.goal_id.hex())
    ended = _wait(out, handle, buffer, stop)
    interrupted = ended is None
    if interrupted:
        out.note("cancelling the goal …")
        handle.cancel(_CANCEL_S).wait()
        ended = handle.result(_CANCEL_S).wait()
    if out.json:
        from metaros.cli.shared.render import plain

        out.object_line({"status": ended.status.name, "result": plain(ended.result)})
    else:
        show_part(out, "Result", ended.result)
        show_status(out, ended.status.name)
    if ended.status.name != "SUCCEEDED":
        raise typer.Exit(130 if interrupted else 1)


def _wait(out: Output, handle: ClientGoal, buffer: _FeedbackBuffer, stop: threading.Event) -> Any:
    """The goal's end, None when asked to stop; feedback that came before it is printed before it."""
    reply = handle.result()
    while not stop.is_set():
        done = reply.done
        message = buffer.get()
        if message is not None:
            show_part(out, "Feedback", message)
        elif done:
            if buffer.dropped:
                out.note(f"{buffer.dropped} feedback messages came faster than they could be printed and are left out")
            return reply.wait()
    return None
