"""Subscriptions: typed or raw bytes, on the executor or on a thread of their own; and bare taps for agents."""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from metaros.errors import UsageError
from metaros.executor import CHANNEL, CallbackGroup, ChannelMailbox, Mailbox
from metaros.limits import LIMITS
from metaros.node.bell import Bell
from metaros.node.core import NodeCore
from metaros.node.dedicated_threads import ChannelThread, RingThread, feed, handle_each
from metaros.node.endpoint import Endpoint
from metaros.node.events.callbacks import SubscriptionEvents
from metaros.node.events.subscription_monitor import SubscriptionMonitor
from metaros.node.info import takes
from metaros.node.key_subscribers import declare_with_history
from metaros.node.mixed.lanes import handle_accepted, receive_accepted, run_accepted
from metaros.node.mixed.twin_key import TwinKey
from metaros.node.receiver import Receiver
from metaros.wire import Durability, History, QoSProfile

__all__ = ["RawSubscription", "Subscription"]


_OVERHEAD_BYTES = 512  # what Zenoh and Python keep beside a sample's payload
_WEIGHED = 256  # samples of a queue whose size is looked at; the rest is taken to be like them


def sample_bytes(sample: zenoh.Sample) -> int:
    """What a waiting sample weighs."""
    return len(sample.payload) + _OVERHEAD_BYTES


class Subscription(Endpoint):
    """Calls `callback(message)` or `callback(message, info)` for each sample.

    `lost` counts samples that the publishers sent and that never arrived, `dropped` those that arrived and were
    pushed out by newer ones while callbacks were busy, `expired` those that outlived their lifespan, `malformed` those
    that could not be read. `events` counts the rest. With `raises` what the callback raises goes to the executor,
    where else it is logged.
    """

    events: SubscriptionMonitor

    def __init__(
        self,
        node: NodeCore,
        topic: str,
        type_name: str,
        type_hash: str,
        qos: QoSProfile,
        callback: Callable[..., Any],
        *,
        decode: Callable[[bytes], Any],
        dedicated: bool,
        events: SubscriptionEvents | None = None,
        group: CallbackGroup | None = None,
        raises: bool = False,
    ) -> None:
        super().__init__(node, "MS", topic, type_name, type_hash, qos)
        self.callback = callback
        is_async = inspect.iscoroutinefunction(callback)
        if is_async and dedicated:
            raise UsageError("a dedicated subscription has its own thread; its callback cannot be an async def")
        self._receiver = Receiver(
            decode=decode,
            callback=callback,
            with_info=takes(callback, 1, 2) == 2,
            clock=node.context.clock,
            name=self.topic,
            report=self.report_once,
            on_lost=self._report_lost,
            dropped=lambda: self.dropped,
            raises=raises,
        )
        keeps_all, latched = qos.history is History.KEEP_ALL, qos.durability is Durability.TRANSIENT_LOCAL
        channelled = keeps_all and not dedicated and not latched
        self._mailbox = self._new_mailbox(ChannelMailbox if channelled else Mailbox, group)
        pending = self._mailbox.pending
        self.events = SubscriptionMonitor(
            self, events, on_inspect=self._receiver.inspect, waiting=lambda: bool(pending)
        )
        self.mailboxes = [self._mailbox]  # where samples wait
        self.mailboxes_hold_all = not dedicated  # a lane's samples wait in Zenoh's memory, which tells nothing
        self.on_close(self._mailbox.clear)
        node.context.drops.add(self._row)
        self.on_close(lambda: node.context.drops.discard(self._row))
        if is_async:
            node.ingress.async_work = True
        if channelled:
            self._listen_to_channel(self.key)
            self.speak_both(self._listen_to_channel, with_the_first=True)
        elif keeps_all:
            self._listen_to_all(dedicated=dedicated)
        elif dedicated:
            self._listen_to_ring()
        else:
            self._listen(self.key)
            self.speak_both(self._listen, with_the_first=True)
        self.announce()

    def _new_mailbox(self, kind: type[Mailbox], group: CallbackGroup | None) -> Mailbox:
        return kind(
            self._receiver.handle,
            owner=self.node,
            depth=None if self.qos.history is History.KEEP_ALL else self.qos.depth,
            limit_bytes=LIMITS.ingress_bytes,
            size_of=sample_bytes,
            group=group,
        )

    @property
    def lost(self) -> int:
        """Samples that were sent and never arrived here, by their sequence numbers."""
        return self._receiver.lost

    @property
    def malformed(self) -> int:
        """Samples without a sound attachment or payload, or over the size limit."""
        return self._receiver.malformed

    @property
    def dropped(self) -> int:
        """Samples that arrived and were pushed out of the history by newer ones."""
        return self._mailbox.dropped

    @property
    def expired(self) -> int:
        """Samples that came, or came to their turn, after their lifespan."""
        return self.events.expired

    def _row(self) -> dict[str, object]:
        """What `metaros top` shows."""
        queues = [list(mailbox.pending) for mailbox in self.mailboxes]  # copied in one step of the interpreter
        return {
            "node": self.node.full_name,
            "topic": self.topic,
            "depth": self._mailbox.depth,
            "queued": sum(map(len, queues)) if self.mailboxes_hold_all else None,
            "queued_bytes": sum(map(_weight, queues)) if self.mailboxes_hold_all else None,
            "dropped": self.dropped,
            "lost": self.lost,
            "expired": self.expired,
            "malformed": self.malformed,
        }

    def _report_lost(self, total: int, change: int, gid: bytes) -> None:
        self.events.missing(total, change, gid)

    def _listen(self, key: str) -> None:
        """Through the ingress to the executor."""
        context = self.node.context
        if self.qos.durability is not Durability.TRANSIENT_LOCAL and key == self.key:
            self.on_close(context.key_subscribers.listen(key, self._mailbox))
            return
        sink = context.ingress.put_to(self._mailbox)
        if self.twin is not None and key != self.key:
            sink = self.twin.pass_on(sink)
        self.on_close(self._declare(key, zenoh.handlers.Callback(sink, indirect=False)).undeclare)

    def _listen_to_channel(self, key: str) -> None:
        """Through a channel in Zenoh's memory, whose publishers wait while it is full, to the executor."""
        ingress, mailbox, twin = self.node.context.ingress, self._mailbox, self.twin
        assert isinstance(mailbox, ChannelMailbox)
        channel = self._declare(key, zenoh.handlers.FifoChannel(CHANNEL))
        self.on_close(channel.undeclare)
        # The bell comes second: Zenoh serves the subscribers of a key in the order in which they were declared.
        bell = Bell(lambda: self._declare(key, zenoh.handlers.Callback(ingress.put_to(mailbox), indirect=False)))
        receive = channel.handler.try_recv
        accepted = receive if twin is None or key == self.key else receive_accepted(twin, receive)
        ingress.attach(mailbox, accepted, bell.turn)
        self.on_close(lambda: ingress.detach(mailbox))
        self.on_close(bell.close)

    def _listen_to_ring(self) -> None:
        """Through Zenoh's ring with a thread of its own, which handles the samples."""
        handle = self._receiver.handle

        def make(twin: TwinKey | None) -> RingThread:
            chosen = handle if twin is None else handle_accepted(twin, handle)
            return RingThread(chosen, depth=self.qos.depth, name=f"metaros{self.topic}")

        self._start_lanes(make)

    def _listen_to_all(self, *, dedicated: bool) -> None:
        """Through a channel with a thread of its own, which handles the samples or feeds the executor."""
        handle = self._receiver.handle
        if dedicated:
            run = handle_each(handle)
        else:
            executors = self._mailbox.like()
            self.mailboxes.append(executors)
            run = feed(self.node.ingress, executors, lambda: self.closed)
            self.on_close(executors.clear)

        def make(twin: TwinKey | None) -> ChannelThread:
            if twin is None:
                return ChannelThread(run, self._mailbox, name=f"metaros{self.topic}")
            return ChannelThread(run_accepted(twin, run), self._mailbox.like(), name=f"metaros{self.topic}")

        self._start_lanes(make)

    def _start_lanes(self, make: Callable[[TwinKey | None], ChannelThread | RingThread]) -> None:
        """A lane, and a second one for the twin key: what they handle they handle one at a time."""
        first = make(None)
        self._start_lane(first, self.key)

        def start_twin(key: str) -> None:
            second, turn = make(self.twin), threading.Lock()
            first.take_turns(turn)
            second.take_turns(turn)
            self._start_lane(second, key)

        self.speak_both(start_twin, with_the_first=True)

    def _declare(self, key: str, handler: Any) -> Any:
        """On the twin key nothing of our own session is heard, which speaks on both."""
        self._receiver.two_keys = key != self.key
        session = self.node.context.session.check_open()
        if self.qos.durability is Durability.TRANSIENT_LOCAL:
            return declare_with_history(session, key, self.qos, handler, remote_only=key != self.key)
        origin = zenoh.Locality.ANY if key == self.key else zenoh.Locality.REMOTE
        return session.declare_subscriber(key, handler, allowed_origin=origin)

    def _start_lane(self, lane: ChannelThread | RingThread, key: str) -> None:
        subscriber = self._declare(key, lane.handler)
        lane.start(subscriber)
        self.on_close(lane.stop)
        self.on_close(subscriber.undeclare)


def _weight(samples: list[zenoh.Sample]) -> int:
    newest = samples[-_WEIGHED:]
    return sum(len(sample.payload) for sample in newest) * len(samples) // max(1, len(newest))


class RawSubscription(Endpoint):
    """Hands every sample to `sink` on a Zenoh thread, unread: for agents and tools.

    The sink must be as cheap as a queue's put; it must never block. Where the program itself publishes to the topic it
    runs on the publishing thread, too: there only a C function cannot lose a Ctrl-C
    (see `metaros.concurrency.native_callbacks`).
    """

    def __init__(
        self,
        node: NodeCore,
        topic: str,
        type_name: str,
        type_hash: str,
        qos: QoSProfile,
        sink: Callable[[zenoh.Sample], object],
    ) -> None:
        super().__init__(node, "MS", topic, type_name, type_hash, qos)
        session = node.context.session.check_open()
        callback = zenoh.handlers.Callback(sink, indirect=False)
        if qos.durability is Durability.TRANSIENT_LOCAL:
            subscriber: Any = declare_with_history(session, self.key, qos, callback)
        else:
            subscriber = session.declare_subscriber(self.key, callback)
        self.on_close(subscriber.undeclare)
        self.announce()
