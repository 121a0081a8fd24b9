"""The graph: nodes, endpoints with their QoS, hashes of types, and types by asking."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.ros2.cast import HASHLESS, OURS, Cast
from tests.ros2.participant import Participant, Seen, managed
from tests.ros2.raw.descriptions import ODD, ODD_HASH, rihs01
from tests.ros2.raw.layouts import HASHES, NO_HASH
from tests.ros2.samples import SAMPLES, same
from tests.ros2.scenarios import scenario
from tests.support.waiting import wait_until

pytestmark = pytest.mark.xdist_group("ros2")
VECTORS = json.loads((Path(__file__).parents[1] / "data" / "ros2_vectors.json").read_text())["real_ros2_jazzy_cdr"]
TEXT = "std_msgs/msg/String"
# Policies as ROS 2 calls them, and what rmw_zenoh_cpp writes for them.
PROFILES: list[tuple[dict[str, Any], str]] = [
    ({"depth": 10}, "::,10:,:,:,,"),
    ({"depth": 42}, "::,:,:,:,,"),
    ({"depth": 5, "reliability": "best_effort"}, "2::,5:,:,:,,"),
    ({"depth": 1, "durability": "transient_local"}, ":1:,1:,:,:,,"),
    ({"depth": 1000}, "::,1000:,:,:,,"),
]


@scenario("nodes and endpoints in the graph", told="appear", heard="look")
def test_nodes_and_endpoints_are_seen(teller: Participant, hearer: Participant) -> None:
    topic = f"/{teller.name}_{hearer.name}_seen"
    latched = f"{topic}_map"
    teller.speak(topic, TEXT, SAMPLES[TEXT])()
    teller.speak(latched, TEXT, SAMPLES[TEXT], latched=True)()
    teller.listen(topic, TEXT)
    wait_until(lambda: len(hearer.endpoints(topic)) == 2 and hearer.endpoints(latched))
    found = {seen.kind: seen for seen in hearer.endpoints(topic)}
    hashes = (NO_HASH, "INVALID") if teller.name in HASHLESS else (HASHES[TEXT],)  # INVALID is rclpy's word for none
    assert {seen.type_hash for seen in found.values()} <= {*hashes, ""}
    for kind in ("MP", "MS"):
        wanted = Seen(kind, found[kind].node, TEXT, found[kind].type_hash, "reliable", "volatile", found[kind].depth)
        assert found[kind] == wanted
        assert found[kind].depth in (10, 0)
        assert found[kind].node in hearer.nodes()
    (seen,) = hearer.endpoints(latched)
    assert (seen.reliability, seen.durability, seen.depth in (1, 0)) == ("reliable", "transient_local", True)
    wait_until(lambda: f"/{teller.name}" in hearer.nodes())


@scenario("types told by ~/get_type_description", told="tell types", heard="ask for types")
def test_types_are_told_by_their_hash(teller: Participant, hearer: Participant) -> None:
    """The hash is computed anew from what was told, by the standard alone."""
    teller.listen(f"/{teller.name}_typed", "sensor_msgs/msg/LaserScan")
    name = "sensor_msgs/msg/LaserScan"
    parts = hearer.describe(teller.name, name, HASHES[name])
    assert [part["type_name"] for part in parts] == [name, "builtin_interfaces/msg/Time", "std_msgs/msg/Header"]
    assert rihs01(parts) == HASHES[name]


@scenario("types that nobody else knows, by name alone", told="have a type of its own", heard="learn types")
def test_unknown_types_are_asked_for(teller: Participant, hearer: Participant) -> None:
    topic, fields = f"/{teller.name}_{hearer.name}_odd", {"head": {"data": "x"}, "numbers": [1, -2, 3]}
    say = teller.speak(topic, ODD, fields)
    heard = hearer.listen(topic, ODD)
    wait_until(lambda: (say() and False) or heard())
    assert same(heard()[0], fields)
    (seen,) = [seen for seen in hearer.endpoints(topic) if seen.kind == "MP"]
    assert seen.type_hash == ODD_HASH


@pytest.mark.parametrize("ours", [part.name for part in OURS])
def test_qos_strings_are_those_of_rmw_zenoh(cast: Cast, ours: str) -> None:
    side, raw = cast[ours], cast["raw"]
    with side.lending():
        for number, (policies, _) in enumerate(PROFILES):
            side.publish_with(f"/{ours}_qos_{number}", policies)
        wait_until(lambda: raw.qos_texts(f"/{ours}_qos_{len(PROFILES) - 1}"))
        found = [raw.qos_texts(f"/{ours}_qos_{number}") for number in range(len(PROFILES))]
    assert found == [[text] for _, text in PROFILES]


@pytest.mark.integration
@pytest.mark.parametrize("ours", [part.name for part in OURS])
def test_messages_of_real_rclpy_go_through_our_classes_and_come_back_byte_for_byte(cast: Cast, ours: str) -> None:
    """One of each of 93 types: heard, made a message, and published again, under keys with the real hashes."""
    side, raw = cast[ours], cast["raw"]
    vectors = {name: bytes.fromhex(texts[0]) for name, texts in VECTORS["vectors"].items() if name in HASHES}
    assert len(vectors) >= 90
    wrong = {}
    with side.lending(), raw.lending():
        puts, queues = {}, {}
        for name in vectors:
            topic = f"/{ours}_{name.replace('/', '_')}"
            side.relay(side_type(side, name), topic, f"{topic}_back")
            queues[name] = raw.raw_subscription(f"{topic}_back", name)
            puts[name] = raw.raw_publisher(topic, name)

        def all_came() -> bool:
            for name, queue in queues.items():
                if queue.empty():
                    puts[name](vectors[name])
            return not any(queue.empty() for queue in queues.values())

        wait_until(all_came, every_s=0.05)
        for name, queue in queues.items():
            came = queue.get().payload.to_bytes()
            if came != vectors[name]:
                wrong[name] = (came.hex(), vectors[name].hex())
    assert wrong == {}


def side_type(side: Any, name: str) -> Any:
    """The type as this side takes it."""
    return name if side.name == "native" else side.message_type(name)


def test_the_managed_nodes_of_both_faces_are_there(cast: Cast) -> None:
    names = [part.name for part in OURS if cast[part.name]]
    wanted = {f"/{name}" for ours in names for name in (ours, managed(ours))}
    wait_until(lambda: wanted <= cast["raw"].nodes())
