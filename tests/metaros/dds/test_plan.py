"""Which routes there are, from who is where."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from metaros.dds.names import Kind
from metaros.dds.plan import DdsEndpoint, Plan, make_plan
from metaros.dds.report import Direction
from metaros.idl import catalogue_of, type_hash
from metaros.wire import Durability, EndpointInfo, QoSProfile, Reliability

CYCLONE, FAST_DDS = UUID("01100000-0000-0000-0000-000000000001"), UUID("010f0000-0000-0000-0000-000000000001")
STRING = "std_msgs/msg/String"
SENSOR = QoSProfile(reliability=Reliability.BEST_EFFORT)
LATCHED = QoSProfile(durability=Durability.TRANSIENT_LOCAL)


def end(name: str, *, writes: bool, kind: Kind = Kind.TOPIC, **facts: Any) -> DdsEndpoint:
    known = {"type_name": STRING, "type_hash": "", "qos": QoSProfile(), "participant": CYCLONE, **facts}
    return DdsEndpoint(writes=writes, kind=kind, name=name, **known)


def in_graph(topic: str, kind: Any, qos: QoSProfile = SENSOR) -> EndpointInfo:
    return EndpointInfo(kind, "n", "/", topic, STRING, type_hash(STRING), qos, qos.encode(), b"", "1", None)


def plan(*dds: DdsEndpoint, graph: tuple[EndpointInfo, ...] = (), services: bool = True) -> Plan:
    return make_plan(dds, graph, allows=lambda name: name != "/secret", services=services, find=catalogue_of)


def routes(found: Plan) -> dict[str, list[str]]:
    by_name: dict[str, list[str]] = {}
    for key in found.routes:
        by_name.setdefault(key.name, []).append(key.direction.name)
    return by_name


def test_a_topic_has_a_route_for_each_side_that_wants_one() -> None:
    found = plan(
        end("/scan", writes=True, qos=SENSOR),
        end("/scan", writes=True),
        end("/cmd_vel", writes=False),
        end("/both", writes=True),
        end("/both", writes=False, qos=LATCHED),
        end("/secret", writes=True),
        graph=(in_graph("/cmd_vel", "MP"), in_graph("/both", "MP", LATCHED), in_graph("/ros_only", "MP")),
    )
    assert routes(found) == {"/scan": ["TO_ROS"], "/cmd_vel": ["TO_DDS"], "/both": ["TO_ROS", "TO_DDS"]}
    assert not found.problems
    by_key = {(key.direction, key.name): wanted for key, wanted in found.routes.items()}
    assert by_key[Direction.TO_ROS, "/scan"].qos.reliability is Reliability.BEST_EFFORT
    assert by_key[Direction.TO_DDS, "/cmd_vel"].qos.reliability is Reliability.BEST_EFFORT  # as its publisher
    assert by_key[Direction.TO_DDS, "/cmd_vel"].dds_qos.reliability is Reliability.RELIABLE
    latched = by_key[Direction.TO_DDS, "/both"]
    assert latched.qos.durability is latched.dds_qos.durability is Durability.TRANSIENT_LOCAL


def test_a_service_is_carried_to_the_side_that_has_none() -> None:
    service = {"type_name": "std_srvs/srv/Trigger", "kind": Kind.REQUEST}
    ends = (
        end("/on_dds", writes=False, **service),
        end("/on_ros", writes=True, **service),
        end("/on_both", writes=False, **service),
        end("/nowhere", writes=True, **service),
        end("/fast", writes=False, participant=FAST_DDS, **service),
    )
    graph = (in_graph("/on_ros", "SS"), in_graph("/on_both", "SS"))
    found = plan(*ends, graph=graph)
    assert routes(found) == {"/on_dds": ["SERVED_BY_DDS"], "/on_ros": ["SERVED_BY_ROS"]}
    assert [text for text in found.problems if "/fast" in text and "Fast DDS" in text] == list(found.problems)
    assert plan(*ends, graph=graph, services=False) == Plan()


def test_what_cannot_be_bridged_is_told() -> None:
    found = plan(
        end("/a", writes=True),
        end("/a", writes=True, type_name="std_msgs/msg/Bool"),
        end("/b", writes=True, type_name=""),
        end("/c", writes=True, type_name="nobody_msgs/msg/Knows"),
        end("/d", writes=True, type_hash="RIHS01_" + "0" * 64),
        end("/e", writes=True, type_hash=type_hash(STRING)),
    )
    assert routes(found) == {"/e": ["TO_ROS"]}
    assert [text.partition(":")[0] for text in found.problems] == ["/a", "/b", "/c", "/d"]
