"""A container as a row of the supervisor's table: the command that runs it, and the one that removes it. Pure.

The engine's own processes are nobody's children. So the container is removed by name before each start and after each
end, also when the supervisor itself is killed (`metaros.supervise.orphan_reaper`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator

from edge_agent.nodes.bundles import Bundle
from edge_agent.nodes.errors import NodeRefusedError
from metaros.fleet.twin.document import NodeSpec
from metaros.supervise.heartbeats import ENVIRONMENT as HEARTBEAT

__all__ = ["check_container", "run_argv", "take_away_argv"]

SESSION = "ZENOH_SESSION_CONFIG_URI"  # a file of this robot, which is put into the container


def check_container(node: NodeSpec) -> None:
    """Raise NodeRefusedError for what a container cannot be."""
    if node.migratable:
        raise NodeRefusedError(f"{node.name}: a container cannot be migratable: no lease ends it to the millisecond")


def run_argv(node: NodeSpec, bundle: Bundle, env: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """In the foreground, in this robot's network. Values of the environment do not stand in the arguments."""
    return tuple(_run(node, bundle, dict(env)))


def take_away_argv(node: NodeSpec, bundle: Bundle) -> tuple[str, ...]:
    """Whether or not it is there, or runs."""
    return (bundle.engine, "rm", "--force", _name(node, bundle))


def _run(node: NodeSpec, bundle: Bundle, env: dict[str, str]) -> Iterator[str]:
    yield from (bundle.engine, "run", "--rm", "--name", _name(node, bundle))
    yield from ("--pull", "never", "--network", "host", "--ipc", "host")
    for name in (*sorted(env), HEARTBEAT):
        yield from ("--env", name)
    if SESSION in env:
        yield from ("--volume", f"{env[SESSION]}:{env[SESSION]}:ro")
    yield bundle.image


def _name(node: NodeSpec, bundle: Bundle) -> str:
    """Several robots may share a machine: each has a state directory of its own."""
    robot = hashlib.sha256(str(bundle.folder.parents[2]).encode()).hexdigest()[:8]
    return f"metaros-{robot}-{node.name}"
