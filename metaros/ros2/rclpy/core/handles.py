"""What stands behind rclpy's nodes, publishers and subscriptions: the library's own, with rclpy's methods of handles.

`with handle:` keeps them, as in rclpy, where the library's own objects would close.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from metaros.cdr import codec
from metaros.errors import PeerError
from metaros.executor import CallbackGroup, ChannelMailbox
from metaros.node.arguments import NodeArguments
from metaros.node.context import Context as NativeContext
from metaros.node.core import NodeCore
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.node.node import Node as NativeNode
from metaros.node.parameters import make_parameters
from metaros.node.publisher import Publisher as NativePublisher
from metaros.node.subscription import Subscription as NativeSubscription
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.wire import QoSProfile
from metaros.wire.attachment import parse_attachment

__all__ = ["NodeHandle", "PublisherHandle", "Resolved", "SubscriptionHandle", "info_dict"]


class Resolved(str):
    """A topic's or service's full name: expanded and remapped, so that nobody does it again."""

    __slots__ = ()


class NodeHandle(Destroyable, NativeNode):
    """A node of the graph without parameters of its own: those are rclpy's."""

    def __init__(self, arguments: NodeArguments, *, context: NativeContext, rclpy_context: Context) -> None:
        self.rclpy_context = rclpy_context
        self.abandoned = False
        self._by_itself = 0
        self.parameters = make_parameters(arguments.full_name)
        NodeCore.__init__(self, arguments, context=context, use_sim_time=False, nice=0, critical=False)

    def made(self) -> None:
        """Everything that a node has by itself is there: what comes now, its program wants."""
        self._by_itself = len(self._endpoints)

    def abandon(self) -> None:
        """Nobody has the node any more: leave the graph soon, unless somebody may still use what it created.

        It runs where the garbage collector does, in the middle of anything: it takes no lock and closes nothing.
        """
        if len(self._endpoints) <= self._by_itself:
            self.abandoned = True
            self.rclpy_context.close_soon(self)

    def resolve(self, name: str, *, service: bool = False) -> str:
        """The full name; one that is resolved stays."""
        return name if isinstance(name, Resolved) else super().resolve(name, service=service)

    def start_rosout(self, qos: QoSProfile) -> Callable[..., None]:
        """Publish on /rosout; `publish(stamp_ns=…, level=…, name=…, msg=…, file=…, function=…, line=…)`."""
        publish = self._rosout(qos)
        self._logger.publish_with(publish)
        return publish

    def get_node_name(self) -> str:
        """The name without its namespace."""
        return self.name

    def get_namespace(self) -> str:
        """The namespace."""
        return self.namespace

    def get_fully_qualified_name(self) -> str:
        """Both."""
        return self.full_name

    def logger_name(self) -> str:
        """The full name with dots."""
        return self.full_name.lstrip("/").replace("/", ".")

    def get_count_publishers(self, topic: str) -> int:
        """Publishers in the graph on a full name."""
        return len(self.graph.endpoints(topic, "MP"))

    def get_count_subscribers(self, topic: str) -> int:
        """Subscriptions in the graph on a full name."""
        return len(self.graph.endpoints(topic, "MS"))

    def get_count_clients(self, service: str) -> int:
        """Clients in the graph of a full name."""
        return len(self.graph.endpoints(service, "SC"))

    def get_count_services(self, service: str) -> int:
        """Servers in the graph of a full name."""
        return len(self.graph.endpoints(service, "SS"))

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Every node in the graph."""
        return [(node.name, node.namespace) for node in self.graph.nodes()]


class PublisherHandle(Destroyable, NativePublisher):
    """A publisher; QoS events go to `events`."""

    def __init__(
        self,
        node: NodeCore,
        message_type: type[Any],
        topic: str,
        qos: QoSProfile,
        events: PublisherEvents | None = None,
        event_handlers: list[Any] | None = None,
    ) -> None:
        self.event_handlers = event_handlers or []  # of rclpy, which `events` calls
        NativePublisher.__init__(self, node, message_type, topic, codec(message_type), qos, events)

    def get_subscription_count(self) -> int:
        """Subscriptions that match."""
        return self.events.matched

    def get_topic_name(self) -> str:
        """The full name."""
        return self.topic

    def get_logger_name(self) -> str:
        """That of the node's logger."""
        return self.node.get_logger().name


class SubscriptionHandle(Destroyable, NativeSubscription):
    """A subscription whose callback's errors go to the executor; samples may also be taken one by one.

    `dedicated` calls back on a thread of its own, for who waits for a message without spinning.
    """

    def __init__(
        self,
        node: NodeCore,
        message_type: type[Any],
        topic: str,
        qos: QoSProfile,
        callback: Callable[..., Any],
        *,
        raw: bool = False,
        events: SubscriptionEvents | None = None,
        group: CallbackGroup | None = None,
        dedicated: bool = False,
        event_handlers: list[Any] | None = None,
    ) -> None:
        self.event_handlers = event_handlers or []  # of rclpy, which `events` calls
        code = codec(message_type)
        self._decoders = {True: bytes, False: code.decode}
        NativeSubscription.__init__(
            self,
            node,
            topic,
            code.name,
            code.hash,
            qos,
            callback,
            decode=self._decoders[raw],
            dedicated=dedicated,
            events=events,
            group=group,
            raises=True,
        )

    def replace_callback(self, callback: Callable[..., Any], *, with_info: bool) -> None:
        """Call this one from now on."""
        self.callback = callback
        self._receiver.replace(callback, with_info=with_info)

    def take_message(self, message_type: type[Any], raw: bool) -> tuple[Any, dict[str, Any]] | None:
        """The oldest sample that no executor has taken, and its info; None where none has come."""
        del message_type  # it is known
        self.node.ingress.collect()
        mailbox = self.mailboxes[-1]
        pending = mailbox.pending
        while True:
            if mailbox.late_s:
                mailbox.drop_late()
            if isinstance(mailbox, ChannelMailbox) and not pending:
                self.node.ingress.refill(mailbox)
            try:
                sample = pending.popleft()
            except IndexError:
                return None
            try:
                attachment = sample.attachment
                sent = parse_attachment(b"" if attachment is None else attachment.to_bytes())
                message = self._decoders[raw](sample.payload.to_bytes())
            except PeerError:
                continue  # as an executor would: what cannot be read is none
            return message, info_dict(sent.source_ns, self.node.context.clock.wall_ns(), sent.seq)

    def get_publisher_count(self) -> int:
        """Publishers that match."""
        return self.events.matched

    def get_topic_name(self) -> str:
        """The full name."""
        return self.topic

    def get_logger_name(self) -> str:
        """That of the node's logger."""
        return self.node.get_logger().name


def info_dict(source_ns: int, received_ns: int, seq: int) -> dict[str, Any]:
    """What rclpy tells of a message: times in nanoseconds since the epoch, the publisher's count."""
    return {
        "source_timestamp": source_ns,
        "received_timestamp": received_ns,
        "publication_sequence_number": seq,
        "reception_sequence_number": None,
    }
