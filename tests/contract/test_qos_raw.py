"""QoS against peers that are plain eclipse-zenoh and know ROS only by the facts sheet: tokens, attachments, keys."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import pytest
import xxhash
import zenoh

import metaros
from metaros.interfaces.std_msgs.msg import String
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.wire import Liveliness, QoSProfile
from tests.support.waiting import wait_until

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
KEY = f"0/t/std_msgs::msg::dds_::String_/{HASH}"
HELLO = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00"


@pytest.fixture
def plain(zenoh_router: str) -> Iterator[zenoh.Session]:
    """A session with nothing of ours in it."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{zenoh_router}"]')
    with zenoh.open(config) as session:
        yield session


@pytest.fixture
def node(zenoh_router: str) -> Iterator[metaros.Node]:
    """The node under test."""
    with (
        metaros.Context(domain_id=0, connect=zenoh_router) as context,
        metaros.Node("ours", context=context, enable_rosout=False) as node,
    ):
        yield node


def spin_until(node: metaros.Node, condition: Any) -> None:
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    wait_until(lambda: condition() or (executor.spin_once(0.01), condition())[1])


OTHER_HASH = f"RIHS01_{'0' * 64}"


def token_of(session: zenoh.Session, kind: str, qos: str, *, eid: int = 10, type_hash: str = HASH) -> str:
    owner = f"@ros2_lv/0/{session.info.zid()}/0/{eid}/{kind}/%/%/raw"
    return f"{owner}/%t/std_msgs::msg::dds_::String_/{type_hash}/{qos}"


def test_a_plain_token_is_a_peer(node, plain):
    events: list[Any] = []
    ends = {"matched": events.append, "incompatible_qos": events.append, "type_hash_mismatch": events.append}
    sub = node.create_subscription(String, "/t", print, events=SubscriptionEvents(**ends))
    node.create_publisher(String, "/t", events=PublisherEvents(**ends))
    spin_until(node, lambda: len(events) == 2)
    events.clear()
    liveliness = plain.liveliness()
    fits = liveliness.declare_token(token_of(plain, "MP", "::,10:,:,:,,"))
    spin_until(node, lambda: len(events) == 1)
    liveliness.declare_token(token_of(plain, "MP", "2:1:,5:,:,:,,", eid=11))
    spin_until(node, lambda: len(events) == 2)
    liveliness.declare_token(token_of(plain, "MS", ":1:,1:0,500000000:,:3,1,5", eid=12))
    spin_until(node, lambda: len(events) == 3)
    liveliness.declare_token(token_of(plain, "MS", "::,:,:,:,,", eid=13, type_hash=OTHER_HASH))
    spin_until(node, lambda: len(events) == 4)
    fits.undeclare()
    spin_until(node, lambda: len(events) == 5)
    assert {event.node for event in events} == {"/raw"}
    assert [event.current for event in (events[0], events[4])] == [2, 1]
    assert events[1].policies == ("reliability",)
    assert events[2].policies == ("durability", "deadline", "liveliness")
    assert events[3].peer_type_hash == OTHER_HASH
    assert sub.events.matched == 1


def test_lifespan_and_losses_of_a_plain_publisher(node, plain):
    lost: list[Any] = []
    got: list[str] = []
    options = SubscriptionEvents(message_lost=lost.append)
    sub = node.create_subscription(String, "/t", lambda message: got.append(message.data), events=options)
    key = token_of(plain, "MP", "::,10:,:2,0:,,")
    gid = xxhash.xxh3_128(key.encode()).intdigest().to_bytes(16, "little")
    token = plain.liveliness().declare_token(key)
    wait_until(lambda: sub.events.matched == 1)
    wall_ns = node.clock.wall_ns()
    for seq, stamp_ns in ((1, wall_ns - 60 * 10**9), (2, wall_ns + 60 * 10**9), (5, wall_ns + 60 * 10**9)):
        plain.put(KEY, HELLO, attachment=struct.pack("<qqB", seq, stamp_ns, 16) + gid)
    spin_until(node, lambda: len(got) == 2 and lost)
    token.undeclare()
    assert (sub.expired, sub.lost, sub.malformed) == (1, 2, 0)
    assert (lost[0].node, lost[0].change) == ("/raw", 2)


def test_an_assertion_disturbs_no_plain_peer(node, plain):
    on_the_key: list[zenoh.Sample] = []
    manual = QoSProfile(liveliness=Liveliness.MANUAL_BY_TOPIC, lease_ns=10**9)
    with plain.declare_subscriber(KEY, on_the_key.append), plain.declare_subscriber("0/t/**", on_the_key.append):
        publisher = node.create_publisher(String, "/t", manual)
        assert str(publisher.token).endswith("/::,10:,:,:3,1,0")
        publisher.assert_liveliness()
        wait_until(lambda: (publisher.publish(String(data="hello")), len(on_the_key) >= 2)[1])
    assert {sample.payload.to_bytes() for sample in on_the_key} == {HELLO}
    assert {str(sample.key_expr) for sample in on_the_key} == {KEY}
