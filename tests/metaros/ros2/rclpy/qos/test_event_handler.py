"""Events of publishers and subscriptions: which callbacks there are, what they are told, and what is warned of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.executor import MutuallyExclusiveCallbackGroup
from metaros.node.events import (
    DeadlineMissed,
    LivelinessChanged,
    LivelinessLost,
    Matched,
    MessageLost,
    QoSIncompatible,
    TypeMismatch,
)
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.qos import qos_event
from metaros.ros2.rclpy.qos.event_handler import (
    EventHandler,
    PublisherEventCallbacks,
    QoSEventHandler,
    QoSPublisherEventType,
    QoSSubscriptionEventType,
    SubscriptionEventCallbacks,
    UnsupportedEventTypeError,
    publisher_events,
    subscription_events,
)
from metaros.ros2.rclpy.qos.event_types import (
    IncompatibleTypeInfo,
    QoSLivelinessChangedInfo,
    QoSLivelinessLostInfo,
    QoSMessageLostInfo,
    QoSOfferedDeadlineMissedInfo,
    QoSOfferedIncompatibleQoSInfo,
    QoSPublisherMatchedInfo,
    QoSRequestedDeadlineMissedInfo,
)
from metaros.ros2.rclpy.qos.policies import DurabilityPolicy, QoSPolicyKind
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface

TEXT = "std_msgs/msg/String"
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WHERE: dict[str, Any] = {"topic": "/t", "node": "/n"}
COUNT: dict[str, Any] = {**WHERE, "total": 5, "change": 2}
P, S = QoSPublisherEventType, QoSSubscriptionEventType
TYPES: dict[str, Any] = {"type_name": "a/msg/A", "type_hash": "1", "peer_type_name": "a/msg/B", "peer_type_hash": "2"}
# What this library's events become.
INFOS: list[tuple[Any, Any, Any]] = [
    (P.RCL_PUBLISHER_OFFERED_DEADLINE_MISSED, DeadlineMissed(**COUNT), QoSOfferedDeadlineMissedInfo(5, 2)),
    (P.RCL_PUBLISHER_LIVELINESS_LOST, LivelinessLost(**COUNT), QoSLivelinessLostInfo(5, 2)),
    (
        P.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS,
        QoSIncompatible(**COUNT, policies=("reliability", "durability"), reason=""),
        QoSOfferedIncompatibleQoSInfo(5, 2, QoSPolicyKind.DURABILITY),
    ),
    (
        P.RCL_PUBLISHER_INCOMPATIBLE_TYPE,
        TypeMismatch(**COUNT, **TYPES),
        IncompatibleTypeInfo(5, 2, "/n has a/msg/B, here it is a/msg/A"),
    ),
    (
        P.RCL_PUBLISHER_MATCHED,
        Matched(**COUNT, current=3, current_change=-1),
        QoSPublisherMatchedInfo(5, 2, 3, -1),
    ),
    (S.RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED, DeadlineMissed(**COUNT), QoSRequestedDeadlineMissedInfo(5, 2)),
    (
        S.RCL_SUBSCRIPTION_LIVELINESS_CHANGED,
        LivelinessChanged(**WHERE, alive=1, alive_change=2, not_alive=3, not_alive_change=4),
        QoSLivelinessChangedInfo(alive_count=1, not_alive_count=3, alive_count_change=2, not_alive_count_change=4),
    ),
    (S.RCL_SUBSCRIPTION_MESSAGE_LOST, MessageLost(**COUNT), QoSMessageLostInfo(5, 2)),
]


@pytest.fixture(name="node")
def _node(rclpy_context: Context) -> Iterator[Node]:
    with Node("watcher", context=rclpy_context) as node:
        yield node


@pytest.fixture(name="spin_until")
def _spin_until(node: Node, rclpy_context: Context) -> Iterator[Callable[[Callable[[], object]], None]]:
    executor = SingleThreadedExecutor(context=rclpy_context)
    executor.add_node(node)

    def until(condition: Callable[[], object]) -> None:
        for _ in range(600):
            if condition():
                return
            executor.spin_once(timeout_sec=0.1)
        raise AssertionError("not so in time")

    yield until
    executor.shutdown()


def test_events_are_told_in_rclpys_words() -> None:
    wrong = []
    for event_type, event, expected in INFOS:
        heard: list[Any] = []
        EventHandler(callback_group=None, callback=heard.append, event_type=event_type).deliver(event)
        if heard != [expected]:
            wrong.append((event_type.name, heard))
    assert wrong == []


def test_each_callback_has_a_handler(node: Node) -> None:
    group = MutuallyExclusiveCallbackGroup()
    every: list[tuple[Any, Any, str]] = [
        (PublisherEventCallbacks, publisher_events, "deadline liveliness matched incompatible_qos incompatible_type"),
        (
            SubscriptionEventCallbacks,
            subscription_events,
            "deadline liveliness message_lost matched incompatible_qos incompatible_type",
        ),
    ]
    for kind, native, names in every:
        callbacks = kind()
        assert len(callbacks.create_event_handlers(group, node.handle, "t")) == 2  # the warnings
        for number, name in enumerate(names.split(), 3):
            setattr(callbacks, name, lambda _: None)
            handlers = callbacks.create_event_handlers(group, node.handle, "t")
            assert len(handlers) == min(number, len(names.split())), name
            assert {handler.callback_group for handler in handlers} == {group}
        events = native(handlers, group)
        assert events.group is group
        assert all(getattr(events, field) is not None for field in events.__dataclass_fields__)
        silent = kind(use_default_callbacks=False).create_event_handlers(group, node.handle, "t")
        assert silent == []
        quiet = native(silent)  # nobody is warned then, by the library neither
        assert quiet.incompatible_qos(None) is quiet.type_hash_mismatch(None) is None


def test_what_does_not_fit_is_warned_of(
    node: Node, spin_until: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    node.create_publisher(interface(TEXT), "odd", 1)
    node.create_subscription(interface(TEXT), "odd", lambda _: None, KEPT)
    node.create_subscription(interface("std_msgs/msg/Int32"), "odd", lambda _: None, 1)
    text = ""

    def said(*words: str) -> bool:
        nonlocal text
        text += capsys.readouterr().err
        return all(word in text for word in words)

    spin_until(
        lambda: said(
            "[watcher]: New subscription discovered on topic 'odd', requesting incompatible QoS.",
            "[watcher]: New publisher discovered on topic 'odd', offering incompatible QoS.",
            "Last incompatible policy: DURABILITY",
            "On Zenoh, as with rmw_zenoh, messages pass all the same",  # once in a process
            "Incompatible type on topic 'odd', no messages will be sent to it: /watcher has std_msgs/msg/Int32",
        )
    )
    assert text.count("New subscription discovered") == text.count("New publisher discovered") == 1


def test_callbacks_run_on_the_executor(node: Node, spin_until: Callable[..., None]) -> None:
    heard: list[Any] = []

    async def matched(info: QoSPublisherMatchedInfo) -> None:
        heard.append(info)

    soon = QoSProfile(depth=1, deadline=Duration(nanoseconds=1e6))
    publisher = node.create_publisher(
        interface(TEXT), "met", soon, event_callbacks=PublisherEventCallbacks(matched=matched, deadline=heard.append)
    )
    subscription = node.create_subscription(interface(TEXT), "met", lambda _: None, 1)
    spin_until(lambda: QoSPublisherMatchedInfo(1, 1, 1, 1) in heard)
    publisher.publish(interface(TEXT)(data="x"))
    spin_until(lambda: any(isinstance(info, QoSOfferedDeadlineMissedInfo) for info in heard))
    node.destroy_subscription(subscription)
    spin_until(lambda: QoSPublisherMatchedInfo(1, 0, 0, -1) in heard)


def test_what_a_callback_raises_comes_out_of_spin(node: Node, spin_until: Callable[..., None]) -> None:
    def fail(_: Any) -> None:
        raise RuntimeError("the callback's own")

    node.create_publisher(interface(TEXT), "met", 1, event_callbacks=PublisherEventCallbacks(matched=fail))
    node.create_subscription(interface(TEXT), "met", lambda _: None, 1)
    with pytest.raises(RuntimeError, match="the callback's own"):
        spin_until(lambda: False)


def test_old_names_warn() -> None:
    with pytest.warns(DeprecationWarning, match="use EventHandler"):
        handler = QoSEventHandler(callback_group=None, callback=print, event_type=P.RCL_PUBLISHER_MATCHED)
    handler.destroy()
    assert handler.deliver(object()) is None
    with pytest.warns(UserWarning, match="import 'event_handler' instead"):
        from metaros.ros2.rclpy.qos.qos_event import PublisherEventCallbacks as Old
    assert Old is PublisherEventCallbacks
    assert not hasattr(qos_event, "Duration")
    with pytest.raises(UnsupportedEventTypeError):
        EventHandler(callback_group=None, callback=print, event_type=17)  # type: ignore[arg-type]
