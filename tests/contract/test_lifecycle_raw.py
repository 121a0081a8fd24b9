"""A plain eclipse-zenoh program, written from the wire sheet alone, leads a lifecycle node of ours through its life.

Nothing of metaros is used on its side: keys, hashes, CDR, attachments, GIDs and QoS strings are spelled out here.
"""

from __future__ import annotations

import itertools
import json
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue

import pytest
import xxhash
import zenoh
import zenoh.ext

import metaros
from metaros.node.lifecycle import HealthRule, TopicRate
from tests.support.waiting import wait_until

HASHES = json.loads((Path(__file__).parents[1] / "data" / "ros2_rihs01.json").read_text())["distros"]["jazzy"]["hashes"]
CHANGE = "RIHS01_356fe34f0475a43acf54542013af4167b0e729f77ea22ffb045c6ad8e20668e5"
GET = "RIHS01_800a0a5aae599782b02932de0caf563f6dc4e7e94b794eadde075ba2cbef9795"
STATES = "RIHS01_00a07d79d2207d71e81a8cbc1880e5d924cc16d4688ea8e8e06e443dc8f8aa1d"
TRANSITIONS = "RIHS01_59b7ecefce0982a8a844b9f2c4f14764c1c4543cc55e72924e2aa4adad83e9bc"
EVENT = "RIHS01_d5f8873a2f0146498f812d7885c7327ce27e463d36811d8792f35ee38c0d6c38"
HEADER = bytes.fromhex("00010000")
SERVICES = {
    "change_state": ("ChangeState_", CHANGE),
    "get_state": ("GetState_", GET),
    "get_available_states": ("GetAvailableStates_", STATES),
    "get_available_transitions": ("GetAvailableTransitions_", TRANSITIONS),
    "get_transition_graph": ("GetAvailableTransitions_", TRANSITIONS),
}


class Reader:
    """Plain CDR, little-endian: numbers at their alignment, strings with length and NUL."""

    def __init__(self, data: bytes) -> None:
        assert data[:4] == HEADER
        self.data, self.at = data[4:], 0

    def number(self, size: int) -> int:
        self.at += -self.at % size
        value = int.from_bytes(self.data[self.at : self.at + size], "little")
        self.at += size
        return value

    def text(self) -> str:
        length = self.number(4)
        raw = self.data[self.at : self.at + length]
        self.at += length
        assert raw[-1:] == b"\0"
        return raw[:-1].decode()

    def named(self) -> tuple[int, str]:
        """A State or a Transition."""
        return self.number(1), self.text()


def named(number: int, label: str = "") -> bytes:
    """A ChangeState_Request: id at 0, padding, length of the label with its NUL, label."""
    return HEADER + struct.pack("<B3xI", number, len(label) + 1) + label.encode() + b"\0"


class RawClient:
    """A service client as rmw_zenoh_cpp makes one: a liveliness token, its GID, a query with an attachment."""

    def __init__(self, session: zenoh.Session, node: str, service: str) -> None:
        kind, digest = SERVICES[service]
        self.key = f"0/{node}/{service}/lifecycle_msgs::srv::dds_::{kind}/{digest}"
        zid = session.info.zid()
        token = (
            f"@ros2_lv/0/{zid}/0/7/SC/%/%/raw/%{node}%{service}/lifecycle_msgs::srv::dds_::{kind}/{digest}/::,10:,:,:,,"
        )
        self.gid = xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")
        self.token = session.liveliness().declare_token(token)
        self._session, self._seq = session, itertools.count(1)

    def call(self, payload: bytes = HEADER + b"\0") -> bytes:
        """The reply's payload; its attachment must be that of a ROS 2 server."""
        seq = next(self._seq)
        replies = list(
            self._session.get(
                self.key,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=60.0,
                payload=payload,
                attachment=struct.pack("<qqB", seq, 1_700_000_000_000_000_000, 16) + self.gid,
            )
        )
        (reply,) = [reply.ok for reply in replies]
        assert reply is not None
        assert str(reply.key_expr) == self.key
        assert reply.attachment is not None
        attachment = reply.attachment.to_bytes()
        assert len(attachment) == 33
        sent_seq, stamp_ns, length = struct.unpack("<qqB", attachment[:17])
        assert (sent_seq, length, attachment[17:]) == (seq, 16, self.gid)
        assert stamp_ns > 1_700_000_000_000_000_000
        return bytes(reply.payload.to_bytes())


@pytest.fixture
def plain(zenoh_router: str) -> Iterator[zenoh.Session]:
    """A session as any Zenoh program opens one."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{zenoh_router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    with zenoh.open(config) as session:
        yield session


@pytest.fixture
def lidar(zenoh_router: str) -> Iterator[metaros.LifecycleNode]:
    """Our node, spinning."""
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        with metaros.LifecycleNode("lidar", context=context) as node:
            node.watch_health(HealthRule("scan", TopicRate("scan", below_hz=5)), grace_s=0.0)
            executor = metaros.SingleThreadedExecutor()
            executor.add_node(node)
            thread = threading.Thread(target=executor.spin)
            thread.start()
            yield node
            executor.shutdown()
            thread.join()


def tokens_of(session: zenoh.Session, node: str) -> dict[str, list[str]]:
    """Tokens of a node's endpoints, split, by name as it stands in them."""
    keys = [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/0/**") if reply.ok is not None]
    rows = [key.split("/") for key in keys]
    return {row[9]: row for row in rows if len(row) > 9 and row[8] == node}


def test_hashes_in_this_file_are_those_of_the_ros2_generator() -> None:
    for kind, digest in SERVICES.values():
        assert HASHES[f"lifecycle_msgs/srv/{kind[:-1]}"] == digest
    assert HASHES["lifecycle_msgs/msg/TransitionEvent"] == EVENT


def test_a_raw_peer_finds_the_interfaces_in_the_graph(plain, lidar):
    found: dict[str, list[str]] = {}

    def look() -> bool:
        found.update(tokens_of(plain, "lidar"))
        return "%lidar%health" in found and "%lidar%get_transition_graph" in found

    wait_until(look)
    for service, (kind, digest) in SERVICES.items():
        row = found[f"%lidar%{service}"]
        assert row[5:9] == ["SS", "%", "%", "lidar"]
        assert row[10:] == [f"lifecycle_msgs::srv::dds_::{kind}", digest, "::,10:,:,:,,"]
    event = found["%lidar%transition_event"]
    assert (event[5], *event[10:]) == ("MP", "lifecycle_msgs::msg::dds_::TransitionEvent_", EVENT, "::,10:,:,:,,")
    health = found["%lidar%health"]
    digest = HASHES["diagnostic_msgs/msg/DiagnosticArray"]
    assert health[10:] == ["diagnostic_msgs::msg::dds_::DiagnosticArray_", digest, ":1:,1:,:,:,,"]


def test_a_raw_peer_reads_states_and_changes_them(plain, lidar):
    arrived: SimpleQueue[zenoh.Sample] = SimpleQueue()
    event_key = f"0/lidar/transition_event/lifecycle_msgs::msg::dds_::TransitionEvent_/{EVENT}"
    plain.declare_subscriber(event_key, zenoh.handlers.Callback(arrived.put, indirect=False))
    change, get = RawClient(plain, "lidar", "change_state"), RawClient(plain, "lidar", "get_state")
    wait_until(lambda: tokens_of(plain, "lidar").get("%lidar%get_state"))
    assert get.call() == HEADER + bytes.fromhex("01000000 0d000000") + b"unconfigured\0"
    assert change.call(named(1)) == HEADER + b"\x01"
    assert get.call() == HEADER + bytes.fromhex("02000000 09000000") + b"inactive\0"
    assert change.call(named(0, "activate")) == HEADER + b"\x01"
    assert change.call(named(1)) == HEADER + b"\x00"  # refused: it is active
    assert get.call() == HEADER + bytes.fromhex("03000000 07000000") + b"active\0"
    assert lidar.state.label == "active"
    wait_until(lambda: arrived.qsize() == 4)
    token = "/".join(tokens_of(plain, "lidar")["%lidar%transition_event"])
    seen = []
    for number in range(1, 5):
        sample = arrived.get()
        assert sample.attachment is not None
        attachment = sample.attachment.to_bytes()
        assert struct.unpack("<q", attachment[:8]) == (number,)
        assert attachment[17:] == xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")
        reader = Reader(sample.payload.to_bytes())
        assert reader.number(8) > 1_700_000_000_000_000_000
        seen.append((reader.named(), reader.named(), reader.named()))
    assert seen == [
        ((1, "configure"), (1, "unconfigured"), (10, "configuring")),
        ((10, "transition_success"), (10, "configuring"), (2, "inactive")),
        ((3, "activate"), (2, "inactive"), (13, "activating")),
        ((30, "transition_success"), (13, "activating"), (3, "active")),
    ]


def test_a_raw_peer_lists_states_and_transitions(plain, lidar):
    wait_until(lambda: tokens_of(plain, "lidar").get("%lidar%get_transition_graph"))
    reader = Reader(RawClient(plain, "lidar", "get_available_states").call())
    states = [reader.named() for _ in range(reader.number(4))]
    assert states[1:5] == [(1, "unconfigured"), (2, "inactive"), (3, "active"), (4, "finalized")]
    assert [number for number, _ in states] == [*range(5), *range(10, 16)]
    reader = Reader(RawClient(plain, "lidar", "get_available_transitions").call())
    offered = [(reader.named(), reader.named(), reader.named()) for _ in range(reader.number(4))]
    assert offered == [
        ((1, "configure"), (1, "unconfigured"), (10, "configuring")),
        ((5, "shutdown"), (1, "unconfigured"), (12, "shuttingdown")),
    ]
    reader = Reader(RawClient(plain, "lidar", "get_transition_graph").call())
    graph = [(reader.named(), reader.named(), reader.named()) for _ in range(reader.number(4))]
    assert len(graph) == 25
    assert ((62, "transition_error"), (15, "errorprocessing"), (4, "finalized")) in graph


def test_a_raw_late_subscriber_gets_the_health_that_was_published_before(plain, lidar):
    assert lidar.trigger("configure")
    key = f"0/lidar/health/diagnostic_msgs::msg::dds_::DiagnosticArray_/{HASHES['diagnostic_msgs/msg/DiagnosticArray']}"
    arrived: SimpleQueue[zenoh.Sample] = SimpleQueue()
    subscriber = zenoh.ext.declare_advanced_subscriber(
        plain,
        key,
        zenoh.handlers.Callback(arrived.put, indirect=False),
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
    )
    wait_until(lambda: not arrived.empty())
    reader = Reader(arrived.get().payload.to_bytes())
    stamp_s, _ns, _frame, count = reader.number(4), reader.number(4), reader.text(), reader.number(4)
    assert stamp_s > 1_700_000_000
    assert count == 2
    assert (reader.number(1), reader.text(), reader.text()) == (0, "/lidar", "healthy (inactive: not judged)")
    subscriber.undeclare()
