"""What one client subscribes to: several subscriptions of a topic merge into one, as rosbridge merges them.

The least `throttle_rate`, `queue_length` and `fragment_size` win, and of compressions the later of none, png, cbor and
cbor-raw. The client gets a topic's messages once, under the name that it uses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import count

from gateway.api.robot_access import RobotAccess
from gateway.api.rosbridge.dialect import fault_of
from gateway.api.rosbridge.encodings import encoding_of
from gateway.api.rosbridge.requests import COMPRESSIONS, Shape, Subscribe
from gateway.domain.channel import Channel
from gateway.errors import InvalidRequestError, TooManyError
from gateway.fleet.ros.types import full_type_name
from gateway.live.encoding import Block, Encoding
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer
from metaros.limits import LIMITS

__all__ = ["CountedSubscription", "Subscriptions", "merged"]

QUEUE_BYTES = 1024 * 1024
MAX_RATE_HZ = 1000.0
Warn = Callable[[str, str | None], None]  # a text, and the id that it is about


class CountedSubscription(TopicSubscription):
    """Waits in order like any queue, and holds at most `length` messages: the oldest are dropped."""

    def __init__(
        self,
        number: int,
        wants: Callable[[Channel], bool],
        encoding: Callable[[Channel], Encoding],
        *,
        length: int,
        max_rate_hz: float = 0.0,
    ) -> None:
        super().__init__(number, wants, encoding, max_rate_hz=max_rate_hz, queue_bytes=QUEUE_BYTES)
        self._length = length

    def hold(self, block: Block, encoding: Encoding) -> int:
        """See TopicSubscription."""
        grown = super().hold(block, encoding)
        while sum(len(waiting.records) for waiting, _ in self._waiting) - self._start > self._length:
            grown -= self.drop_oldest()
        return grown


def merged(wanted: Iterable[Subscribe]) -> tuple[float, int, Shape]:
    """(throttle_s, queue_length, shape) of all subscriptions of a client to one topic."""
    several = list(wanted)
    sizes = [item.shape.fragment_size for item in several if item.shape.fragment_size is not None]
    compression = max((item.shape.compression for item in several), key=COMPRESSIONS.index)
    shape = Shape(fragment_size=min(sizes, default=None), compression=compression)
    return min(item.throttle_s for item in several), min(item.queue_length for item in several), shape


class Subscriptions:
    """Of one client."""

    def __init__(self, access: RobotAccess, viewer: Viewer, warn: Warn) -> None:
        self._access = access
        self._viewer = viewer
        self._warn = warn
        self._numbers = count(1)
        self._wanted: dict[str, dict[str | None, Subscribe]] = {}  # by the client's topic, by its id
        self._running: dict[str, tuple[int, tuple[float, int, Shape]]] = {}
        self._topics: dict[int, str] = {}

    def subscribe(self, request: Subscribe) -> None:
        """One more, or another one under the same id.

        Raises:
            InvalidRequestError: the topic is of another type.
            UnknownRobotError: the topic is no robot's that the client sees.
            TooManyError: it has so many.
        """
        if request.type_name:
            self._check_type(request.topic, full_type_name(request.type_name, "msg"))
        else:
            self._access.find_topic(request.topic)
        known = self._wanted.get(request.topic, {})
        if request.id not in known and sum(map(len, self._wanted.values())) >= LIMITS.subscriptions_per_viewer:
            raise TooManyError(f"a client has at most {LIMITS.subscriptions_per_viewer} subscriptions")
        self._wanted.setdefault(request.topic, {})[request.id] = request
        self._settle(request.topic)

    def unsubscribe(self, topic: str, name: str | None) -> None:
        """End one, or without an id all to the topic; InvalidRequestError where there is none."""
        known = self._wanted.get(topic)
        if not known or (name is not None and name not in known):
            raise InvalidRequestError(f"there is no subscription {name or ''!r} to {topic}")
        if name is None:
            known.clear()
        else:
            del known[name]
        self._settle(topic)

    def on_dropped(self, number: int, lost: int, total: int) -> None:
        """Samples of a subscription were lost, as the client takes too little."""
        topic = self._topics.get(number)
        if topic is not None:
            self._warn(f"{topic}: {lost} messages were dropped, as you take too few; {total} so far", None)

    def _settle(self, topic: str) -> None:
        """See to it that the viewer has what the topic's subscriptions are together."""
        several = self._wanted.get(topic)
        options = merged(several.values()) if several else None
        number, running = self._running.get(topic, (0, None))
        if options == running:
            return
        if number:
            self._viewer.unsubscribe(number)
            del self._running[topic], self._topics[number]
        if options is None:
            self._wanted.pop(topic, None)
            return
        number = next(self._numbers)
        self._running[topic], self._topics[number] = (number, options), topic
        self._viewer.subscribe(self._made(number, topic, options))

    def _made(self, number: int, topic: str, options: tuple[float, int, Shape]) -> TopicSubscription:
        throttle_s, length, shape = options
        rate_hz = min(1.0 / throttle_s, MAX_RATE_HZ) if throttle_s > 0 else 0.0
        wants, encoding = self._wants(topic, shape), encoding_of(topic, shape)
        if length <= 1 and (rate_hz or length):
            return TopicSubscription(number, wants, lambda _: encoding, max_rate_hz=rate_hz, latest=True)
        if length:
            return CountedSubscription(number, wants, lambda _: encoding, max_rate_hz=rate_hz, length=length)
        return TopicSubscription(number, wants, lambda _: encoding, queue_bytes=QUEUE_BYTES)

    def _wants(self, topic: str, shape: Shape) -> Callable[[Channel], bool]:
        """Asked once per channel: the topic's, of its type, and of a kind that can be shown."""
        names = self._access.names
        types = {full_type_name(item.type_name, "msg") for item in self._wanted[topic].values() if item.type_name}

        def wants(channel: Channel) -> bool:
            if channel.history or not names.covers(channel.robot):
                return False
            if (channel.robot, channel.topic) not in names.candidates(topic):
                return False
            _, likelier = self._access.find_topic(topic)
            if likelier is not None and likelier.topic != channel.topic:  # two of the robot have one name in the fleet
                return False
            if types and channel.schema_name not in types:
                return False
            fault = "" if shape.compression == "cbor-raw" else fault_of(channel)
            if fault:
                self._warn(f"{topic} cannot be shown: {fault}", None)
            return not fault

        return wants

    def _check_type(self, topic: str, type_name: str) -> None:
        _, channel = self._access.find_topic(topic)
        if channel is not None and channel.schema_name != type_name:
            raise InvalidRequestError(f"{topic} has type {channel.schema_name}, and you say {type_name}")
