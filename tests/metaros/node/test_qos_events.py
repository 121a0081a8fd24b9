"""Quality of service between two sessions: what each end is told, and what it is spared."""

from __future__ import annotations

import dataclasses
import sys
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import zenoh
import zenoh.ext

import metaros
from metaros.clock import ManualClock
from metaros.interfaces.rcl_interfaces.msg import Log
from metaros.interfaces.std_msgs.msg import String
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.wire import Durability, Liveliness, QoSProfile, Reliability, pack_attachment
from metaros.wire.qos import INFINITE_NS
from tests.support.processes.processes import started
from tests.support.waiting import wait_until

BEST_EFFORT = QoSProfile(reliability=Reliability.BEST_EFFORT)
KEPT = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=5)
OTHER_HASH = "RIHS01_" + "0" * 64


EXECUTORS: list[metaros.SingleThreadedExecutor] = []


@pytest.fixture(autouse=True)
def shut_down() -> Iterator[None]:
    """No executor outlives its test."""
    yield
    while EXECUTORS:
        EXECUTORS.pop().shutdown()


@pytest.fixture
def talker(there: metaros.Context) -> Iterator[metaros.Node]:
    """The node of the peer."""
    with metaros.Node("talker", context=there) as node:
        yield node


@pytest.fixture
def listener(here: metaros.Context) -> Iterator[metaros.Node]:
    """The node under test."""
    with metaros.Node("listener", context=here) as node:
        yield node


def spinning(*nodes: metaros.Node) -> Callable[[Callable[[], Any]], None]:
    """How to wait for something while the nodes spin."""
    executors = [metaros.SingleThreadedExecutor() for _ in nodes]
    EXECUTORS.extend(executors)
    for executor, node in zip(executors, nodes, strict=True):
        executor.add_node(node)

    def until(condition: Callable[[], Any]) -> None:
        def turn() -> Any:
            for executor in executors:
                executor.spin_once(0.005)
            return condition()

        wait_until(turn)

    return until


def manual(lease_s: float) -> QoSProfile:
    return QoSProfile(liveliness=Liveliness.MANUAL_BY_TOPIC, lease_ns=round(lease_s * 1e9))


# -- matching ----------------------------------------------------------------------------------------------------------


def test_peers_that_come_leave_and_come_back_are_counted_on_both_ends(listener, talker):
    received: list[Any] = []
    said: list[Any] = []
    until = spinning(listener, talker)
    sub = listener.create_subscription(String, "/t", print, events=SubscriptionEvents(matched=received.append))
    for count in (1, 2):
        pub = talker.create_publisher(String, "/t", events=PublisherEvents(matched=said.append))
        until(lambda: sub.events.matched == 1 and len(said) == count)  # noqa: B023
        pub.close()
        until(lambda: len(received) == 2 * count)  # noqa: B023
    assert [(e.node, e.total, e.change, e.current, e.current_change) for e in received] == [
        ("/talker", 1, 1, 1, 1),
        ("/talker", 1, 0, 0, -1),
        ("/talker", 2, 1, 1, 1),
        ("/talker", 2, 0, 0, -1),
    ]
    assert {(e.node, e.total, e.current) for e in said} == {("/listener", 1, 1)}


def test_the_callbacks_of_an_endpoint_may_have_a_group(listener, talker):
    group = metaros.MutuallyExclusiveCallbackGroup()
    entered: list[Any] = []
    enter = group.enter
    group.enter = lambda job: entered.append(job) or enter(job)
    events = SubscriptionEvents(matched=lambda _: received.append(1), group=group)
    received: list[Any] = []
    executor = metaros.MultiThreadedExecutor()
    EXECUTORS.append(executor)
    executor.add_node(listener)
    listener.create_subscription(String, "/t", print, events=events)
    talker.create_publisher(String, "/t")
    wait_until(lambda: executor.spin_once(0.01) or received)
    assert entered


def test_incompatible_qos_is_reported_on_both_ends_with_names_and_policies(listener, talker):
    received: list[Any] = []
    said: list[Any] = []
    until = spinning(listener, talker)
    pub = talker.create_publisher(String, "/t", BEST_EFFORT, events=PublisherEvents(incompatible_qos=said.append))
    sub = listener.create_subscription(
        String, "/t", print, QoSProfile(deadline_ns=10**9), events=SubscriptionEvents(incompatible_qos=received.append)
    )
    until(lambda: received and said)
    for events, node in ((received, "/talker"), (said, "/listener")):
        (event,) = events
        assert (event.topic, event.node, event.total, event.change) == ("/t", node, 1, 1)
        assert event.policies == ("reliability", "deadline")
        assert "best_effort is offered, reliable requested" in event.reason
    assert (pub.events.matched, sub.events.matched, sub.mismatched) == (0, 0, 0)
    assert (pub.events.incompatible_qos, sub.events.incompatible_qos) == (1, 1)


def test_without_callbacks_both_ends_warn_once_here_and_on_rosout(listener, talker, capfd):
    logs: list[Log] = []
    until = spinning(listener, talker)
    listener.create_subscription(Log, "/rosout", logs.append, metaros.qos_rosout)
    pub = talker.create_publisher(String, "/t", BEST_EFFORT)
    listener.create_subscription(String, "/t", print)
    listener.create_subscription(String, "/typed", print)
    talker.create_raw_publisher("/typed", "std_msgs/msg/String", OTHER_HASH)
    until(lambda: len(logs) >= 4)
    pub.publish(String(data="x"))  # what is at odds is told once, not with every sample
    until(lambda: True)
    texts = {(log.name, log.msg.partition(":")[0]) for log in logs}
    assert texts == {(name, code) for name in ("listener", "talker") for code in ("qos_mismatch", "type_hash_mismatch")}
    assert len(logs) == 4
    for log in logs:
        assert "/talker" in log.msg
        assert "/listener" in log.msg
        assert "/t" in log.msg
    assert capfd.readouterr().err.count("qos_mismatch: /t:") == 2


def test_another_definition_of_the_type_is_reported_on_both_ends(listener, talker):
    received: list[Any] = []
    said: list[Any] = []
    until = spinning(listener, talker)
    events = SubscriptionEvents(type_hash_mismatch=received.append)
    listener.create_raw_publisher("/else", "std_msgs/msg/String", OTHER_HASH)
    talker.create_publisher(String, "/else", events=PublisherEvents(type_hash_mismatch=said.append))
    listener.create_subscription(String, "/t", print, events=events)
    talker.create_raw_publisher("/t", "std_msgs/msg/String", OTHER_HASH)
    until(lambda: received)
    assert (received[0].node, received[0].type_name, received[0].peer_type_hash) == (
        "/talker",
        "std_msgs/msg/String",
        OTHER_HASH,
    )
    listener.create_raw_subscription("/else", "std_msgs/msg/String", OTHER_HASH, 10, lambda sample: None)
    until(lambda: said)
    assert (said[0].node, said[0].topic, said[0].total) == ("/listener", "/else", 1)


def test_event_callbacks_may_be_async_and_may_fail(listener, talker, caplog):
    matched: list[Any] = []

    async def on_matched(event: Any) -> None:
        matched.append(event)

    def on_incompatible(event: Any) -> None:
        raise RuntimeError("the user's own")

    until = spinning(listener)
    events = SubscriptionEvents(matched=on_matched, incompatible_qos=on_incompatible)
    listener.create_subscription(String, "/t", print, events=events)
    talker.create_publisher(String, "/t", BEST_EFFORT)
    talker.create_publisher(String, "/t")
    until(lambda: matched and "the user's own" in caplog.text)


# -- samples -----------------------------------------------------------------------------------------------------------


def test_lost_samples_are_reported_and_those_that_our_own_history_pushed_out_are_not(listener, talker):
    events: list[Any] = []
    got: list[str] = []
    until = spinning(listener)
    options = SubscriptionEvents(message_lost=events.append)
    sub = listener.create_subscription(String, "/t", lambda m: got.append(m.data), 3, events=options)
    pub = talker.create_publisher(String, "/t", metaros.qos_reliable_all)
    wait_until(lambda: sub.events.matched and pub.events.matched)
    pub.publish(String(data="first"))
    until(lambda: got)
    for number in range(10):
        pub.publish(String(data=str(number)))
    wait_until(lambda: sub.dropped == 7)
    until(lambda: got[-1] == "9")
    assert (sub.lost, events) == (0, [])
    data = b"\x00\x01\x00\x00\x02\x00\x00\x00x\x00"
    talker.context.session.zenoh.put(pub.key, data, attachment=pack_attachment(15, 1, pub.gid))
    until(lambda: events)
    assert (events[0].node, events[0].total, events[0].change, sub.lost) == ("/talker", 3, 3, 3)


@pytest.mark.parametrize("side", ["publisher", "subscription"])
def test_samples_past_their_lifespan_are_not_delivered(listener, talker, side):
    short = QoSProfile(lifespan_ns=60 * 10**9)
    got: list[str] = []
    until = spinning(listener)
    theirs, ours = (short, metaros.qos_default) if side == "publisher" else (metaros.qos_default, short)
    pub = talker.create_publisher(String, "/t", theirs)
    sub = listener.create_subscription(String, "/t", lambda m: got.append(m.data), ours)
    wait_until(lambda: sub.events.matched and pub.events.matched)
    now_ns = talker.clock.wall_ns()
    pub.publish(String(data="stale"), stamp_ns=now_ns - 61 * 10**9)
    pub.publish(String(data="fresh"), stamp_ns=now_ns - 30 * 10**9)
    until(lambda: got)
    assert (got, sub.expired, sub.lost) == (["fresh"], 1, 0)


def test_a_late_subscription_does_not_get_what_has_expired(listener, talker):
    kept = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=5, lifespan_ns=60 * 10**9)
    got: list[str] = []
    pub = talker.create_publisher(String, "/t", kept)
    pub.publish(String(data="stale"), stamp_ns=talker.clock.wall_ns() - 61 * 10**9)
    pub.publish(String(data="fresh"))
    wait_until(lambda: listener.graph.endpoints("/t", "MP"))
    sub = listener.create_subscription(String, "/t", lambda m: got.append(m.data), KEPT)
    spinning(listener)(lambda: got and sub.expired)
    assert (got, sub.expired) == (["fresh"], 1)


def test_a_late_subscription_gets_what_a_raw_advanced_publisher_kept(listener, talker):
    got: list[str] = []
    sub = listener.create_subscription(String, "/probe", print, KEPT)
    key, session = sub.key.replace("/probe/", "/t/"), talker.context.session.zenoh
    sub.close()
    publisher = zenoh.ext.declare_advanced_publisher(
        session,
        key,
        cache=zenoh.ext.CacheConfig(max_samples=5),
        sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
        publisher_detection=True,
    )
    data = b"\x00\x01\x00\x00\x02\x00\x00\x00x\x00"
    for seq in (1, 2):
        publisher.put(data, attachment=pack_attachment(seq, 1, bytes(16)))
    listener.create_subscription(String, "/t", lambda m, info: got.append(info.seq), KEPT)
    spinning(listener)(lambda: len(got) == 2)
    publisher.undeclare()
    assert got == [1, 2]


# -- time --------------------------------------------------------------------------------------------------------------


def test_missed_deadlines_are_reported_on_both_ends(listener, talker):
    received: list[Any] = []
    said: list[Any] = []
    until = spinning(listener, talker)
    qos = QoSProfile(deadline_ns=50_000_000)
    pub = talker.create_publisher(String, "/t", qos, events=PublisherEvents(deadline_missed=said.append))
    options = SubscriptionEvents(deadline_missed=received.append)
    sub = listener.create_subscription(String, "/t", lambda m: None, qos, events=options)
    until(lambda: sub.events.matched and pub.events.matched)
    assert (pub.events.deadline_missed, sub.events.deadline_missed) == (0, 0)
    pub.publish(String(data="x"))
    until(lambda: len(received) >= 2 and len(said) >= 2)
    assert {event.node for event in received} == {"/talker"}
    for events in (received, said):
        assert [event.total for event in events] == [sum(e.change for e in events[: n + 1]) for n in range(len(events))]
    assert sub.events.deadline_missed >= received[-1].total


def test_deadlines_are_counted_without_an_executor(zenoh_router):
    clock = ManualClock()
    qos = QoSProfile(deadline_ns=10**9)
    with metaros.Context(domain_id=0, connect=zenoh_router, clock=clock) as context:
        node = metaros.Node("n", context=context, enable_rosout=False)
        pub = node.create_publisher(String, "/t", qos)
        pub.publish(String(data="x"))
        clock.advance(3.5)
        assert pub.events.deadline_missed == 3
        pub.publish(String(data="x"))
        clock.advance(0.9)
        assert pub.events.deadline_missed == 3


def test_samples_that_wait_for_a_busy_executor_came_in_time(zenoh_router):
    clock = ManualClock()
    got: list[Any] = []
    with metaros.Context(domain_id=0, connect=zenoh_router, clock=clock) as context:
        node = metaros.Node("n", context=context, enable_rosout=False)
        sub = node.create_subscription(String, "/t", got.append, QoSProfile(deadline_ns=10**9))
        pub = node.create_publisher(String, "/t", QoSProfile(deadline_ns=10**9))
        until = spinning(node)
        pub.publish(String(data="1"))
        until(lambda: got)
        clock.advance(0.9)
        pub.publish(String(data="2"))
        clock.advance(0.9)
        assert sub.events.deadline_missed == 0
        until(lambda: len(got) == 2)
        clock.advance(1.1)
        assert sub.events.deadline_missed == 1


# -- liveliness --------------------------------------------------------------------------------------------------------


def test_manual_liveliness_is_kept_by_samples_and_by_saying_so(zenoh_router):
    clocks = ManualClock(), ManualClock()
    received: list[Any] = []
    said: list[Any] = []
    samples: list[Any] = []
    with (
        metaros.Context(domain_id=0, connect=zenoh_router, clock=clocks[0]) as here,
        metaros.Context(domain_id=0, connect=zenoh_router, clock=clocks[1]) as there,
    ):
        listener = metaros.Node("listener", context=here, enable_rosout=False)
        talker = metaros.Node("talker", context=there, enable_rosout=False)
        until = spinning(listener, talker)
        events = SubscriptionEvents(liveliness_changed=received.append)
        sub = listener.create_subscription(String, "/t", samples.append, manual(2.0), events=events)
        pub = talker.create_publisher(String, "/t", manual(1.0), events=PublisherEvents(liveliness_lost=said.append))
        until(lambda: sub.events.matched and pub.events.matched and received)

        def go_on(seconds: float) -> None:
            for clock in clocks:
                clock.advance(seconds)

        go_on(1.1)
        until(lambda: len(received) == 2 and said)
        assert (sub.events.alive, sub.events.not_alive) == (0, 1)
        # The router may forward to the listener a moment later than both ends have found each other.
        until(lambda: len(received) == 3 or pub.assert_liveliness())
        go_on(0.8)
        pub.publish(String(data="x"))
        got = len(received)
        until(lambda: samples)
        go_on(0.8)
        until(lambda: True)
        assert len(received) == got
        pub.close()
        until(lambda: len(received) == 4)
    assert [(e.node, e.alive, e.alive_change, e.not_alive, e.not_alive_change) for e in received] == [
        ("/talker", 1, 1, 0, 0),
        ("/talker", 0, -1, 1, 1),
        ("/talker", 1, 1, 0, -1),
        ("/talker", 0, -1, 0, 0),
    ]
    assert [(event.total, event.change) for event in said] == [(1, 1)]
    assert pub.events.liveliness_lost == 1


PUBLISHER = """
    import sys, threading, metaros
    from metaros.interfaces.std_msgs.msg import String
    context = metaros.Context(domain_id=0, connect=sys.argv[1])
    node = metaros.Node("victim", context=context)
    node.create_publisher(String, "/t")
    threading.Event().wait()
"""


@pytest.mark.integration
def test_a_killed_publisher_is_no_longer_alive(listener, zenoh_router):
    received: list[Any] = []
    matched: list[Any] = []
    until = spinning(listener)
    events = SubscriptionEvents(liveliness_changed=received.append, matched=matched.append)
    sub = listener.create_subscription(String, "/t", print, events=events)
    for round_ in (1, 2):
        with started([sys.executable, "-c", textwrap.dedent(PUBLISHER), zenoh_router]) as process:
            until(lambda: sub.events.alive == 1)
            process.kill()
        until(lambda: len(received) == 2 * round_ and len(matched) == 2 * round_)  # noqa: B023
    assert [(e.node, e.alive, e.alive_change) for e in received] == [("/victim", 1, 1), ("/victim", 0, -1)] * 2
    assert [(e.total, e.current) for e in matched] == [(1, 1), (1, 0), (2, 1), (2, 0)]


# -- costs nothing when unset ------------------------------------------------------------------------------------------


def test_plain_endpoints_carry_no_monitors(listener, talker):
    pub = talker.create_publisher(String, "/t")
    sub = listener.create_subscription(String, "/t", print)
    wait_until(lambda: sub.events.matched and pub.events.matched)
    assert pub.publish.__qualname__ == "_publish.<locals>.publish"
    assert pub.events.sent is None
    assert (sub.events.deadline_missed, sub.events.alive, sub.events.not_alive, sub.expired) == (0, 1, 0, 0)
    assert (pub.events.deadline_missed, pub.events.liveliness_lost) == (0, 0)
    assert sub.qos.deadline_ns == INFINITE_NS
    pub.assert_liveliness()
    pub.close()
    with pytest.raises(metaros.errors.ClosedError):
        pub.assert_liveliness()


@pytest.mark.parametrize("qos", [metaros.qos_default, metaros.qos_reliable_all, KEPT])
@pytest.mark.parametrize("dedicated", [False, True])
def test_policies_hold_on_every_path_to_the_callback(listener, talker, qos, dedicated):
    got: list[Any] = []
    until = spinning(listener, talker)
    strict = dataclasses.replace(qos, deadline_ns=10**8, lifespan_ns=60 * 10**9)
    sub = listener.create_subscription(
        String, "/t", lambda message, info: got.append((message.data, info.seq)), strict, dedicated=dedicated
    )
    pub = talker.create_publisher(String, "/t", strict)
    until(lambda: sub.events.matched and pub.events.matched)
    pub.publish(String(data="stale"), stamp_ns=talker.clock.wall_ns() - 61 * 10**9)
    pub.publish(String(data="fresh"))
    until(lambda: got and sub.events.deadline_missed and pub.events.deadline_missed)
    assert (got, sub.expired, sub.lost) == ([("fresh", 2)], 1, 0)


def test_an_async_callback_gets_only_what_is_fresh(listener, talker):
    got: list[str] = []

    async def on_message(message: String) -> None:
        got.append(message.data)

    until = spinning(listener)
    sub = listener.create_subscription(String, "/t", on_message, QoSProfile(lifespan_ns=60 * 10**9))
    pub = talker.create_publisher(String, "/t")
    wait_until(lambda: sub.events.matched and pub.events.matched)
    pub.publish(String(data="stale"), stamp_ns=talker.clock.wall_ns() - 61 * 10**9)
    pub.publish(String(data="fresh"))
    until(lambda: got)
    assert (got, sub.expired) == (["fresh"], 1)


def test_deadlines_go_by_real_time_while_simulated_time_stands(here, there):
    received: list[Any] = []
    qos = QoSProfile(deadline_ns=50_000_000)
    with (
        metaros.Node("listener", context=here, use_sim_time=True) as listener,
        metaros.Node("talker", context=there) as talker,
    ):
        until = spinning(listener)
        events = SubscriptionEvents(deadline_missed=received.append)
        sub = listener.create_subscription(String, "/t", lambda message: None, qos, events=events)
        pub = talker.create_publisher(String, "/t", qos)
        wait_until(lambda: sub.events.matched and pub.events.matched)
        pub.publish(String(data="x"))
        until(lambda: len(received) >= 2)
        assert listener.clock.wall_ns() == 0
    assert received[1].total >= 2
