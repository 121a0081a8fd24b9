"""A `@message` class as a plain eclipse-zenoh peer meets it: it knows no Meta-ROS, only the wire and rosbags.

It finds the topic by its liveliness token, asks the publishing node for the definition, computes the hash as REP 2011
says, reads the samples with rosbags and publishes its own.
"""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Iterator
from enum import IntEnum
from queue import SimpleQueue
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import metaros
from metaros.interfaces.geometry_msgs.msg import Point
from metaros.interfaces.std_msgs.msg import Header
from tests.support.nodes.raw_peer import RawPeer, open_session, unpack_attachment
from tests.support.waiting import wait_until

HASHES_SERVICE = "RIHS01_69b9c19c1021405984cc60dbbb1edceb147a6538b411d812ba6afabeed962cd5"
DDS_SERVICE = "type_description_interfaces::srv::dds_::GetTypeDescription_"
RESPONSE = """
bool successful
string failure_reason
type_description_interfaces/TypeDescription type_description
type_description_interfaces/TypeSource[] type_sources
type_description_interfaces/KeyValue[] extra_information
"""
REQUEST = "string type_name\nstring type_hash\nbool include_type_sources\n"


class Gear(IntEnum):
    """How it drives."""

    PARK = 0
    DRIVE = 4


@metaros.message(name="zoo_robot/msg/WheelState")
class WheelState:
    """One wheel."""

    joint: Annotated[str, metaros.Bounded(16)] = "left"
    speed: metaros.float32 = 0.5
    contact: Point


@metaros.message(name="zoo_robot/msg/BaseState")
class BaseState:
    """Everything a field can be."""

    MAX_WHEELS: ClassVar[metaros.uint8] = 6

    header: Header
    gear: Annotated[Gear, metaros.Exact("uint8")] = Gear.PARK
    ready: bool = True
    ticks: int = -1
    wheels: Annotated[list[WheelState], metaros.Bounded(6)]
    names: list[str]
    blob: bytes
    pose: Annotated[NDArray[np.float64], metaros.Shape(3, 4)]
    points: Annotated[NDArray[np.float32], metaros.Shape(None, 3)]
    origin: tuple[float, float, float] = (0.0, 1.0, 2.0)


def sample_state() -> BaseState:
    return BaseState(
        header=Header(frame_id="base"),
        gear=Gear.DRIVE,
        ticks=-(2**40),
        wheels=[WheelState(), WheelState(joint="right", contact=Point(x=1.0, z=-2.0))],
        names=["a", "bé"],
        blob=b"\0\1\xff",
        pose=np.arange(12.0).reshape(3, 4),
        points=[[1, 2, 3], [4, 5, 6]],
    )


@pytest.fixture
def arrived() -> SimpleQueue[BaseState]:
    return SimpleQueue()


@pytest.fixture
def robot(zenoh_router: str, arrived: SimpleQueue[BaseState]) -> Iterator[metaros.Node]:
    with (
        metaros.Context(domain_id=0, connect=zenoh_router) as context,
        metaros.Node("zoo", namespace="/ns", context=context) as node,
    ):
        publisher = node.create_publisher(BaseState, "state")
        node.create_timer(0.05, lambda: publisher.publish(sample_state()))
        node.create_subscription(BaseState, "wish", arrived.put)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


@pytest.fixture
def peer(zenoh_router: str) -> Iterator[RawPeer]:
    with open_session(zenoh_router) as session:
        yield RawPeer(session)


def endpoint(peer: RawPeer, kind: str, topic: str) -> list[str]:
    """The parts of the one token of that kind and topic."""
    found: list[list[str]] = []

    def look() -> bool:
        found[:] = [parts for token in peer.tokens() if (parts := token.split("/"))[5:6] == [kind] and topic in parts]
        return bool(found)

    wait_until(look)
    return found[0]


def describe(peer: RawPeer, node: str, name: str, type_hash: str) -> Any:
    """What the node's service answers, by rosbags alone."""
    endpoint(peer, "SS", f"{node}%get_type_description".replace("/", "%"))
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(REQUEST, "peer_msgs/msg/Request"))
    store.register(get_types_from_msg(RESPONSE, "peer_msgs/msg/Response"))
    request = store.types["peer_msgs/msg/Request"](type_name=name, type_hash=type_hash, include_type_sources=True)
    client = peer.client(f"{node}/get_type_description", DDS_SERVICE, HASHES_SERVICE)
    answer = client.ask(bytes(store.serialize_cdr(request, "peer_msgs/msg/Request")))
    return store.deserialize_cdr(answer, "peer_msgs/msg/Response")


def rihs01(described: Any) -> str:
    """REP 2011: sha256 of the JSON of the description, defaults left out."""

    def individual(part: Any) -> dict[str, Any]:
        fields = []
        for field in part.fields:
            kind = field.type
            numbers = {key: int(getattr(kind, key)) for key in ("type_id", "capacity", "string_capacity")}
            fields.append({"name": field.name, "type": {**numbers, "nested_type_name": kind.nested_type_name}})
        return {"type_name": part.type_name, "fields": fields}

    referenced = sorted(described.referenced_type_descriptions, key=lambda part: part.type_name)
    text = json.dumps(
        {
            "type_description": individual(described.type_description),
            "referenced_type_descriptions": [individual(part) for part in referenced],
        }
    )
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


def store_of(sources: list[Any]) -> Any:
    """A rosbags store with the published definitions."""
    store, types = get_typestore(Stores.EMPTY), {}
    for source in sources:
        assert source.encoding == "msg"
        types.update(get_types_from_msg(source.raw_file_contents, source.type_name))
    store.register(types)
    return store


def test_a_raw_peer_understands_a_custom_message_both_ways(robot, peer, arrived):
    parts = endpoint(peer, "MP", "%ns%state")
    dds, type_hash = parts[10], parts[11]
    assert dds == "zoo_robot::msg::dds_::BaseState_"
    answer = describe(peer, "/ns/zoo", "zoo_robot/msg/BaseState", type_hash)
    assert (answer.successful, answer.failure_reason) == (True, "")
    assert rihs01(answer.type_description) == type_hash
    assert {source.type_name for source in answer.type_sources} == {
        "zoo_robot/msg/BaseState",
        "zoo_robot/msg/WheelState",
        "geometry_msgs/msg/Point",
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
    }
    store = store_of(answer.type_sources)
    assert store.hash_rihs01("zoo_robot/msg/BaseState") == type_hash

    samples = peer.subscribe("/ns/state", dds, type_hash, "::,10:,:,:,,")
    sample = samples.get(timeout=60)
    assert len(unpack_attachment(sample.attachment.to_bytes())[2]) == 16
    received = store.deserialize_cdr(sample.payload.to_bytes(), "zoo_robot/msg/BaseState")
    assert (received.header.frame_id, received.gear, received.GEAR_DRIVE, received.ready, received.ticks) == (
        "base",
        4,
        4,
        True,
        -(2**40),
    )
    assert [(wheel.joint, wheel.speed, wheel.contact.z) for wheel in received.wheels] == [
        ("left", 0.5, 0.0),
        ("right", 0.5, -2.0),
    ]
    assert (received.names, received.blob.tobytes()) == (["a", "bé"], b"\0\1\xff")
    assert received.pose.tolist() == list(range(12))
    assert received.points.tolist() == [1, 2, 3, 4, 5, 6]
    assert received.MAX_WHEELS == 6

    received.ticks, received.header.frame_id = 7, "peer"
    publish = peer.publisher("/ns/wish", dds, type_hash, "::,10:,:,:,,")
    payload = bytes(store.serialize_cdr(received, "zoo_robot/msg/BaseState"))

    def came() -> bool:
        publish(payload)
        return not arrived.empty()

    wait_until(came)
    state = arrived.get()
    assert type(state) is BaseState
    expected = sample_state()
    expected.ticks, expected.header.frame_id = 7, "peer"
    assert state == expected
    assert (state.pose.shape, state.points.shape, state.gear) == ((3, 4), (2, 3), Gear.DRIVE)
    assert type(state.wheels[0]) is WheelState


def test_another_hash_is_refused_by_name(robot, peer):
    wrong = f"RIHS01_{'0' * 64}"
    answer = describe(peer, "/ns/zoo", "zoo_robot/msg/BaseState", wrong)
    assert not answer.successful
    assert answer.failure_reason == f"zoo_robot/msg/BaseState is {BaseState.__metaros_hash__} here, not {wrong}"
