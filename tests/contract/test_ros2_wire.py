"""The wire against rmw_zenoh's own golden vectors, and against a plain eclipse-zenoh session that knows no Meta-ROS."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_typestore

import metaros
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import DataKey, EndpointToken, gid_of, pack_attachment, parse_attachment, parse_key, parse_token
from tests.support.waiting import wait_until

VECTORS = json.loads((Path(__file__).parents[1] / "data" / "ros2_vectors.json").read_text())
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"


@pytest.mark.parametrize("vector", VECTORS["golden_cpp"], ids=lambda vector: vector["label"])
def test_tokens_gids_keys_and_qos_are_those_of_rmw_zenoh(vector):
    token = parse_token(vector["liveliness"])
    assert str(token) == vector["liveliness"]
    assert gid_of(vector["liveliness"]).hex() == vector["gid"]
    if isinstance(token, EndpointToken):
        assert token.qos.encode() == vector["qos"]
        key = DataKey(token.node.domain, token.topic, token.type_name, token.type_hash)
        assert str(key) == vector["topic_keyexpr"]
        assert parse_key(str(key)) == key


@pytest.mark.parametrize("vector", VECTORS["wire_reference"], ids=lambda vector: vector["key"][:40])
def test_whole_samples_are_those_of_rmw_zenoh(vector):
    token = parse_token(vector["liveliness"])
    assert isinstance(token, EndpointToken)
    data = pack_attachment(vector["sequence_number"], vector["source_timestamp"], token.gid)
    assert data.hex() == vector["attachment"]
    assert token.gid.hex() == vector["gid"]
    assert str(DataKey(token.node.domain, token.topic, token.type_name, token.type_hash)) == vector["key"]


def test_attachments_are_what_zenoh_itself_would_serialize():
    vector = VECTORS["z_serialize_check"]
    attachment = parse_attachment(bytes.fromhex(vector["bytes"]))
    assert (attachment.seq, attachment.source_ns, attachment.gid) == (1, 1_700_000_000_000_000_000, bytes(range(16)))
    native = zenoh.ext.z_serialize(
        (zenoh.ext.Int64(attachment.seq), zenoh.ext.Int64(attachment.source_ns), attachment.gid)
    )
    assert native.to_bytes() == pack_attachment(*attachment)


def test_captured_samples_of_other_implementations_are_read():
    for sample in [*VECTORS["sdk_capture"]["samples"], *VECTORS["advanced_tl_router_view"]["samples"]]:
        assert parse_key(sample["key"]).domain == 0
        assert parse_attachment(bytes.fromhex(sample["attachment"])).seq >= 0
    for entry in [*VECTORS["sdk_capture"]["liveliness"], *VECTORS["advanced_tl_router_view"]["liveliness"]]:
        if entry["key"].startswith("@ros2_lv"):  # the rest are Zenoh's own tokens of advanced publishers
            assert str(parse_token(entry["key"])) == entry["key"]


@pytest.fixture
def plain(zenoh_router: str) -> Iterator[zenoh.Session]:
    """A session as any Zenoh program opens one."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{zenoh_router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        yield session


@pytest.fixture
def context(zenoh_router: str) -> Iterator[metaros.Context]:
    with metaros.Context(domain_id=0, connect=zenoh_router) as opened:
        yield opened


def test_a_plain_subscriber_gets_cdr_that_rosbags_reads(plain, context):
    arrived: SimpleQueue[zenoh.Sample] = SimpleQueue()
    plain.declare_subscriber(CHATTER, zenoh.handlers.Callback(arrived.put, indirect=False))
    tokens = plain.liveliness()
    with metaros.Node("talker", context=context) as node:
        publisher = node.create_publisher(String, "chatter", 10)
        seen: list[str] = []

        def publish_and_look() -> bool:
            publisher.publish(String(data="Hello"))
            return not arrived.empty()

        wait_until(publish_and_look)
        sample = arrived.get()
        seen = [str(reply.ok.key_expr) for reply in tokens.get("@ros2_lv/0/**") if reply.ok is not None]
    message = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(sample.payload.to_bytes(), "std_msgs/msg/String")
    assert message.data == "Hello"
    assert sample.attachment is not None
    attachment = parse_attachment(sample.attachment.to_bytes())
    (token,) = [key for key in seen if "/MP/" in key and "%chatter" in key]
    assert attachment.gid == gid_of(token)
    assert attachment.seq >= 1
    assert str(sample.encoding) == "zenoh/bytes"
    assert token == str(publisher.token)


def test_a_plain_put_reaches_a_subscription(plain, context):
    got: list[tuple[Any, metaros.MessageInfo]] = []
    store = get_typestore(Stores.ROS2_JAZZY)
    payload = store.serialize_cdr(store.types["std_msgs/msg/String"](data="from afar"), "std_msgs/msg/String")
    gid = bytes(range(16))
    with metaros.Node("listener", context=context) as node:
        node.create_subscription(String, "/chatter", lambda message, info: got.append((message, info)), 10)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        count = 0

        def put_and_spin() -> bool:
            nonlocal count
            count += 1
            plain.put(CHATTER, bytes(payload), attachment=pack_attachment(count, 123, gid))
            executor.spin_once(0.05)
            return bool(got)

        wait_until(put_and_spin)
    message, info = got[0]
    assert message == String(data="from afar")
    assert (info.source_stamp_ns, info.gid) == (123, gid)


def test_a_plain_query_is_answered_as_rmw_zenoh_answers(plain, context):
    with metaros.Node("adder", context=context) as node:

        @node.service(AddTwoInts, "add_two_ints")
        def add(request: Any, response: Any) -> Any:
            response.sum = request.a + request.b
            return response

        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        vector = VECTORS["sdk_service_server_reply"]
        key = str(DataKey(0, "/add_two_ints", AddTwoInts.__metaros_name__, AddTwoInts.__metaros_hash__))
        assert key.split("/")[2:] == vector["key"].split("/")[2:]
        replies: SimpleQueue[zenoh.Reply] = SimpleQueue()

        def ask() -> bool:
            plain.get(
                key,
                zenoh.handlers.Callback(replies.put, indirect=False),
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                payload=bytes.fromhex(vector["request_payload"]),
                attachment=bytes.fromhex(vector["request_attachment"]),
            )
            executor.spin_once(0.1)
            return not replies.empty()

        wait_until(ask)
        reply = replies.get().ok
        assert reply is not None
        assert str(reply.key_expr) == key
        assert reply.payload.to_bytes().hex() == vector["payload"]
        assert reply.attachment is not None
        attachment = parse_attachment(reply.attachment.to_bytes())
        request = parse_attachment(bytes.fromhex(vector["request_attachment"]))
        assert (attachment.seq, attachment.gid) == (request.seq, request.gid)
        assert attachment.source_ns > request.source_ns


def test_a_late_plain_advanced_subscriber_gets_the_kept_sample_with_its_first_attachment(plain, context):
    with metaros.Node("latcher", context=context) as node:
        publisher = node.create_publisher(String, "map_name", metaros.qos_transient_local)
        publisher.publish(String(data="office"), stamp_ns=1_700_000_000_000_000_000)
        arrived: SimpleQueue[zenoh.Sample] = SimpleQueue()
        subscriber = zenoh.ext.declare_advanced_subscriber(
            plain,
            publisher.key,
            zenoh.handlers.Callback(arrived.put, indirect=False),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )
        wait_until(lambda: not arrived.empty())
        sample = arrived.get()
        subscriber.undeclare()
    assert sample.payload.to_bytes() == bytes.fromhex("00010000070000006f666669636500")
    assert sample.attachment is not None
    attachment = parse_attachment(sample.attachment.to_bytes())
    assert (attachment.seq, attachment.source_ns) == (1, 1_700_000_000_000_000_000)
    assert attachment.gid == publisher.gid
