"""Topics of a zenoh-bridge-ros2dds, played by Zenoh alone, in the ROS graph and back."""

from __future__ import annotations

from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh

import metaros
from metaros.cdr import codec
from metaros.errors import UnknownTypeError
from metaros.interfaces.std_msgs.msg import String
from metaros.node.mixed.plain_keys import Announced, PlainKeyBridge, parse_announced
from metaros.wire import qos_transient_local
from tests.support.nodes.raw_peer import open_session
from tests.support.waiting import wait_until

CODE = codec(String)


@pytest.fixture
def dds(zenoh_router: str) -> Iterator[zenoh.Session]:
    """The session of the other bridge."""
    with open_session(zenoh_router) as session:
        yield session


def test_what_it_announces_is_read() -> None:
    table = {
        "@ros2_lv/a1/MP/robot§scan/sensor_msgs§msg§LaserScan/:0::": Announced(
            True, "robot/scan", "sensor_msgs/msg/LaserScan", False
        ),
        "@ros2_lv/a1/MS/map/nav_msgs§msg§OccupancyGrid/:1:1:0,1": Announced(
            False, "map", "nav_msgs/msg/OccupancyGrid", True
        ),
        "@ros2_lv/a1/SS/add/example_interfaces§srv§AddTwoInts": None,
        "@ros2_lv/a1/MP/scan/sensor_msgs§msg§LaserScan/odd": None,
        "@ros2_lv/0/a1/0/0/NN/%/%/node": None,
        "@ros2_lv/a1": None,
    }
    assert {token: parse_announced(token) for token in table} == table


def test_announced_topics_go_both_ways_and_nothing_comes_back(
    here: metaros.Context, there: metaros.Context, dds: zenoh.Session
) -> None:
    heard, latched, told = [], [], []
    back: SimpleQueue[zenoh.Sample] = SimpleQueue()
    zid = str(dds.info.zid())
    tokens = [
        f"@ros2_lv/{zid}/MP/robot§talk/std_msgs§msg§String/:1::0,10",
        f"@ros2_lv/{zid}/MS/robot§talk/std_msgs§msg§String/:1::0,10",
        f"@ros2_lv/{zid}/MP/robot§map/std_msgs§msg§String/:1:1:0,1",
        f"@ros2_lv/{zid}/MP/robot§odd/odd_msgs§msg§Odd/:::",
        f"@ros2_lv/{zid}/MP/robot§not/std_msgs§msg§String/:::",
    ]
    kept = [dds.liveliness().declare_token(token) for token in tokens]
    cache = zenoh.ext.CacheConfig(max_samples=1)
    with (
        zenoh.ext.declare_advanced_publisher(dds, "robot/map", cache=cache, publisher_detection=True) as early,
        dds.declare_subscriber("robot/talk", back.put),
        PlainKeyBridge(here, notice=told.append, allows=lambda topic: topic != "/robot/not") as bridge,
        metaros.Node("ears", context=there) as node,
    ):
        early.put(CODE.encode(String(data="a map")))
        node.create_subscription(String, "/robot/talk", lambda one: heard.append(one.data), dedicated=True)
        node.create_subscription(
            String, "/robot/map", lambda one: latched.append(one.data), qos_transient_local, dedicated=True
        )
        publisher = node.create_publisher(String, "/robot/talk")
        wait_until(lambda: bridge.routes == [("/robot/map", True), ("/robot/talk", False), ("/robot/talk", True)])

        put: list[str] = []
        seen: list[str] = []

        def both() -> bool:
            put.append("from dds")
            dds.put("robot/talk", CODE.encode(String(data="from dds")))
            publisher.publish(String(data="from ros"))
            seen.extend(texts(back))
            return "from dds" in heard and "from ros" in seen

        wait_until(both)
        wait_until(lambda: latched == ["a map"])
        publisher.publish(String(data="last"))
        wait_until(lambda: (seen.extend(texts(back)), "last" in seen)[1])
        wait_until(lambda: "last" in heard)
        assert seen.count("from dds") == len(put)  # its subscriber hears its own puts, and nothing comes back
        assert [text for text in told if text.startswith("not bridged: /robot/odd")]
        assert not [text for text in told if "/robot/not" in text]
    for token in kept:
        token.undeclare()


def texts(arrived: SimpleQueue[zenoh.Sample]) -> list[str]:
    """What has come so far."""
    return [CODE.decode(arrived.get().payload.to_bytes()).data for _ in range(arrived.qsize())]


def test_a_table_and_a_prefix(here: metaros.Context, there: metaros.Context, dds: zenoh.Session) -> None:
    got: list[Any] = []
    back: SimpleQueue[zenoh.Sample] = SimpleQueue()
    with pytest.raises(UnknownTypeError):
        PlainKeyBridge(here, topics={"/x": "no_msgs/msg/Such"})
    with (
        PlainKeyBridge(here, topics={"/talk": "std_msgs/msg/String"}, prefix="fleet/r1/") as bridge,
        metaros.Node("ears", context=there) as node,
        dds.declare_subscriber("fleet/r1/talk", back.put),
    ):
        assert bridge.routes == [("/talk", False), ("/talk", True)]
        node.create_subscription(String, "/talk", lambda one: got.append(one.data), dedicated=True)
        publisher = node.create_publisher(String, "/talk")
        wait_until(lambda: (dds.put("fleet/r1/talk", CODE.encode(String(data="in"))), "in" in got)[1])
        wait_until(lambda: (publisher.publish(String(data="out")), "out" in texts(back))[1])
        bridge.close()
    assert bridge.routes == []
