"""What a node is without what it creates: its names, its clock and timers, its entry in the graph, its end.

Publishers, subscriptions, services and clients take this class; `metaros.node.node.Node`, which creates them, adds
to it.
"""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh

from metaros.clock import Clock
from metaros.errors import ClosedError
from metaros.executor import CallbackGroup, Ingress, Timer, TimerHeap
from metaros.idl import names
from metaros.node.arguments import NodeArguments
from metaros.node.context import Closable, Context, shared_context
from metaros.node.logger import Logger
from metaros.node.time.rate import Rate
from metaros.node.time.sim_time import SimClock
from metaros.wire import Graph, NodeToken

__all__ = ["NodeCore"]

_REPORTS = 4096  # faults of peers remembered as reported


class NodeCore:
    """A node of the ROS graph, as its endpoints see it."""

    def __init__(
        self, arguments: NodeArguments, *, context: Context | None, use_sim_time: bool, nice: int, critical: bool
    ) -> None:
        self.arguments = arguments
        self.name, self.namespace, self.full_name = arguments.name, arguments.namespace, arguments.full_name
        self.context = shared_context() if context is None else context
        self.ingress: Ingress = self.context.ingress
        self.clock: Clock = SimClock() if use_sim_time else self.context.clock
        self.timers = TimerHeap(self.clock.monotonic_s, self.ingress.wake, paused=use_sim_time)
        self.nice, self.critical = nice, critical
        self.closed = False
        self._endpoints: list[Closable] = []
        self._rates: list[Rate] = []
        self._reported: dict[object, None] = {}
        self._lock = threading.Lock()
        session = self.context.session
        self.context.adopt(self)
        names_ = self.name, self.namespace, arguments.enclave
        self.token = NodeToken(session.domain, session.zid, session.next_id(), *names_)
        self._tokens: list[Any] = []  # filled without Python in between, as `Endpoint.announce` does
        self._tokens.extend(map(session.check_open().liveliness().declare_token, (str(self.token),)))
        self.graph.add_own(self.token)
        self._logger = Logger(self.full_name.lstrip("/").replace("/", "."), self.clock)
        self._logger.on_stderr = arguments.stdout_logs
        if arguments.log_level:
            self._logger.set_level(arguments.log_level)

    @property
    def graph(self) -> Graph:
        """Who else is there."""
        return self.context.graph

    def get_logger(self) -> Logger:
        """The node's logger."""
        return self._logger

    def resolve(self, name: str, *, service: bool = False) -> str:
        """The full name of a topic or service as this node means it: relative, `~/private`, `/absolute`; remapped."""
        return self.arguments.remapped(names.resolve(name, self.namespace, self.name), service=service)

    # -- time ------------------------------------------------------------------------------------------------------

    def create_timer(
        self, period_s: float, callback: Callable[[], Any], *, group: CallbackGroup | None = None
    ) -> Timer:
        """Call `callback()` every `period_s` on the executor, by the node's clock."""
        if self.closed:
            raise ClosedError(f"{self.full_name} was closed")
        if inspect.iscoroutinefunction(callback):
            self.ingress.async_work = True
        return self.timers.add(period_s, callback, group)

    def create_rate(self, hz: float) -> Rate:
        """For loops that run `hz` times a second: `rate.sleep()` on a thread of your own, or `await sleep_async()`."""
        if self.closed:
            raise ClosedError(f"{self.full_name} was closed")
        rate = Rate(self.clock, hz)
        self._rates.append(rate)
        return rate

    # -- life ------------------------------------------------------------------------------------------------------

    def adopt(self, endpoint: Closable) -> None:
        """Close the endpoint when the node closes."""
        with self._lock:
            if self.closed:
                raise ClosedError(f"{self.full_name} was closed")
            self._endpoints.append(endpoint)

    def release(self, endpoint: Closable) -> None:
        """The reverse of `adopt`."""
        with self._lock:
            if endpoint in self._endpoints:
                self._endpoints.remove(endpoint)

    def first_report(self, about: object) -> bool:
        """Whether this is the first time that `about` is asked: so that a repeated fault is reported once."""
        with self._lock:
            if about in self._reported:
                return False
            if len(self._reported) >= _REPORTS:
                del self._reported[next(iter(self._reported))]
            self._reported[about] = None
            return True

    def close(self) -> None:
        """Close every endpoint and leave the graph. Safe to call twice."""
        with self._lock:
            if self.closed:
                return
            self.closed = True
            endpoints = list(self._endpoints)
        for rate in self._rates:
            rate.close()
        for endpoint in reversed(endpoints):
            endpoint.close()
        with suppress(zenoh.ZError):
            self._tokens[0].undeclare()
        self.graph.discard_own(self.token)
        self.ingress.wake()
        self.context.release(self)
