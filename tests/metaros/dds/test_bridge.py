"""What a robot on DDS writes is in the ROS graph, and what is published there reaches it, byte for byte, once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from metaros.dds import bridge as bridge_module
from metaros.dds import discovery
from metaros.dds.plan import RouteKey
from metaros.dds.report import Direction
from metaros.errors import PeerError
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS
from metaros.wire import qos_transient_local
from tests.metaros.dds import dds_types as dds
from tests.metaros.dds.conftest import LATCHED, Rig
from tests.support.servers.dds import dds_domain
from tests.support.waiting import wait_until

STAMP_NS = 1_700_000_000_123_456_789


def row(rig: Rig, name: str, direction: str) -> Any:
    """Of the report."""
    rows = [row for row in rig.bridge.report().rows if (row.name, row.direction.name) == (name, direction)]
    return rows[0] if rows else None


def test_a_topic_of_dds_is_heard_with_its_time(rig: Rig) -> None:
    heard: list[tuple[Any, int]] = []
    rig.node.create_subscription(LaserScan, "/scan", lambda scan, info: heard.append((scan, info.source_stamp_ns)))
    stamp = dds.Time(sec=12, nanosec=34)
    scan = dds.LaserScan(dds.Header(stamp, "laser"), -1.5, 1.5, 0.5, 0.0, 0.1, 0.1, 30.0, [1.0, 2.5, 3.0], [])
    writer = rig.writer("rt/scan", dds.LaserScan)
    rig.until(lambda: heard, send=lambda: writer.write(scan, STAMP_NS))
    message, stamp_ns = heard[0]
    assert (message.header.stamp.sec, message.header.frame_id, message.ranges.tolist()) == (
        12,
        "laser",
        [1.0, 2.5, 3.0],
    )
    assert stamp_ns == STAMP_NS
    (found,) = [item for item in rig.node.graph.endpoints("/scan") if item.kind == "MP"]
    assert (found.type_name, found.node_full_name) == ("sensor_msgs/msg/LaserScan", "/dds_bridge")


def test_a_robot_on_dds_hears_commands_and_nothing_comes_back(rig: Rig) -> None:
    reader, writer = rig.reader("rt/cmd_vel", dds.Twist), rig.writer("rt/cmd_vel", dds.Twist)
    heard: list[float] = []
    rig.node.create_subscription(Twist, "/cmd_vel", lambda twist: heard.append(twist.linear.x))
    publisher = rig.node.create_publisher(Twist, "/cmd_vel")
    command = Twist()
    command.linear.x = 0.25
    got: list[Any] = []
    rig.until(
        lambda: got.extend(item for item in reader.take(50) if item.linear.x == 0.25) or got,
        send=lambda: publisher.publish(command),
    )
    own = dds.Twist(dds.Vector3(0.5, 0.0, 0.0), dds.Vector3(0.0, 0.0, 0.0))
    rig.until(lambda: 0.5 in heard, send=lambda: writer.write(own))
    mark = dds.Twist(dds.Vector3(0.75, 0.0, 0.0), dds.Vector3(0.0, 0.0, 0.0))
    writer.write(mark)
    wait_until(lambda: 0.75 in heard)
    publisher.publish(command)  # it arrives after whatever would have come back
    seen: list[float] = []
    wait_until(lambda: seen.extend(item.linear.x for item in reader.take(50)) or 0.25 in seen)
    assert seen.count(0.75) == 1  # from the robot's own writer, and not from the bridge again


def test_what_is_kept_for_who_comes_later_is_kept_over_the_bridge(rig: Rig) -> None:
    writer = rig.writer("rt/map_name", dds.String, LATCHED)
    writer.write(dds.String("hall"))
    heard: list[str] = []
    wait_until(lambda: row(rig, "/map_name", "TO_ROS") and row(rig, "/map_name", "TO_ROS").bridged == 1)
    rig.node.create_subscription(String, "/map_name", lambda text: heard.append(text.data), qos_transient_local)
    wait_until(lambda: heard == ["hall"])
    publisher = rig.node.create_publisher(String, "/goal_name", qos_transient_local)
    publisher.publish(String(data="dock"))
    reader = rig.reader("rt/goal_name", dds.String, LATCHED)
    got: list[Any] = []
    wait_until(lambda: got.extend(reader.take(10)) or got)
    assert [item.data for item in got] == ["dock"]


def test_services_of_either_side_are_called_from_the_other(rig: Rig) -> None:
    requests = rig.reader("rq/add_on_ddsRequest", dds.AddRequest)
    replies = rig.writer("rr/add_on_ddsReply", dds.AddResponse)
    client = rig.node.create_client(AddTwoInts, "/add_on_dds")
    assert client.wait_for_service(60)
    future = client.call_future(AddTwoInts.Request(a=40, b=2), 60)
    asked: list[Any] = []
    wait_until(lambda: asked.extend(requests.take(10)) or asked)
    request = asked[0]
    replies.write(dds.AddResponse(request.client_guid + 1, request.sequence_number, 7))  # to somebody else
    replies.write(dds.AddResponse(request.client_guid, request.sequence_number, request.a + request.b))
    assert future.result(60).sum == 42

    def add(request: Any, response: Any) -> None:
        if request.a < 0:
            raise PeerError("no")
        response.sum = request.a + request.b

    rig.node.create_service(AddTwoInts, "/add_on_ros", add)
    ask, answers = rig.writer("rq/add_on_rosRequest", dds.AddRequest), rig.reader("rr/add_on_rosReply", dds.AddResponse)
    got: list[Any] = []
    rig.until(lambda: got.extend(answers.take(10)) or got, send=lambda: ask.write(dds.AddRequest(99, 5, 20, 22)))
    assert (got[0].client_guid, got[0].sequence_number, got[0].sum) == (99, 5, 42)
    ask.write(dds.AddRequest(99, 6, -1, 1))  # DDS has no word for a refusal
    wait_until(lambda: row(rig, "/add_on_ros", "SERVED_BY_ROS").failed == 1)


def test_routes_go_with_who_wanted_them_and_problems_are_told(rig: Rig) -> None:
    writer = rig.writer("rt/short_lived", dds.String)
    wait_until(lambda: row(rig, "/short_lived", "TO_ROS"))
    del writer
    wait_until(lambda: row(rig, "/short_lived", "TO_ROS") is None)

    texts, other = rig.writer("rt/two_types", dds.String), DomainParticipant(dds_domain())
    twists: Any = DataWriter(other, Topic(other, "rt/two_types", dds.Twist))
    wait_until(lambda: any("/two_types" in text for text in rig.bridge.report().problems))
    assert row(rig, "/two_types", "TO_ROS") is None
    del texts, twists
    wait_until(lambda: not rig.bridge.report().problems)


class Broken:
    """A route with a fault of ours."""

    name, direction = "/broken", Direction.TO_DDS

    def __init__(self) -> None:
        self.asked = 0

    def work(self) -> bool:
        self.asked += 1
        raise ValueError("a fault")

    def close(self) -> None:
        """Nothing is open."""


def test_a_route_that_fails_does_not_hold_up_the_others(
    rig: Rig, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    heard: list[str] = []
    rig.node.create_subscription(String, "/beside", lambda message: heard.append(message.data))
    writer = rig.writer("rt/beside", dds.String)
    rig.until(lambda: heard, send=lambda: writer.write(dds.String("before")))
    broken, key, bridge = Broken(), RouteKey(Direction.TO_DDS, "/broken"), rig.bridge
    bridge._routes = {key: broken, **bridge._routes}  # type: ignore[dict-item]
    rig.until(lambda: "beside" in heard and broken.asked > 1, send=lambda: writer.write(dds.String("beside")))
    del bridge._routes[key]
    assert capfd.readouterr().err.count("/broken, ROS → DDS: a fault") == 1
    assert "stumbled" not in caplog.text


def test_endpoints_beyond_the_limit_are_left_out_and_told(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    few = replace(LIMITS, graph_entities=len(list(rig.bridge._discovery.endpoints)))
    for module in (bridge_module, discovery):
        monkeypatch.setattr(module, "LIMITS", few)
    writer = rig.writer("rt/one_too_many", dds.String)
    wait_until(lambda: any("what came later is not bridged" in problem for problem in rig.bridge.report().problems))
    assert row(rig, "/one_too_many", "TO_ROS") is None
    del writer
