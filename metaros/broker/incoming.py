"""Everything that ZeroMQ publishers say, on its way to ROS: a route a topic, served in turn."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence

from metaros.broker.faults import Faults
from metaros.broker.frames import ros_topic, split
from metaros.broker.report import TopicRow
from metaros.broker.route import Route
from metaros.broker.type_inference import TypeTable
from metaros.broker.types import Types
from metaros.errors import FrameError, MetarosError, TooLargeError
from metaros.idl.globs import Glob
from metaros.limits import LIMITS
from metaros.node import Node

__all__ = ["Incoming"]

_MOST_TOLD = 20
_SHOWN = 64
_MARKS = (b"\x00", b"\x01")  # how a frame that ends or begins a subscription starts


class Incoming:
    """The routes. It belongs to the bridge's thread; the counters may be read from any."""

    def __init__(
        self,
        node: Node,
        *,
        table: TypeTable,
        types: Types,
        only: Sequence[Glob],
        faults: Faults,
        heard: Callable[[], None] = lambda: None,
    ) -> None:
        self.frames = self.bytes = 0  # that came here
        self.odd = 0  # those that are a subscription which the hub forwards, or look like one
        self.unreadable = 0  # those without a topic of ours
        self._node = node
        self._table = table
        self._types = types
        self._only = only
        self._faults = faults
        self._heard = heard  # called on Zenoh's threads when a topic gets its first listener
        self._routes: dict[str, Route] = {}
        self._by_spelling: dict[bytes, Route | None] = {}
        self._warned: set[bytes] = set()
        self._ready: deque[Route] = deque()

    def take(self, frames: Sequence[bytes]) -> None:
        """Count a message; queue it where anybody in ROS listens."""
        first = frames[0]
        if first[:1] in _MARKS and len(frames) == 1:
            self.odd += 1
            return
        self.frames += len(frames)
        self.bytes += len(first) if len(frames) == 1 else sum(map(len, frames))
        try:
            topic, payload = split(frames)
            route = self._by_spelling[topic] if topic in self._by_spelling else self._find(topic)
        except (FrameError, TooLargeError) as error:
            self.unreadable += 1
            self._report(first.partition(b" ")[0][:_SHOWN], error)
            return
        if route is None:
            return
        route.messages += 1
        route.bytes += len(payload)
        if route.has_listeners():
            route.backlog.put(payload, len(payload))
            self._queue(route)

    @property
    def routes(self) -> Iterable[Route]:
        """One a topic."""
        return self._routes.values()

    def work(self, time_s: float) -> bool:
        """Forward messages for about so long, one of each topic in turn; whether more wait."""
        now_s = self._node.clock.monotonic_s
        until_s = now_s() + time_s
        while self._ready and now_s() < until_s:
            route = self._ready.popleft()
            route.queued = False
            if not route.ready():
                continue  # until `refresh`
            payload = route.backlog.take()
            if payload is not None:
                route.forward(payload)
            if len(route.backlog):
                self._queue(route)
        return bool(self._ready)

    def refresh(self) -> None:
        """The graph has changed."""
        for route in self._routes.values():
            route.refresh()
            if len(route.backlog):
                self._queue(route)

    def is_own(self, topic: str, gid: bytes) -> bool:
        """Whether the bridge itself published a sample: it must not go back to ZeroMQ."""
        route = self._routes.get(topic)
        return route is not None and gid in route.gids

    def rows(self) -> list[TopicRow]:
        """For the report."""
        return [route.row() for route in list(self._routes.values())]

    def close(self) -> None:
        """Leave every topic."""
        for route in self._routes.values():
            route.close()

    def _report(self, topic: bytes, error: MetarosError) -> None:
        """Some of them: random topics must not keep faults of real ones from being told."""
        if topic not in self._warned and len(self._warned) < _MOST_TOLD:
            self._warned.add(topic)
            self._faults.warn_once(("unreadable", topic), f"from ZeroMQ: {error}")

    def _queue(self, route: Route) -> None:
        if not route.queued:
            route.queued = True
            self._ready.append(route)

    def _find(self, topic: bytes) -> Route | None:
        name = ros_topic(topic)
        if self._only and not any(glob.matches(name) for glob in self._only):
            route = None
        else:
            route = self._routes.get(name)
            if route is None:
                if len(self._routes) >= LIMITS.broker_topics:
                    raise TooLargeError(
                        f"more than {LIMITS.broker_topics} topics: messages of further ones are dropped"
                    )
                route = self._routes[name] = Route(
                    self._node, name, self._table, self._types, self._faults, self._heard
                )
        if len(self._by_spelling) < 4 * LIMITS.broker_topics:
            self._by_spelling[topic] = route
        return route
