"""Publishers and subscriptions between two sessions, good samples and bad ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

import metaros
from metaros.errors import ClosedError, FieldError, NameError_, TooLargeError, UsageError
from metaros.interfaces.sensor_msgs.msg import Imu
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS
from metaros.wire import Durability, QoSProfile, pack_attachment, qos_reliable_all
from tests.support.waiting import wait_until


def spinner(node: metaros.Node) -> Callable[[], None]:
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    return lambda: (executor.spin_once(0.01), None)[1]


def until(condition: Callable[[], Any], *turns: Callable[[], Any]) -> None:
    wait_until(lambda: condition() or ([turn() for turn in turns] and condition()))


def linked(*contexts: metaros.Context, topic: str, kinds: str = "MP MS") -> None:
    """Wait until every context's graph shows the topic's endpoints."""
    for context in contexts:
        wait_until(lambda c=context: {end.kind for end in c.graph.endpoints(topic)} == set(kinds.split()))


@pytest.mark.parametrize("dedicated", [False, True])
@pytest.mark.parametrize(
    "qos", [QoSProfile(depth=100), qos_reliable_all, QoSProfile(durability=Durability(1), depth=50)]
)
def test_messages_arrive_once_in_order_with_their_info(here, there, qos, dedicated):
    got: list[tuple[Any, metaros.MessageInfo]] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there, namespace="/ns") as b:
        sub = b.create_subscription(String, "/chatter", lambda m, info: got.append((m, info)), qos, dedicated=dedicated)
        pub = a.create_publisher(String, "chatter", qos)
        linked(here, there, topic="/chatter")
        for number in range(20):
            pub.publish(String(data=str(number)), stamp_ns=1000 + number)
        until(lambda: len(got) == 20, spinner(b))
        assert [message.data for message, _ in got] == [str(number) for number in range(20)]
        assert [info.seq for _, info in got] == list(range(1, 21))
        assert [info.source_stamp_ns for _, info in got] == list(range(1000, 1020))
        assert {info.gid for _, info in got} == {pub.gid}
        assert (sub.lost, sub.dropped, sub.malformed, sub.mismatched) == (0, 0, 0, 0)


def test_a_node_hears_itself(here):
    got: list[Any] = []
    with metaros.Node("a", context=here) as node:
        node.create_subscription(Imu, "~/imu", got.append)
        publisher = node.create_publisher(Imu, "/a/imu")
        publisher.publish(Imu(linear_acceleration_covariance=[1.0] * 9))
        until(lambda: got, spinner(node))
    assert got[0].linear_acceleration_covariance.tolist() == [1.0] * 9


def test_a_late_subscription_gets_what_a_transient_local_publisher_kept(here, there):
    got: list[Any] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        publisher = a.create_publisher(String, "map_name", QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=2))
        for name in ("cellar", "kitchen", "office"):
            publisher.publish(String(data=name))
        linked(there, topic="/map_name", kinds="MP")
        b.create_subscription(String, "map_name", got.append, QoSProfile(durability=Durability(1), depth=2))
        until(lambda: len(got) == 2, spinner(b))
    assert [message.data for message in got] == ["kitchen", "office"]


def test_keep_last_drops_the_oldest_and_counts(here, there):
    got: list[str] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        sub = b.create_subscription(String, "chatter", lambda message: got.append(message.data), 3)
        pub = a.create_publisher(String, "chatter", qos_reliable_all)
        linked(here, there, topic="/chatter")
        for number in range(100):
            pub.publish(String(data=str(number)))
        wait_until(lambda: sub.dropped == 97)
        until(lambda: len(got) == 3, spinner(b))
    assert got == ["97", "98", "99"]
    assert sub.lost == 0


def test_several_subscriptions_on_one_topic_share_the_wire(here, there):
    first: list[Any] = []
    second: list[Any] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        one = b.create_subscription(String, "chatter", first.append)
        b.create_subscription(String, "chatter", second.append, raw=True)
        pub = a.create_publisher(String, "chatter")
        linked(here, topic="/chatter")
        pub.publish(String(data="x"))
        until(lambda: first and second, spinner(b))
        one.close()
        pub.publish(pub_bytes := second[0])
        until(lambda: len(second) == 2, spinner(b))
    assert first == [String(data="x")]
    assert second[1] == pub_bytes == b"\x00\x01\x00\x00\x02\x00\x00\x00x\x00"


def test_raw_endpoints_carry_types_that_nobody_knows(here, there):
    arrived = threading.Semaphore(0)
    samples: list[Any] = []

    def sink(sample: Any) -> None:
        samples.append(sample)
        arrived.release()

    type_hash = "RIHS01_" + "ab" * 32
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        b.create_raw_subscription("/odd", "odd_msgs/msg/Odd", type_hash, 10, sink)
        pub = a.create_raw_publisher("/odd", "odd_msgs/msg/Odd", type_hash)
        linked(here, there, topic="/odd")
        pub.publish(b"\x00\x01\x00\x00abc", stamp_ns=7)
        assert arrived.acquire(timeout=60)
        with pytest.raises(FieldError, match="odd_msgs/msg/Odd"):
            pub.publish("text")
    assert samples[0].payload.to_bytes() == b"\x00\x01\x00\x00abc"


GOOD = b"\x00\x01\x00\x00\x02\x00\x00\x00x\x00"


@pytest.mark.parametrize(
    ("payload", "attachment", "code"),
    [
        (GOOD, None, "malformed_attachment"),
        (GOOD, pack_attachment(1, 1, bytes(16))[:20], "malformed_attachment"),
        (GOOD, b"\xff" * 33, "malformed_attachment"),
        (b"", pack_attachment(1, 1, bytes(16)), "malformed_cdr"),
        (GOOD[:-1], pack_attachment(1, 1, bytes(16)), "malformed_cdr"),
        (b"\x00\x01\x00\x00\xff\xff\xff\xffx", pack_attachment(1, 1, bytes(16)), "malformed_cdr"),
        (bytes(LIMITS.sample_bytes + 1), pack_attachment(1, 1, bytes(16)), "too_large"),
    ],
    ids=["none", "cut", "nonsense", "empty", "truncated", "lies", "oversized"],
)
def test_bad_samples_are_counted_reported_once_and_harm_nobody(here, there, caplog, payload, attachment, code):
    got: list[Any] = []
    with metaros.Node("b", context=here) as node:
        sub = node.create_subscription(String, "/chatter", got.append)
        put = there.session.zenoh.put
        spin = spinner(node)

        def send(data: bytes, extra: bytes | None) -> None:
            put(sub.key, data, attachment=extra)
            spin()

        until(lambda: sub.malformed >= 2, lambda: send(payload, attachment))
        until(lambda: got, lambda: send(GOOD, pack_attachment(5, 1, bytes(16))))
    assert caplog.text.count(code) == 1


def test_gaps_in_the_sequence_are_lost_samples(here, there):
    got: list[Any] = []
    with metaros.Node("b", context=here) as node:
        sub = node.create_subscription(String, "/chatter", lambda m, info: got.append(info.seq))
        spin = spinner(node)
        first = 0

        def start() -> None:
            nonlocal first
            first += 1
            there.session.zenoh.put(sub.key, GOOD, attachment=pack_attachment(first, 1, bytes(16)))
            spin()

        until(lambda: got, start)
        lost = sub.lost
        for seq in (first + 1, first + 4, first + 3, first + 5):
            there.session.zenoh.put(sub.key, GOOD, attachment=pack_attachment(seq, 1, bytes(16)))
        until(lambda: got and got[-1] == first + 5, spin)
    assert sub.lost - lost == 2


def test_another_hash_of_the_same_type_is_reported(here, there, capsys):
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        sub = a.create_subscription(String, "/chatter", lambda message: None)
        b.create_raw_publisher("/chatter", "std_msgs/msg/String", "RIHS01_" + "0" * 64)
        said: list[str] = []
        text = "type_hash_mismatch: /chatter: subscription /a and publisher /b"
        wait_until(lambda: said.append(capsys.readouterr().err) or text in "".join(said))
        wait_until(lambda: sub.events.type_hash_mismatch == sub.mismatched == 1)


def test_what_does_not_fit_is_refused_before_it_is_sent(here):
    with metaros.Node("a", context=here) as node:
        publisher = node.create_publisher(String, "chatter")
        with pytest.raises(FieldError, match="std_msgs/msg/String"):
            publisher.publish(Imu())
        with pytest.raises(FieldError, match="data"):
            publisher.publish(String(data=3))
        with pytest.raises(TooLargeError, match="limit"):
            publisher.publish(String(data="x" * LIMITS.sample_bytes))
        for name in ("bad name", "a//b", "1a", "", "a#b"):
            with pytest.raises(NameError_):
                node.create_publisher(String, name)
        with pytest.raises(UsageError, match="positional"):
            node.create_subscription(String, "chatter", lambda: None)
    with pytest.raises(ClosedError):
        publisher.publish(String())
    with pytest.raises(ClosedError):
        node.create_publisher(String, "chatter")
    wait_until(lambda: here.graph.endpoints() == [])  # the network says it after the close


def test_closing_while_another_thread_publishes(here: metaros.Context) -> None:
    ended: list[type[BaseException]] = []
    for _ in range(8):
        node = metaros.Node("busy", context=here, enable_rosout=False)
        publisher = node.create_publisher(String, "flood", 10)
        began = threading.Event()

        def flood(publish: Callable[..., None] = publisher.publish, began: threading.Event = began) -> None:
            message = String(data="x" * 20_000)
            try:
                while True:
                    publish(message)
                    began.set()
            except BaseException as error:
                ended.append(type(error))

        thread = threading.Thread(target=flood)
        thread.start()
        assert began.wait(60)
        node.close()
        thread.join(60)
    assert ended == [ClosedError] * 8
