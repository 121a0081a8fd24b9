"""Subscribes local topics: messages are evaluated and stored on one thread, one commit for all that came meanwhile.

A topic whose type nobody names is subscribed as soon as somebody publishes on it; a type that this program does not
know is asked of its publisher. What waits for evaluation is bounded in bytes; the rest is counted and dropped.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import Counter
from collections.abc import Callable
from queue import Empty
from typing import Any, Final, NamedTuple

from metaros.automation.robot.backlog import Backlog, ConditionState, NewEvent
from metaros.automation.robot.evaluator import Evaluator, Verdict
from metaros.automation.robot.event import ReceivedMessage, event_of
from metaros.automation.robot.manifest import Trigger
from metaros.cdr import codec
from metaros.clock import Clock
from metaros.concurrency.waiting import WaitQueue
from metaros.errors import MetarosError
from metaros.idl import type_hash
from metaros.idl.json import to_json
from metaros.limits import LIMITS, Limits
from metaros.node import Node
from metaros.node.introspection import fetch_type
from metaros.wire import Durability, QoSProfile, Reliability
from metaros.wire.attachment import parse_attachment
from metaros.wire.graph import EndpointInfo

__all__ = ["Listener"]

LOG = logging.getLogger("metaros.robot_functions")
AT_ONCE: Final = 256
LOOK_S: Final = 0.5  # between two looks for publishers
DEPTH: Final = 100
UNKNOWN_S: Final = 30.0  # before a type that nobody told is asked for again
Decode = Callable[[bytes], Any]


class _Sample(NamedTuple):
    topic: str
    type_name: str
    decode: Decode
    sample: Any
    size_bytes: int


class Listener:
    """Listens from `start` to `close`. `kept` is called on its thread after each commit that has new events."""

    def __init__(
        self,
        node: Node,
        triggers: tuple[Trigger, ...],
        backlog: Backlog,
        *,
        robot: str,
        clock: Clock,
        kept: Callable[[], object],
        limits: Limits = LIMITS,
    ) -> None:
        self._node, self._backlog, self._robot, self._clock = node, backlog, robot, clock
        self._kept, self._limits = kept, limits
        self._triggers: dict[str, list[Trigger]] = {}
        for trigger in triggers:
            self._triggers.setdefault(node.resolve(trigger.topic), []).append(trigger)
        self._evaluator = Evaluator(triggers, backlog.condition_states(), limits=limits)
        self._received: WaitQueue[_Sample | None] = WaitQueue()
        self._received_bytes = 0
        self._lock = threading.Lock()
        self._again_s: dict[tuple[str, str, str], float] = {}  # what is subscribed, or when it is tried again
        self.dropped: Counter[str] = Counter()  # messages, by topic
        self.malformed: Counter[str] = Counter()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="functions-evaluator", daemon=True)

    def start(self) -> None:
        """Subscribe what can be, and go on looking for the rest."""
        for topic, triggers in self._triggers.items():
            for name in {trigger.type for trigger in triggers if trigger.type}:
                self._subscribe(topic, name, type_hash(name), [])
        self._thread.start()

    def close(self) -> None:
        """Evaluate what was received, then no more."""
        self._closed = True
        self._received.put(None)
        self._thread.join()

    # -- on Zenoh's threads --------------------------------------------------------------------------------------

    def _hear(self, topic: str, type_name: str, decode: Decode, sample: Any) -> None:
        size = len(sample.payload)
        with self._lock:
            if self._received_bytes + size > self._limits.robot_heard_bytes:
                self.dropped[topic] += 1
                return
            self._received_bytes += size
        self._received.put(_Sample(topic, type_name, decode, sample, size))

    # -- on the judging thread -----------------------------------------------------------------------------------

    def _run(self) -> None:
        looked_s = -LOOK_S
        while True:
            some, ends = self._take(looked_s + LOOK_S)
            now_s = self._clock.monotonic_s()
            try:
                self._evaluate_all(some)
                if not ends and now_s - looked_s >= LOOK_S:
                    looked_s = now_s
                    self._look()
            except Exception:  # the disk refuses: what was received in this round is lost, and said so
                LOG.exception("%d messages could not be kept", len(some))
            if ends:
                return

    def _take(self, until_s: float) -> tuple[list[_Sample], bool]:
        """What has come, after waiting for it, for a timer, or for the time to look round."""
        timeout_s = max(0.0, until_s - self._clock.monotonic_s())
        due_ns = self._evaluator.next_ns()
        if due_ns is not None:
            timeout_s = min(timeout_s, max(0.0, (due_ns - self._clock.wall_ns()) / 1e9))
        found: list[_Sample | None] = []
        try:
            found.append(self._received.get(timeout_s))
            while len(found) < AT_ONCE and found[-1] is not None:
                found.append(self._received.get_nowait())
        except Empty:
            pass
        some = [one for one in found if one is not None]
        with self._lock:
            self._received_bytes -= sum(one.size_bytes for one in some)
        return some, len(some) < len(found)

    def _evaluate_all(self, some: list[_Sample]) -> None:
        now_ns = self._clock.wall_ns()
        verdicts = [self._evaluator.elapse(now_ns)]
        for one in some:
            received = self._read(one)
            if received is not None:
                event = event_of(received, robot=self._robot)
                verdicts += [self._evaluator.evaluate(each, event, now_ns) for each in self._of(received)]
        puts, condition_states = _joined(verdicts)
        if (puts or condition_states) and self._backlog.keep(puts, condition_states):
            self._kept()

    def _of(self, received: ReceivedMessage) -> list[Trigger]:
        return [each for each in self._triggers[received.topic] if each.type in ("", received.type)]

    def _read(self, one: _Sample) -> ReceivedMessage | None:
        try:
            about = parse_attachment(bytes(one.sample.attachment or b""))
            message = to_json(one.decode(bytes(one.sample.payload)))
        except MetarosError as error:
            self.malformed[one.topic] += 1
            LOG.debug("a message on %s: %s", one.topic, error)
            return None
        return ReceivedMessage(
            topic=one.topic,
            type=one.type_name,
            stamp_ns=about.source_ns,
            seq=about.seq,
            gid=about.gid,
            message=message,
        )

    # -- subscribing ---------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Subscribe the topics that somebody publishes by now."""
        for topic, triggers in self._triggers.items():
            publishers = self._node.graph.endpoints(topic, "MP")
            named = {trigger.type for trigger in triggers}
            for end in publishers:
                if "" in named or end.type_name in named:
                    self._subscribe(topic, end.type_name, end.type_hash, publishers)

    def _subscribe(self, topic: str, name: str, hash_text: str, publishers: list[EndpointInfo]) -> None:
        key, now_s = (topic, name, hash_text), self._clock.monotonic_s()
        if now_s < self._again_s.get(key, now_s):
            return
        try:
            decode = codec(name, fetch_type(self._node, name, hash_text)).decode
        except MetarosError as error:
            self._again_s[key] = now_s + UNKNOWN_S
            LOG.warning("%s is not listened to: %s", topic, error)
            return
        self._again_s[key] = math.inf

        def sink(sample: Any) -> None:
            self._hear(topic, name, decode, sample)

        self._node.create_raw_subscription(topic, name, hash_text, _qos(publishers), sink)


def _qos(publishers: list[EndpointInfo]) -> QoSProfile:
    """What matches every publisher, and has the last message of those that keep it."""
    offered = [publisher.qos for publisher in publishers]
    latched = bool(offered) and all(qos.durability is Durability.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        reliability=Reliability.RELIABLE if latched else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
        depth=DEPTH,
    )


def _joined(verdicts: list[Verdict]) -> tuple[list[NewEvent], list[ConditionState]]:
    """All of them as one; of one group's memories the last counts."""
    puts = [put for verdict in verdicts for put in verdict.puts]
    condition_states = {(one.trigger, one.part): one for verdict in verdicts for one in verdict.condition_states}
    return puts, list(condition_states.values())
