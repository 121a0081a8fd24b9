"""A context: one Zenoh session with its graph, its ingress and its clock; nodes live in it."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Protocol

from metaros.clock import Clock, SystemClock
from metaros.errors import ClosedError
from metaros.executor import Ingress
from metaros.node.drop_statistics import DropStatistics
from metaros.node.key_subscribers import KeySubscribers
from metaros.node.sporadic import SporadicHeartbeats
from metaros.node.watch import Watch
from metaros.wire import Graph, WireSession

__all__ = ["Closable", "Context", "shared_context"]


class Closable(Protocol):
    """What a context closes with itself, which is nodes, and what a node does, which is endpoints."""

    def close(self) -> None:
        """Leave the graph."""


class Context:
    """Everything that the nodes of a program share. Use it as a context manager, or `close` it.

    `domain_id` defaults to `ROS_DOMAIN_ID` or 0; `connect` to the router on this host, `tcp/localhost:7447` or the
    port in `METAROS_ZENOH_PORT`; `listen` to any free port of this host; `shared_memory` to `METAROS_SHARED_MEMORY` or
    "off". With "auto" large messages to processes of this host that have it, too, go through shared memory.
    `ros_distro` says whose peers the program's nodes are, and defaults to `METAROS_ROS_DISTRO` or "jazzy": those of
    "humble" write no type hashes. Either kind hears the other. `environ` stands in for the process's environment.
    """

    def __init__(
        self,
        domain_id: int | None = None,
        connect: str | Sequence[str] | None = None,
        listen: str | Sequence[str] | None = None,
        clock: Clock | None = None,
        *,
        shared_memory: str | None = None,
        ros_distro: str | None = None,
        environ: Mapping[str, str] | None = None,
    ) -> None:
        self.clock: Clock = SystemClock() if clock is None else clock
        self.session = WireSession(
            domain_id=domain_id,
            connect=connect,
            listen=listen,
            environ=environ,
            shared_memory=shared_memory,
            ros_distro=ros_distro,
        )
        self.graph = Graph(self.session)
        self.ingress = Ingress()
        self.key_subscribers = KeySubscribers(self.session, self.ingress)
        self.watch = Watch(self.graph, self.session.zid)
        self.drops = DropStatistics(self.session, self.ingress)
        self.sporadic = SporadicHeartbeats()
        self._nodes: list[Closable] = []
        self._lock = threading.Lock()

    @property
    def domain_id(self) -> int:
        """The ROS domain."""
        return self.session.domain

    @property
    def zid(self) -> str:
        """The Zenoh id of the session, in hex."""
        return self.session.zid

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self.session.closed

    def connected(self) -> bool:
        """Whether a router or a peer is linked now."""
        return self.session.connected()

    def adopt(self, node: Closable) -> None:
        """Close the node when the context closes; ClosedError when that has happened."""
        with self._lock:
            if self.closed:
                raise ClosedError("the context was closed")
            self._nodes.append(node)

    def release(self, node: Closable) -> None:
        """The reverse of `adopt`; the shared context closes with its last node."""
        with self._lock:
            if node in self._nodes:
                self._nodes.remove(node)
            last = not self._nodes
        if last and _SHARED.is_current(self):
            self.close()

    def close(self) -> None:
        """Close the nodes, leave the graph, end the threads. Safe to call twice."""
        _SHARED.forget(self)
        for node in list(self._nodes):
            node.close()
        self.drops.close()
        self.graph.close()
        self.session.close()
        self.sporadic.close()
        self.ingress.close()

    def __enter__(self) -> Context:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Shared:
    """The context of nodes that were given none: opened with the first, closed with the last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._context: Context | None = None

    def get(self) -> Context:
        with self._lock:
            if self._context is None or self._context.closed:
                self._context = Context()
            return self._context

    def is_current(self, context: Context) -> bool:
        return self._context is context

    def forget(self, context: Context) -> None:
        if self._context is context:
            self._context = None


_SHARED = _Shared()


def shared_context() -> Context:
    """The process's own context, opened on first use."""
    return _SHARED.get()
