"""Robots behind `zenoh-bridge-ros2dds`: their topics on plain keys, `ns/topic`, in the ROS graph and back.

Such a key has no domain, type or hash, and a sample on it no attachment; the payload is the same CDR. Which topics
there are, and of which types, the bridge announces in liveliness tokens of its own,
`@ros2_lv/<zid>/MP|MS/<key>/<type>/<qos>` with `§` for `/`; or a table says it, for a bridge that is silent.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from queue import SimpleQueue
from typing import Any, Final, NamedTuple

import zenoh
import zenoh.ext

from metaros.errors import MetarosError, UnknownTypeError
from metaros.idl import default_catalogue, message_class, names
from metaros.node.context import Context
from metaros.node.dedicated_threads import RingThread
from metaros.node.info import MessageInfo
from metaros.node.key_subscribers import declare_with_history
from metaros.node.node import Node
from metaros.wire import Durability, QoSProfile, Reliability

__all__ = ["Announced", "PlainKeyBridge", "parse_announced"]

TOKENS: Final = ("@ros2_lv/*/MP/*/*/*", "@ros2_lv/*/MS/*/*/*")
_SLASH: Final = "§"
_DEPTH: Final = 100
_log = logging.getLogger("metaros.node")


class Announced(NamedTuple):
    """What a bridge says of a DDS endpoint: whether it publishes, on which key, which type, and if it is latched."""

    publishes: bool
    key: str
    type_name: str
    latched: bool


def parse_announced(token: str) -> Announced | None:
    """A token of zenoh-bridge-ros2dds for a publisher or a subscription; None for anything else."""
    parts = token.split("/")
    if len(parts) != 6 or parts[0] != "@ros2_lv" or parts[2] not in ("MP", "MS"):
        return None
    qos = parts[5].split(":")
    if len(qos) != 4:
        return None
    return Announced(parts[2] == "MP", parts[3].replace(_SLASH, "/"), parts[4].replace(_SLASH, "/"), qos[2] == "1")


class PlainKeyBridge:
    """Runs from its making until `close`; a context manager. One a router: two would echo each other.

    `topics` are types by topic that are bridged both ways without being announced; `prefix` is what the other bridge
    puts before its keys. `allows(topic)` chooses; `notice(text)` is told of each route, and of what is not bridged.
    """

    def __init__(
        self,
        context: Context,
        *,
        topics: Mapping[str, str] | None = None,
        prefix: str = "",
        allows: Callable[[str], bool] = lambda topic: True,
        notice: Callable[[str], object] = _log.info,
    ) -> None:
        self._context, self._prefix = context, prefix.strip("/")
        self._allows, self._notice = allows, notice
        self._routes: dict[tuple[str, bool], Callable[[], None]] = {}
        self._gids: dict[str, bytes] = {}  # of our own publishers, by topic: what they say came from there
        self._refused: set[tuple[str, str]] = set()
        self._queue: SimpleQueue[zenoh.Sample | None] = SimpleQueue()
        self._node = Node("ros2dds_bridge", context=context, enable_rosout=False, enable_parameters=False)
        try:
            for topic, type_name in (topics or {}).items():
                message_class(type_name)  # says what is wrong with the table
                for publishes in (True, False):
                    self._open(Announced(publishes, self._key(names.resolve(topic, "/", "bridge")), type_name, False))
        except BaseException:
            self._node.close()
            raise
        liveliness = context.session.check_open().liveliness()
        callback = zenoh.handlers.Callback(self._queue.put, indirect=False)
        self._watching = [liveliness.declare_subscriber(key, callback, history=True) for key in TOKENS]
        self._thread = threading.Thread(target=self._run, name="metaros-plain-keys", daemon=True)
        self._thread.start()

    @property
    def routes(self) -> list[tuple[str, bool]]:
        """Topic, and whether it comes from the plain key; the reverse where not."""
        return sorted(self._routes)

    def close(self) -> None:
        """End every route. Safe to call twice."""
        self._queue.put(None)
        self._thread.join()
        for watching in self._watching:
            with suppress(zenoh.ZError):
                watching.undeclare()  # type: ignore[no-untyped-call]
        self._watching.clear()
        for end in self._routes.values():
            end()
        self._routes.clear()
        self._node.close()

    def __enter__(self) -> PlainKeyBridge:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- routes ----------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        """Routes stay when a token goes: the endpoint behind it may be back, and an idle route costs nothing."""
        while (sample := self._queue.get()) is not None:
            found = parse_announced(str(sample.key_expr)) if sample.kind == zenoh.SampleKind.PUT else None
            if found is not None:
                self._open(found)

    def _open(self, found: Announced) -> None:
        topic = self._topic(found.key)
        if topic is None or (topic, found.publishes) in self._routes or not self._allows(topic):
            return
        try:
            if found.type_name not in default_catalogue():
                raise UnknownTypeError(
                    f"no interface {found.type_name!r} in the catalogue or in METAROS_INTERFACE_PATH"
                )
            open_route = self._from_plain if found.publishes else self._to_plain
            self._routes[topic, found.publishes] = open_route(topic, found)
        except (MetarosError, zenoh.ZError) as error:
            if (topic, found.type_name) not in self._refused:
                self._refused.add((topic, found.type_name))
                self._notice(f"not bridged: {topic} [{found.type_name}]: {error}")
            return
        self._notice(f"{found.key} {'→' if found.publishes else '←'} {topic} [{found.type_name}]")

    def _from_plain(self, topic: str, found: Announced) -> Callable[[], None]:
        """What DDS publishes, into the ROS graph."""
        durability = Durability.TRANSIENT_LOCAL if found.latched else Durability.VOLATILE
        qos = QoSProfile(depth=_DEPTH, durability=durability)
        publisher = self._node.create_publisher(message_class(found.type_name), topic, qos)
        self._gids[topic] = publisher.gid

        def pass_on(sample: zenoh.Sample) -> None:
            with suppress(MetarosError):  # too large, or closed
                publisher.publish(sample.payload.to_bytes())

        lane, session = RingThread(pass_on, depth=_DEPTH, name=f"metaros{topic}"), self._context.session.check_open()
        subscriber: Any
        if found.latched:
            subscriber = declare_with_history(session, found.key, qos, lane.handler, remote_only=True)
        else:
            subscriber = session.declare_subscriber(found.key, lane.handler, allowed_origin=zenoh.Locality.REMOTE)
        lane.start(subscriber)

        def end() -> None:
            with suppress(zenoh.ZError):
                subscriber.undeclare()
            lane.stop()

        return end

    def _to_plain(self, topic: str, found: Announced) -> Callable[[], None]:
        """What the ROS graph publishes, to DDS; not what came from there."""
        session = self._context.session.check_open()
        publisher: Any
        if found.latched:
            cache = zenoh.ext.CacheConfig(max_samples=1)
            publisher = zenoh.ext.declare_advanced_publisher(session, found.key, cache=cache, publisher_detection=True)
        else:
            publisher = session.declare_publisher(found.key)
        own = self._gids

        def pass_on(data: bytes, info: MessageInfo) -> None:
            if info.gid != own.get(topic):
                with suppress(zenoh.ZError):  # the session goes
                    publisher.put(data)

        durability = Durability.TRANSIENT_LOCAL if found.latched else Durability.VOLATILE
        reliability = Reliability.RELIABLE if found.latched else Reliability.BEST_EFFORT  # which hears everybody
        qos = QoSProfile(depth=_DEPTH, durability=durability, reliability=reliability)
        kind = message_class(found.type_name)
        subscription = self._node.create_subscription(kind, topic, pass_on, qos, raw=True, dedicated=True)

        def end() -> None:
            subscription.close()
            with suppress(zenoh.ZError, RuntimeError):
                publisher.undeclare()

        return end

    def _key(self, topic: str) -> str:
        return "/".join(filter(None, (self._prefix, topic.strip("/"))))

    def _topic(self, key: str) -> str | None:
        """The ROS name of a key; None for one of another prefix, or that is no name."""
        if self._prefix and not key.startswith(f"{self._prefix}/"):
            return None
        try:
            return names.resolve("/" + key.removeprefix(f"{self._prefix}/").strip("/"), "/", "bridge")
        except MetarosError:
            return None
