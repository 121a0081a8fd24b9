"""The launcher in the graph: it sees its nodes appear, publishes their events, and serves requests of other processes.

Events go out on /metaros/node_events as metaros_msgs/msg/NodeEvent; requests come as Zenoh queries on
`@metaros/<domain>/<zenoh id>/launch`, in JSON.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Any, Final

import zenoh

from metaros.cli.launch.keys import request_key
from metaros.errors import MetarosError
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.metaros_msgs.msg import NodeEvent
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.node import Context, Node
from metaros.supervise import Event, EventKind
from metaros.wire import Durability, QoSProfile

__all__ = ["EVENTS", "LaunchGraph"]

EVENTS: Final = "/metaros/node_events"
EVENTS_QOS: Final = QoSProfile(depth=64, durability=Durability.TRANSIENT_LOCAL)
_REQUEST_BYTES: Final = 4096
_REQUESTS: Final = 64  # at a time
_WORDS: Final = {  # what consumers hear
    EventKind.EXITED: "exited",
    EventKind.HUNG: "hung",
    EventKind.QUARANTINED: "quarantined",
    EventKind.ENDED: "ended",
    EventKind.SAFE_STOP: "safe_stop",
    EventKind.STOPPED: "stopped",
    EventKind.KILLED: "stopped",
}
Answer = Callable[[Mapping[str, Any]], Awaitable[Any]]


class LaunchGraph:
    """The launcher's session and node; made on the event loop's thread, which `answer(request)` runs on, too."""

    def __init__(self, *, zenoh_port: int, domain: int, name: str, answer: Answer) -> None:
        self._loop = asyncio.get_running_loop()
        self._answer = answer
        self._tasks: set[asyncio.Task[None]] = set()
        self._context = Context(domain_id=domain, connect=f"tcp/127.0.0.1:{zenoh_port}")
        self._node = Node(name, context=self._context, enable_rosout=False, enable_parameters=False)
        self._events = self._node.create_publisher(NodeEvent, EVENTS, EVENTS_QOS)
        sink = zenoh.handlers.Callback(self._on_query, indirect=False)
        session = self._context.session.check_open()
        self._queryable = session.declare_queryable(request_key(domain, self._context.zid), sink)

    def close(self) -> None:
        """Leave the graph."""
        for task in self._tasks:
            task.cancel()
        with suppress(zenoh.ZError):
            self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._context.close()

    def has_node(self, full_name: str) -> bool:
        """Whether a node of this name is in the graph now."""
        return any(node.full_name == full_name for node in self._context.graph.nodes())

    def report(self, event: Event, node: str) -> None:
        """Publish what happened to `node`."""
        kind = _WORDS.get(event.kind, "")
        if event.kind is EventKind.STARTED:
            kind = "node_restarted" if event.restarts else "started"
        if not kind:
            return
        seconds, nanoseconds = divmod(self._context.clock.wall_ns(), 1_000_000_000)
        with suppress(MetarosError):  # a launcher that is closing has nothing to tell
            self._events.publish(
                NodeEvent(
                    stamp=Time(sec=seconds, nanosec=nanoseconds),
                    node=node,
                    kind=kind,
                    reason=event.detail,
                    pid=event.pid or 0,
                    restarts=event.restarts,
                )
            )

    async def trigger(self, service: str, timeout_s: float) -> str:
        """Call a std_srvs/srv/Trigger; what went wrong, or nothing."""
        client = self._node.create_client(Trigger, service)
        try:
            response = await client.call_async(Trigger.Request(), timeout_s)
            return "" if response.success else f"{service} refused: {response.message}"
        except MetarosError as error:
            return str(error)
        finally:
            client.close()

    # -- requests --------------------------------------------------------------------------------------------------

    def _on_query(self, query: zenoh.Query) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._begin, query)

    def _begin(self, query: zenoh.Query) -> None:
        if len(self._tasks) >= _REQUESTS:
            query.drop()  # type: ignore[no-untyped-call]
            return
        task = self._loop.create_task(self._reply(query))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _reply(self, query: zenoh.Query) -> None:
        try:
            payload = b"" if query.payload is None else query.payload.to_bytes()
            request = json.loads(payload[:_REQUEST_BYTES] or b"{}")
            if not isinstance(request, dict):
                raise ValueError("a request is an object")
            answer = await self._answer(request)
        except (MetarosError, ValueError, RecursionError) as error:
            answer = {"error": str(error)}
        with suppress(zenoh.ZError):  # who asked is gone
            query.reply(request_key(self._context.domain_id, self._context.zid), json.dumps(answer).encode())
        query.drop()  # type: ignore[no-untyped-call]
