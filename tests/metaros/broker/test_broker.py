"""ZeroMQ programs and nodes hear each other through a real broker; the wire is that of `metaros` 1.x."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

import metaros
from metaros.broker import Broker, BrokerOptions, HubOptions, TypeTable
from metaros.errors import ConfigError
from metaros.idl.globs import Glob
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import Bool, Float64, Int64, String, UInt8MultiArray
from tests.metaros.broker.conftest import Rig, received
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until


def test_a_zeromq_publisher_is_received_by_a_node(rig: Rig) -> None:
    heard: list[str] = []
    rig.node.create_subscription(String, "/chatter", lambda message: heard.append(message.data))
    publisher = rig.publisher()
    rig.until(lambda: len(heard) >= 3, send=lambda: publisher.send(b'/chatter {"data": "hello"}'))
    assert set(heard) == {"hello"}
    assert rig.row("/chatter", "TO_ROS").type == "std_msgs/msg/String"
    wait_until(lambda: rig.row("/chatter", "TO_ROS").heard)


def test_a_zeromq_subscriber_hears_a_node(rig: Rig) -> None:
    subscriber = rig.subscriber(b"/cmd_vel")
    publisher = rig.node.create_publisher(Twist, "/cmd_vel")
    message = Twist()
    message.linear.x = 0.5
    found: list[list[bytes]] = []
    rig.until(lambda: found.extend(received(subscriber)) or found, send=lambda: publisher.publish(message))
    (frame,) = found[0]
    topic, _, payload = frame.partition(b" ")
    assert topic == b"/cmd_vel"
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    assert json.loads(payload) == {"linear": {**zero, "x": 0.5}, "angular": zero}


def test_zeromq_programs_hear_each_other_whatever_they_say(rig: Rig) -> None:
    subscriber, publisher = rig.subscriber(b"any"), rig.publisher()
    message = [b"any thing \xff", b"", b"at all"]
    found: list[list[bytes]] = []
    rig.until(lambda: found.extend(received(subscriber)) or found, send=lambda: publisher.send_multipart(message))
    assert found[0] == message
    wait_until(lambda: rig.broker.report().unreadable > 0)


def test_nothing_comes_back_to_where_it_came_from(rig: Rig) -> None:
    """Publishers and subscribers of one topic on both sides: each message arrives once everywhere."""
    heard: list[str] = []
    rig.node.create_subscription(String, "/both", lambda message: heard.append(message.data), 1000)
    node_says = rig.node.create_publisher(String, "/both")
    subscriber, zmq_says = rig.subscriber(b"/both "), rig.publisher()
    found: list[bytes] = []

    def listen() -> list[bytes]:
        found.extend(frames[0] for frames in received(subscriber))
        return found

    rig.until(lambda: any(b"node" in frame for frame in listen()), send=lambda: node_says.publish(String(data="node")))
    rig.until(
        lambda: "zmq" in heard and any(b"zmq" in frame for frame in listen()),
        send=lambda: zmq_says.send(b'/both {"data": "zmq"}'),
    )
    for number in range(50):
        zmq_says.send(b'/both {"data": "z%d"}' % number)
        node_says.publish(String(data=f"n{number}"))
    zmq_says.send(b'/both {"data": "z end"}')
    node_says.publish(String(data="n end"))
    rig.until(lambda: "z end" in heard and any(b"n end" in frame for frame in listen()))
    wait_until(lambda: any(b"z end" in frame for frame in listen()))
    for name in ("z", "n"):
        for number in range(50):
            assert heard.count(f"{name}{number}") == 1
            assert sum(b'"%b%d"' % (name.encode(), number) in frame for frame in found) == 1


def test_the_types_of_the_graph_are_used_and_other_fields_are_left_out(
    rig: Rig, capsys: pytest.CaptureFixture[str]
) -> None:
    odometry: list[Odometry] = []
    numbers: list[float] = []
    rig.node.create_subscription(Odometry, "/odom", odometry.append)
    rig.node.create_subscription(Float64, "/number", lambda message: numbers.append(message.data))
    publisher = rig.publisher()
    pose = {"position": {"x": 1, "y": 2, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    value = {
        "header": {"seq": 7, "stamp": 1.5, "frame_id": "odom"},
        "pose": {"pose": pose, "covariance": []},
        "battery": 0.5,
    }

    def send() -> None:
        publisher.send(b"/odom " + json.dumps(value).encode())
        publisher.send(b"number 3")

    rig.until(lambda: odometry and numbers, send=send)
    assert numbers[0] == 3.0
    assert (odometry[0].header.stamp.sec, odometry[0].header.stamp.nanosec) == (1, 500_000_000)
    assert odometry[0].pose.pose.position.y == 2.0
    assert list(odometry[0].pose.covariance) == [0.0] * 36
    assert "battery" in capsys.readouterr().err


def test_a_guess_gives_way_to_what_comes_later(rig: Rig) -> None:
    publisher = rig.publisher()
    reader = rig.peers.session.zenoh.declare_subscriber("0/level/**", lambda _: None)  # without a type or a token
    rig.until(lambda: rig.row("/level", "TO_ROS"), send=lambda: publisher.send(b'/level {"data": 1}'))
    wait_until(lambda: rig.row("/level", "TO_ROS").type == "std_msgs/msg/Int64")
    rig.until(
        lambda: rig.row("/level", "TO_ROS").type == "std_msgs/msg/Float64",
        send=lambda: publisher.send(b'/level {"data": 1.5}'),
    )
    heard: list[bool] = []
    rig.node.create_subscription(Bool, "/level", lambda message: heard.append(message.data))
    rig.until(lambda: heard, send=lambda: publisher.send(b'/level {"data": true}'))
    assert rig.row("/level", "TO_ROS").type == "std_msgs/msg/Bool"
    reader.undeclare()


def test_a_flood_that_nobody_listens_to_is_left_out_and_counted_until_somebody_does(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    import metaros.broker.unheard

    monkeypatch.setattr(metaros.broker.unheard, "_FLOOD", 20)
    publisher = rig.publisher()
    left_out: list[bytes] = []
    ignore = rig.broker._bridge._unheard._ignore
    monkeypatch.setattr(
        rig.broker._bridge._unheard, "_ignore", lambda prefix: (left_out.append(prefix), ignore(prefix))
    )

    def flood() -> None:
        for _ in range(100):
            publisher.send(b"/flood 1")

    rig.until(lambda: left_out == [b"/flood ", b"flood "], send=flood)
    for _ in range(4):
        flood()
    rig.until(lambda: rig.row("/quiet", "TO_ROS"), send=lambda: publisher.send(b"/quiet 1"))
    rig.until(lambda: rig.broker.report().unreadable, send=lambda: publisher.send(b"\x01 no subscription and no topic"))
    wait_until(lambda: _all_counted(rig))
    heard: list[int] = []
    rig.node.create_subscription(Int64, "/flood", lambda message: heard.append(message.data))
    rig.until(lambda: heard, send=lambda: publisher.send(b"/flood 1"))
    wait_until(lambda: _all_counted(rig))


def _all_counted(rig: Rig) -> bool:
    """Whether every frame of the hub is in one of the report's counters."""
    report = rig.broker.report()
    counted = sum(row.messages for row in report.rows) + report.unreadable
    return report.hub_missed == 0 and counted == report.hub_frames


CHARGER = """
import metaros

@metaros.message(name="strange_msgs/msg/Cell")
class Cell:
    volts: float
    cell: str

with metaros.Node("charger") as node:
    charged = node.create_publisher(Cell, "/charged")

    @node.subscription(Cell, "/cell")
    def on_cell(cell):
        charged.publish(Cell(volts=2 * cell.volts, cell=cell.cell))

    metaros.spin(node)
"""


def test_custom_types_are_learnt_from_the_node_that_has_them(rig: Rig) -> None:
    """Another process defines a type; the broker asks it, and converts both ways."""
    subscriber, publisher = rig.subscriber(b"/charged"), rig.publisher()
    environment = {**os.environ, "METAROS_ZENOH_PORT": rig.router.rsplit(":", 1)[1], "ROS_DOMAIN_ID": "0"}
    found: list[list[bytes]] = []
    with subprocess.Popen([sys.executable, "-c", CHARGER], env=environment) as charger:
        try:
            rig.until(
                lambda: found.extend(received(subscriber)) or found,
                send=lambda: publisher.send(b'/cell {"volts": 3.5, "cell": "a"}'),
            )
        finally:
            charger.kill()
    assert found[0][0] == b'/charged {"volts":7.0,"cell":"a"}'
    assert rig.row("/cell", "TO_ROS").type == "strange_msgs/msg/Cell"


def test_bad_input_is_counted_and_reported_once(rig: Rig, capsys: pytest.CaptureFixture[str]) -> None:
    heard: list[str] = []
    rig.node.create_subscription(String, "/chatter", lambda message: heard.append(message.data))
    publisher = rig.publisher()
    rig.until(lambda: heard, send=lambda: publisher.send(b'/chatter {"data": "hello"}'))
    wait_until(lambda: rig.context.graph.endpoints(topic="/chatter", kind="MS"))  # so that the type is no guess
    for _ in range(3):
        publisher.send(b'/chatter {"data": ')
        publisher.send(b"/chatter \xff\xfe")
        publisher.send(b"no_payload")
        publisher.send(b"/no//name 1")
    wait_until(lambda: rig.row("/chatter", "TO_ROS").malformed == 6)
    wait_until(lambda: rig.broker.report().unreadable == 6)
    publisher.send(b'/chatter {"data": "still here"}')
    wait_until(lambda: "still here" in heard)
    reported = capsys.readouterr().err
    assert reported.count("is no JSON") == 1
    assert reported.count("/no//name") == 1


def test_topics_are_subscribed_only_while_somebody_wants_them(
    make_rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    import metaros.broker.bridge
    from metaros.broker.demand import Demand

    monkeypatch.setattr(metaros.broker.bridge, "Demand", lambda: Demand(linger_s=0.2))
    rig = make_rig()
    rig.node.create_publisher(String, "/on")
    rig.node.create_publisher(String, "/off")

    def subscribed() -> set[str]:
        ends = rig.peers.graph.endpoints(kind="MS")
        return {item.topic for item in ends if item.node == "zmq_broker"}

    subscriber = rig.subscriber(b"/on")
    wait_until(lambda: subscribed() == {"/on"})
    subscriber.subscribe(b"of")  # without a slash, as many programs have it
    wait_until(lambda: subscribed() == {"/on", "/off"})
    subscriber.close()
    wait_until(lambda: subscribed() == set())


def test_a_subscriber_that_was_away_for_a_moment_gets_the_newest(
    make_rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of `metaros` 1.x closes its socket after every message; one that comes meanwhile is kept for it."""
    import metaros.broker.bridge
    from metaros.broker.demand import Demand

    monkeypatch.setattr(metaros.broker.bridge, "Demand", lambda: Demand(linger_s=60.0))
    rig = make_rig()
    publisher = rig.node.create_publisher(String, "/slow")
    first = rig.subscriber(b"/slow")
    found: list[list[bytes]] = []
    rig.until(
        lambda: found.extend(received(first)) or found,
        send=lambda: publisher.publish(String(data="first")),
    )
    first.close()
    wait_until(lambda: not rig.row("/slow", "TO_ZMQ").heard)
    before = rig.row("/slow", "TO_ZMQ").messages
    publisher.publish(String(data="meanwhile"))
    wait_until(lambda: rig.row("/slow", "TO_ZMQ").messages > before)
    second = rig.subscriber(b"/slow")
    rig.until(lambda: found.extend(received(second)) or b"meanwhile" in found[-1][0])


def test_two_frames_strict_json_and_a_chosen_few(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(
        two_frames=True,
        strict_json=True,
        only=(Glob("/scan"), Glob("/in/**")),
        types=TypeTable.parse(["/in/*=std_msgs/UInt8MultiArray"]),
    )
    subscriber, zmq_says = rig.subscriber(b""), rig.publisher()
    says = rig.node.create_publisher(LaserScan, "/scan")
    rig.node.create_publisher(String, "/private")
    blobs: list[bytes] = []
    rig.node.create_subscription(UInt8MultiArray, "/in/blob", lambda message: blobs.append(bytes(message.data)))
    found: list[list[bytes]] = []
    scan = LaserScan(ranges=[1.0, math.inf], angle_min=-1.0, angle_increment=0.5)
    rig.until(lambda: found.extend(received(subscriber)) or found, send=lambda: says.publish(scan))
    topic, payload = found[0]
    assert topic == b"/scan"
    value = json.loads(payload, parse_constant=pytest.fail)
    assert (value["ranges"], value["angles"]) == ([1.0, None], [-1.0, -0.5])
    rig.until(lambda: blobs, send=lambda: zmq_says.send_multipart([b"in/blob", b"\xff\x00\x01"]))
    assert blobs[0] == b"\xff\x00\x01"
    topics = {item.topic for item in rig.peers.graph.endpoints(kind="MS") if item.node == "zmq_broker"}
    assert topics == {"/scan"}


def test_a_taken_port_is_an_error_and_nothing_is_left(zenoh_router: str, rig: Rig) -> None:
    before = threads_now()
    with metaros.Context(connect=zenoh_router) as context:
        with pytest.raises(ConfigError, match="cannot listen on tcp://"):
            Broker(context, BrokerOptions(hub=HubOptions(xsub=rig.hub.xpub, xpub=rig.hub.xsub)))
        assert "/zmq_broker" not in {node.full_name for node in context.graph.nodes() if node.zid == context.zid}
    assert left_behind(before) == []


def test_dicts_and_bytes_of_a_node(rig: Rig) -> None:
    """Its plain Python topics: what JSON of no known shape, and what is no text, become."""
    heard: dict[str, Any] = {}
    rig.node.create_subscription(dict, "/status", lambda value: heard.__setitem__("status", value))
    rig.node.create_subscription(bytes, "/blob", lambda value: heard.__setitem__("blob", value))
    status = rig.node.create_publisher(dict, "/reply")
    publisher, subscriber = rig.publisher(), rig.subscriber(b"reply ")
    found: list[list[bytes]] = []

    def send() -> None:
        publisher.send(b'status {"battery": {"level": 0.5}, "ok": true}')
        publisher.send(b"blob \x00\xff")
        status.publish({"seen": [1, 2]})

    rig.until(lambda: found.extend(received(subscriber)) or (found and len(heard) == 2), send=send)
    assert heard == {"status": {"battery": {"level": 0.5}, "ok": True}, "blob": b"\x00\xff"}
    assert json.loads(found[0][0].removeprefix(b"reply ")) == {"seen": [1, 2]}
