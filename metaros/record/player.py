"""Plays a recording as live topics: the original names, types, hashes, QoS and bytes, at any speed."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from metaros.errors import ConfigError, MetarosError, RecordingError
from metaros.idl import names, type_hash
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.rosgraph_msgs.msg import Clock as ClockMessage
from metaros.node import Context, Node, RawPublisher
from metaros.record.bag import Bag, BagMessage, BagTopic, open_bag
from metaros.record.playback_clock import PlaybackClock
from metaros.record.type_teller import TypeTeller, recorded_catalogue
from metaros.wire import Congestion, Durability, QoSProfile, Reliability

__all__ = ["Player", "PlayerReport"]

_PROGRESS_S: Final = 0.2
_SLICE_S: Final = 0.1
_CLOCK_QOS: Final = QoSProfile(reliability=Reliability.BEST_EFFORT, depth=1)


@dataclass(frozen=True, slots=True)
class PlayerReport:
    """How far it is: `log_s` into the recording of `total_s`, in round `loop`."""

    messages: int = 0
    log_s: float = 0.0
    total_s: float = 0.0
    loop: int = 1
    paused: bool = False


class Player:
    """Publishes a recording. `play` blocks; `pause` and `resume` may be called from anywhere.

    `rate` 1 is the original speed, 0 as fast as reliable readers take it. `start_s` and `duration_s` choose a piece,
    `topics` (names or globs) what is played, `remap` other names for topics. `clock_hz` publishes /clock with the
    recording's time. `keep_stamps` gives the samples their original source stamps instead of now.
    """

    def __init__(
        self,
        context: Context,
        bag: Bag | str | Path,
        *,
        rate: float = 1.0,
        start_s: float = 0.0,
        duration_s: float | None = None,
        topics: Sequence[str] = (),
        remap: Mapping[str, str] | None = None,
        loop: bool = False,
        clock_hz: float = 0.0,
        keep_stamps: bool = False,
        name: str = "metaros_player",
    ) -> None:
        PlaybackClock(rate)
        if start_s < 0 or clock_hz < 0 or (duration_s is not None and duration_s <= 0):
            raise ConfigError("start and clock rate are 0 or more, a duration is above 0")
        self.bag = bag if isinstance(bag, Bag) else open_bag(bag)
        self._context, self._rate, self._loop, self._keep_stamps = context, rate, loop, keep_stamps
        self._start_ns = self.bag.first_ns + round(start_s * 1e9)
        self._end_ns = self.bag.last_ns + 1 if duration_s is None else self._start_ns + round(duration_s * 1e9)
        self._topics, self._clock_hz = tuple(topics), clock_hz
        self._resumed = threading.Event()
        self._resumed.set()
        self._messages, self._rounds, self._log_ns = 0, 1, self._start_ns
        self._node = Node(name, context=context, enable_rosout=False, enable_parameters=False)
        try:
            self._publishers = self._declare(remap or {})
            self._clock = self._node.create_publisher(ClockMessage, "/clock", _CLOCK_QOS) if clock_hz else None
            self._teller = TypeTeller(self._node, self._publishers)
        except BaseException:
            self._node.close()
            raise

    @property
    def topics(self) -> list[str]:
        """The names it publishes on, /clock left out."""
        return sorted({publisher.topic for publisher in self._publishers.values()})

    @property
    def paused(self) -> bool:
        """Whether it waits for `resume`."""
        return not self._resumed.is_set()

    def pause(self) -> None:
        """Stand still."""
        self._resumed.clear()

    def resume(self) -> None:
        """Go on where it stands."""
        self._resumed.set()

    def report(self) -> PlayerReport:
        """So far."""
        done_s, total_s = (self._log_ns - self._start_ns) / 1e9, max(0, self._end_ns - 1 - self._start_ns) / 1e9
        return PlayerReport(self._messages, done_s, total_s, self._rounds, self.paused)

    def play(
        self,
        *,
        wait_subscriber_s: float = 1.0,
        stop: threading.Event | None = None,
        on_progress: Callable[[PlayerReport], object] | None = None,
    ) -> PlayerReport:
        """Play to the end, or until `stop`; waits up to `wait_subscriber_s` until each topic has a subscription."""
        stop = stop or threading.Event()
        self._wait_for_subscribers(wait_subscriber_s, stop)
        while not stop.is_set():
            sent = self._messages
            self._play_once(stop, on_progress)
            if not self._loop or stop.is_set():
                break
            if self._messages == sent:
                raise RecordingError(f"{self.bag.path}: nothing to play in a loop")
            self._rounds += 1
        return self.report()

    def close(self) -> None:
        """Leave the graph."""
        self._teller.close()
        self._node.close()

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- inside ----------------------------------------------------------------------------------------------------

    def _declare(self, remap: Mapping[str, str]) -> dict[BagTopic, RawPublisher]:
        wanted = {topic for topic in self.bag.chosen(self._topics) if topic.messages}
        if not wanted:
            raise RecordingError(f"{self.bag.path}: no message to play on those topics")
        if foreign := sorted(topic.name for topic in wanted if topic.encoding != "cdr"):
            raise RecordingError(f"{foreign[0]} is not encoded as CDR: choose the topics to play")
        names_of = {_absolute(old): _absolute(new) for old, new in remap.items()}
        unknown = sorted(set(names_of) - {topic.name for topic in wanted})
        if unknown:
            raise ConfigError(f"cannot remap {unknown[0]}: it is not among the topics that are played")
        return {
            topic: self._node.create_raw_publisher(
                names_of.get(topic.name, topic.name),
                topic.type_name,
                _hash_of(topic),
                _play_qos(topic.qos, flat_out=self._rate == 0.0),
            )
            for topic in sorted(wanted, key=lambda topic: topic.name)
        }

    def _play_once(self, stop: threading.Event, on_progress: Callable[[PlayerReport], object] | None) -> None:
        pace, clock = PlaybackClock(self._rate), self._context.clock
        reported_s = clock.monotonic_s()
        for log_ns, message in self._events():
            log_s = (log_ns - self._start_ns) / 1e9
            while (wait_s := pace.wait_s(log_s, now_s=clock.monotonic_s())) > 0.0 or self.paused:
                if stop.wait(min(wait_s, _SLICE_S) if wait_s > 0 else 0.0):
                    return
                if self.paused:
                    self._stand(pace, stop, on_progress)
                if on_progress is not None and clock.monotonic_s() - reported_s >= _PROGRESS_S:
                    reported_s = clock.monotonic_s()
                    on_progress(self.report())
            if stop.is_set():
                return
            self._log_ns = log_ns
            self._send(log_ns, message)
            if on_progress is not None and clock.monotonic_s() - reported_s >= _PROGRESS_S:
                reported_s = clock.monotonic_s()
                on_progress(self.report())

    def _stand(
        self, pace: PlaybackClock, stop: threading.Event, on_progress: Callable[[PlayerReport], object] | None
    ) -> None:
        """Paused: everything is due later by as long as this takes."""
        clock = self._context.clock
        begin_s = clock.monotonic_s()
        if on_progress is not None:
            on_progress(self.report())
        while not stop.is_set() and not self._resumed.wait(_SLICE_S):
            pass
        pace.shift(clock.monotonic_s() - begin_s)

    def _send(self, log_ns: int, message: BagMessage | None) -> None:
        if message is None:
            assert self._clock is not None
            self._clock.publish(ClockMessage(clock=Time(sec=log_ns // 10**9, nanosec=log_ns % 10**9)))
            return
        stamp_ns = message.publish_ns if self._keep_stamps else None
        self._publishers[message.topic].publish(message.data, stamp_ns=stamp_ns)
        self._messages += 1

    def _events(self) -> Iterator[tuple[int, BagMessage | None]]:
        """Messages, and None where /clock is due, by log time."""
        messages = self.bag.messages(self._topics, start_ns=self._start_ns, end_ns=self._end_ns)
        played: Iterator[tuple[int, BagMessage | None]] = ((message.log_ns, message) for message in messages)
        if not self._clock_hz:
            return played
        step_ns = max(1, round(1e9 / self._clock_hz * (self._rate or 1.0)))
        ticks: Iterator[tuple[int, BagMessage | None]] = (
            (log_ns, None) for log_ns in range(self._start_ns, self._end_ns, step_ns)
        )
        return heapq.merge(ticks, played, key=lambda event: event[0])

    def _wait_for_subscribers(self, timeout_s: float, stop: threading.Event) -> None:
        clock, graph = self._context.clock, self._context.graph
        begin_s = clock.monotonic_s()
        while not all(graph.endpoints(topic=topic, kind="MS") for topic in self.topics):
            if clock.monotonic_s() - begin_s >= timeout_s or stop.wait(0.01):
                return


def _absolute(name: str) -> str:
    return names.resolve(name, namespace="/", node="metaros_player")


def _play_qos(offers: list[QoSProfile], *, flat_out: bool) -> QoSProfile:
    """What one publisher offers in place of all: of several offers the one that everybody's subscription takes."""
    qos = offers[0] if offers else QoSProfile()
    if len(offers) > 1:
        reliable = all(offer.reliability is Reliability.RELIABLE for offer in offers)
        latched = all(offer.durability is Durability.TRANSIENT_LOCAL for offer in offers)
        qos = QoSProfile(
            reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
            durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
            depth=max(offer.depth for offer in offers),
        )
    if flat_out and qos.reliability is not Reliability.BEST_EFFORT:
        return replace(qos, congestion=Congestion.BLOCK)
    return qos


def _hash_of(topic: BagTopic) -> str:
    """As recorded; older files of rosbag2 have none, then that of the schema in the file."""
    if topic.type_hash:
        return topic.type_hash
    try:
        return type_hash(topic.type_name, recorded_catalogue(topic))
    except MetarosError as error:
        raise RecordingError(f"cannot play {topic.name}: its type's hash is not known: {error}") from None
