"""`spin`: run nodes until Ctrl-C."""

from __future__ import annotations

from collections.abc import Iterable

from metaros.errors import UsageError
from metaros.executor import Executor, SingleThreadedExecutor
from metaros.node import heartbeat
from metaros.node.node import Node

__all__ = ["spin"]


def spin(nodes: Node | Iterable[Node], *, executor: Executor | None = None) -> None:
    """Run the callbacks of one node or several of one context until Ctrl-C, or until they are closed.

    On `executor` where one is given, with the nodes it has already; it is shut down at the end.
    """
    executor = SingleThreadedExecutor() if executor is None else executor
    chosen = [nodes] if isinstance(nodes, Node) else list(nodes)
    if not chosen:
        raise UsageError("spin needs a node")
    for node in chosen:
        executor.add_node(node)
        heartbeat.follow(node)
    first = chosen[0]
    if not first.context.connected() and first.context.session.connect:
        where = ", ".join(first.context.session.connect)
        first.get_logger().warn(f"no router at {where}: start one with `metaros router`; going on alone until then")
    try:
        executor.spin()
    except KeyboardInterrupt:
        pass
    finally:
        executor.shutdown()
        for node in chosen:
            heartbeat.leave(node)
