"""`metaros lifecycle`: lifecycle nodes, of ROS 2 as of ours: list them, ask for their state, change it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command

if TYPE_CHECKING:
    from metaros.cli.remote.graph import RemoteGraph
    from metaros.cli.remote.node import RemoteNode
    from metaros.node import Node
    from metaros.wire import Graph

__all__ = ["register"]

group = typer.Typer(name="lifecycle", no_args_is_help=True, help="Lifecycle nodes: list them, get and set their state.")
NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help="Such as /guard.")]
Timeout = Annotated[
    float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="How long to wait for a node's answer.")
]
_GET_STATE = "lifecycle_msgs/srv/GetState"


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.add_typer(group)


@group.command("nodes")
@graph_command
def nodes(
    target: GraphTarget,
    all_: Annotated[bool, typer.Option("--all", "-a", help="Hidden nodes, too.")] = False,
    count: Annotated[bool, typer.Option("--count-nodes", "-c", help="Only how many.")] = False,
) -> None:
    """List the nodes that have a lifecycle."""
    out = target.out
    with target.open_graph() as graph:
        names = [name for name in _lifecycle_nodes(graph) if all_ or "/_" not in name]
    if out.json:
        out.objects(names)
    elif count:
        out.line(str(len(names)))
    else:
        for name in names:
            out.line(name)
        if not names:
            out.note("no lifecycle nodes")


@group.command("get")
@graph_command
def get(
    target: GraphTarget,
    node: Annotated[str, typer.Argument(metavar="NODE", help="All of them if left out.")] = "",
    timeout: Timeout = 10.0,
) -> None:
    """Print the state of one lifecycle node, or of all."""
    out = target.out
    with _asking(target, timeout_s=timeout) as asker:
        states = {name: asker.state(name) for name in ([asker.find(node)] if node else asker.names)}
    if out.json:
        rows = [{"node": name, "id": state.id, "label": state.label} for name, state in states.items()]
        out.objects(rows[0] if node else rows)
        return
    for name, state in states.items():
        out.line(f"{'' if node else f'{name}: '}{state.label} [{state.id}]")
    if not states:
        out.note("no lifecycle nodes")


@group.command("list")
@graph_command
def list_(
    target: GraphTarget,
    node: NodeArgument,
    all_: Annotated[
        bool, typer.Option("--all", "-a", help="Every transition there is, not only those from here.")
    ] = False,
    timeout: Timeout = 10.0,
) -> None:
    """List the transitions that are possible from the node's present state."""
    out = target.out
    with _asking(target, timeout_s=timeout) as asker:
        rows = asker.transitions(asker.find(node), graph=all_)
    if out.json:
        out.objects(
            [
                {"id": t.id, "label": t.label, "start": start.label, "goal": goal.label}
                for t, start, goal in ((row.transition, row.start_state, row.goal_state) for row in rows)
            ]
        )
        return
    for row in rows:
        out.line(f"- {row.transition.label} [{row.transition.id}]")
        out.line(f"\tStart: {row.start_state.label}\n\tGoal: {row.goal_state.label}")


@group.command("set")
@graph_command
def set_(
    target: GraphTarget,
    node: NodeArgument,
    transition: Annotated[str, typer.Argument(metavar="TRANSITION", help="Its label or number, such as activate.")],
    timeout: Timeout = 10.0,
) -> None:
    """Have a lifecycle node take a transition; exit code 1 where it fails."""
    from metaros.errors import PeerError

    out = target.out
    with _asking(target, timeout_s=timeout) as asker:
        name = asker.find(node)
        done = asker.change(name, transition)
        state = asker.state(name)
    if out.json:
        out.objects({"node": name, "success": done, "id": state.id, "label": state.label})
    elif done:
        out.line("Transitioning successful")
    if not done:
        raise PeerError(f"Transitioning failed: {name} is {state.label}")


def _lifecycle_nodes(graph: Graph | RemoteGraph) -> list[str]:
    """As ros2 tells them: by their service `get_state`."""
    return sorted(
        {
            server.node_full_name
            for server in graph.endpoints(kind="SS")
            if server.type_name == _GET_STATE and server.topic == f"{server.node_full_name}/get_state"
        }
    )


@dataclass(frozen=True, slots=True)
class _LifecycleServices:
    """Asks lifecycle nodes; `names` are those there are."""

    target: GraphTarget
    own: Node | RemoteNode
    names: list[str]
    known: list[str]
    timeout_s: float

    def find(self, node: str) -> str:
        """The full name of a lifecycle node; UnavailableError with a hint otherwise."""
        from metaros.cli.shared.connection import closest
        from metaros.errors import UnavailableError

        name = self.target.absolute(node)
        if name in self.names:
            return name
        if name in self.known:
            raise UnavailableError(f"{name} has no lifecycle\n`metaros lifecycle nodes` shows those that have one")
        hint = closest(name, self.names) or "`metaros lifecycle nodes` shows those there are"
        raise UnavailableError(f"no node {name!r} in the graph\n{hint}")

    def state(self, name: str) -> Any:
        """The lifecycle_msgs/msg/State that a node is in."""
        from metaros.interfaces.lifecycle_msgs.srv import GetState

        return self._call(GetState, f"{name}/get_state", GetState.Request()).current_state

    def transitions(self, name: str, *, graph: bool) -> list[Any]:
        """Transition descriptions: those from the present state, or all."""
        from metaros.interfaces.lifecycle_msgs.srv import GetAvailableTransitions

        service = "get_transition_graph" if graph else "get_available_transitions"
        answer = self._call(GetAvailableTransitions, f"{name}/{service}", GetAvailableTransitions.Request())
        return list(answer.available_transitions)

    def change(self, name: str, wanted: str) -> bool:
        """Ask for a transition by label or number; UsageError names the possible ones."""
        from metaros.errors import UsageError
        from metaros.interfaces.lifecycle_msgs.srv import ChangeState

        possible = [row.transition for row in self.transitions(name, graph=False)]
        chosen = [item for item in possible if wanted in (item.label, str(item.id))]
        if not chosen:
            lines = "".join(f"\n- {item.label} [{item.id}]" for item in possible)
            raise UsageError(f"unknown transition {wanted!r}, available ones are:{lines or ' none'}")
        request = ChangeState.Request(transition=chosen[0])
        return bool(self._call(ChangeState, f"{name}/change_state", request).success)

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        client = self.own.create_client(kind, service)
        client.wait_for_service(min(self.timeout_s, 1.0))
        return client.call(request, timeout_s=self.timeout_s)


@contextmanager
def _asking(target: GraphTarget, *, timeout_s: float) -> Iterator[_LifecycleServices]:
    """A node of ours beside a settled graph."""
    with target.node() as own:
        known = [node.full_name for node in own.graph.nodes()]
        yield _LifecycleServices(target, own, _lifecycle_nodes(own.graph), known, timeout_s)
