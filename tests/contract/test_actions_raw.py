"""Actions against peers written from the wire sheet alone: their goals to us, and ours to them, byte for byte."""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node import GoalState, ServerGoal
from tests.support.nodes.raw_peer import (
    CDR,
    STAMP_NS,
    RawPeer,
    gid_of,
    open_session,
    pack_attachment,
    unpack_attachment,
)
from tests.support.waiting import wait_until

HASHES = json.loads((Path(__file__).parents[1] / "data" / "ros2_rihs01.json").read_text())
SEND = (
    "/fibonacci/_action/send_goal",
    "example_interfaces::action::dds_::Fibonacci_SendGoal_",
    "RIHS01_d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557",
)
CANCEL = (
    "/fibonacci/_action/cancel_goal",
    "action_msgs::srv::dds_::CancelGoal_",
    "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
)
RESULT = (
    "/fibonacci/_action/get_result",
    "example_interfaces::action::dds_::Fibonacci_GetResult_",
    "RIHS01_1b0de0d5d29dc955d92f546706568428632771db13ec84c15ec1c1a59f424a57",
)
FEEDBACK = (
    "/fibonacci/_action/feedback",
    "example_interfaces::action::dds_::Fibonacci_FeedbackMessage_",
    "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2",
)
STATUS = (
    "/fibonacci/_action/status",
    "action_msgs::msg::dds_::GoalStatusArray_",
    "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
)
SERVICE_QOS, FEEDBACK_QOS, STATUS_QOS = "::,10:,:,:,,", "::,10:,:,:,,", ":1:,1:,:,:,,"
GOAL_ID = bytes(range(1, 17))
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(1, 7)


@pytest.fixture
def peer(zenoh_router: str) -> Iterator[RawPeer]:
    with open_session(zenoh_router) as session:
        yield RawPeer(session)


@pytest.fixture
def node(zenoh_router: str) -> Iterator[metaros.Node]:
    """Ours; it spins."""
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        node = metaros.Node("ours", context=context)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


def ints(*values: int) -> bytes:
    return struct.pack(f"<I{len(values)}i", len(values), *values)


def stamp(ns: int) -> bytes:
    return struct.pack("<iI", *divmod(ns, 1_000_000_000))


def statuses(payload: bytes) -> list[tuple[bytes, int]]:
    """The goals of a GoalStatusArray, and where they are."""
    assert payload[:4] == CDR
    (count,) = struct.unpack_from("<I", payload, 4)
    found, offset = [], 8
    for _ in range(count):
        goal_id = payload[offset : offset + 16]
        offset += 16
        offset += -offset % 4
        sec, _, status = struct.unpack_from("<iIb", payload, offset)
        assert sec > 1_600_000_000
        offset += 9
        found.append((goal_id, status))
    assert offset == len(payload)
    return found


def drain(queue: SimpleQueue[zenoh.Sample]) -> list[bytes]:
    return [queue.get().payload.to_bytes() for _ in range(queue.qsize())]


# -- raw clients of our server -----------------------------------------------------------------------------------------


def start_server(node: metaros.Node, peer: RawPeer, execute: Any) -> None:
    node.create_action_server(Fibonacci, "fibonacci", execute)
    wait_until(lambda: any("/MP/" in token and "%fibonacci%_action%status" in token for token in peer.tokens()))


def patient(goal: ServerGoal) -> Any:
    goal.publish_feedback(Fibonacci.Feedback(sequence=[0, 1]))
    if goal.pause(60) and goal.is_cancel_requested:
        goal.canceled(Fibonacci.Result(sequence=[0, 1]))
    return None


def test_our_server_declares_what_a_ros2_server_declares(node, peer):
    start_server(node, peer, patient)
    wait_until(lambda: len([token for token in peer.tokens() if "%fibonacci%" in token]) == 5)
    ours = [token for token in peer.tokens() if "%fibonacci%" in token]
    expected = [
        ("SS", *SEND, SERVICE_QOS),
        ("SS", *CANCEL, SERVICE_QOS),
        ("SS", *RESULT, SERVICE_QOS),
        ("MP", *FEEDBACK, FEEDBACK_QOS),
        ("MP", *STATUS, STATUS_QOS),
    ]
    ends = [f"{kind}/%/%/ours/{name.replace('/', '%')}/{dds}/{h}/{qos}" for kind, name, dds, h, qos in expected]
    assert sorted(token.split("/", 5)[5] for token in ours) == sorted(ends)


def test_a_raw_client_sends_a_goal_gets_feedback_and_result(node, peer):
    def execute(goal: ServerGoal) -> Any:
        sequence = [0, 1]
        for number in range(1, goal.request.order):
            sequence.append(sequence[number] + sequence[number - 1])
            goal.publish_feedback(Fibonacci.Feedback(sequence=sequence))
        return Fibonacci.Result(sequence=sequence)

    start_server(node, peer, execute)
    feedback, status = peer.subscribe(*FEEDBACK, FEEDBACK_QOS), peer.subscribe(*STATUS, STATUS_QOS)
    send, result = peer.client(*SEND), peer.client(*RESULT)
    answer = send.ask(CDR + GOAL_ID + struct.pack("<i", 3))
    assert len(answer) == 4 + 12
    assert answer[:8] == CDR + b"\x01\x00\x00\x00"  # accepted
    assert struct.unpack_from("<i", answer, 8)[0] > 1_600_000_000
    expected = CDR + bytes([SUCCEEDED, 0, 0, 0]) + ints(0, 1, 1, 2)
    assert result.ask(CDR + GOAL_ID) == expected
    assert result.ask(CDR + GOAL_ID) == expected  # kept
    wait_until(lambda: feedback.qsize() == 2)
    samples = [feedback.get() for _ in range(2)]
    assert [sample.payload.to_bytes() for sample in samples] == [
        CDR + GOAL_ID + ints(0, 1, 1),
        CDR + GOAL_ID + ints(0, 1, 1, 2),
    ]
    assert {str(sample.key_expr) for sample in samples} == {"0" + "/".join(FEEDBACK)}
    (token,) = [token for token in peer.tokens() if "/MP/" in token and "feedback" in token]
    attachments = [unpack_attachment(sample.attachment.to_bytes()) for sample in samples if sample.attachment]
    assert [(seq, gid) for seq, _, gid in attachments] == [(1, gid_of(token)), (2, gid_of(token))]
    seen: list[list[tuple[bytes, int]]] = []
    wait_until(lambda: seen.extend(map(statuses, drain(status))) or (seen and seen[-1] == [(GOAL_ID, SUCCEEDED)]))
    late = peer.subscribe(*STATUS, STATUS_QOS)
    wait_until(lambda: not late.empty())
    assert statuses(late.get().payload.to_bytes()) == [(GOAL_ID, SUCCEEDED)]


def test_a_raw_client_cancels_by_id_and_all(node, peer):
    start_server(node, peer, patient)
    feedback = peer.subscribe(*FEEDBACK, FEEDBACK_QOS)
    send, cancel, result = peer.client(*SEND), peer.client(*CANCEL), peer.client(*RESULT)
    accepted = send.ask(CDR + GOAL_ID + struct.pack("<i", 5))
    accepted_stamp = accepted[8:16]
    assert send.ask(CDR + GOAL_ID + struct.pack("<i", 5))[4] == 0  # the id is taken
    seq, replies, _ = result.start(CDR + GOAL_ID)  # held until it is done
    wait_until(lambda: not feedback.empty())  # it has begun
    assert cancel.ask(CDR + bytes(15) + b"\x09" + stamp(0)) == CDR + bytes([2, 0, 0, 0]) + bytes(4)  # unknown
    info = GOAL_ID + accepted_stamp
    assert replies.empty()
    assert cancel.ask(CDR + GOAL_ID + stamp(0)) == CDR + bytes([0, 0, 0, 0]) + struct.pack("<I", 1) + info
    expected = CDR + bytes([CANCELED, 0, 0, 0]) + ints(0, 1)
    assert result.check(seq, replies.get(timeout=60)) == expected
    assert cancel.ask(CDR + GOAL_ID + stamp(0)) == CDR + bytes([3, 0, 0, 0]) + bytes(4)  # it has ended
    second = bytes(reversed(GOAL_ID))
    info = second + send.ask(CDR + second + struct.pack("<i", 5))[8:16]
    wait_until(lambda: feedback.qsize() == 2)  # one that is cancelled before it has begun has nothing to give
    assert cancel.ask(CDR + bytes(16) + stamp(0)) == CDR + bytes(4) + struct.pack("<I", 1) + info  # all
    assert result.ask(CDR + second) == expected
    assert result.ask(CDR + bytes(15) + b"\x09") == CDR + bytes(4) + ints()  # status unknown


# -- our client of a raw server ----------------------------------------------------------------------------------------


class RawServer:
    """Accepts every goal but order 0, gives one piece of feedback, ends when cancelled or at once for order 1."""

    def __init__(self, peer: RawPeer) -> None:
        self.requests: list[tuple[str, bytes]] = []
        self.results: dict[bytes, zenoh.Query] = {}
        for part, answer in ((SEND, self.accept), (CANCEL, self.cancel), (RESULT, self.result)):
            peer.serve(*part, self.noting(part[0], answer))
        self.feedback = peer.publisher(*FEEDBACK, FEEDBACK_QOS)
        self.status = peer.publisher(*STATUS, STATUS_QOS)

    def noting(self, name: str, answer: Any) -> Any:
        def handle(query: zenoh.Query) -> None:
            assert query.payload is not None
            data = query.payload.to_bytes()
            self.requests.append((name, data))
            answer(query, data)

        return handle

    @staticmethod
    def reply(query: zenoh.Query, data: bytes) -> None:
        assert query.attachment is not None
        seq, _, gid = unpack_attachment(query.attachment.to_bytes())
        with query:
            query.reply(str(query.key_expr), CDR + data, attachment=pack_attachment(seq, STAMP_NS, gid))

    def tell(self, goal_id: bytes, status: int) -> None:
        self.status(CDR + struct.pack("<I", 1) + goal_id + stamp(STAMP_NS) + struct.pack("<b", status))

    def accept(self, query: zenoh.Query, data: bytes) -> None:
        goal_id, order = data[4:20], struct.unpack_from("<i", data, 20)[0]
        self.reply(query, bytes([order > 0, 0, 0, 0]) + stamp(STAMP_NS))
        self.tell(goal_id, EXECUTING)
        self.feedback(CDR + goal_id + ints(0, 1))
        self.feedback(CDR + bytes(16) + ints(6, 6, 6))  # somebody else's

    def cancel(self, query: zenoh.Query, data: bytes) -> None:
        goal_id = data[4:20]
        self.reply(query, bytes(4) + struct.pack("<I", 1) + goal_id + stamp(STAMP_NS))
        self.finish(goal_id, CANCELED)

    def result(self, query: zenoh.Query, data: bytes) -> None:
        self.results[data[4:20]] = query

    def finish(self, goal_id: bytes, status: int) -> None:
        wait_until(lambda: goal_id in self.results)
        self.tell(goal_id, status)
        self.reply(self.results.pop(goal_id), bytes([status, 0, 0, 0]) + ints(0, 1, 1))


def test_our_client_drives_a_raw_server(node, peer):
    server = RawServer(peer)
    client = node.create_action_client(Fibonacci, "fibonacci")
    assert client.wait_for_server(60)
    wait_until(lambda: len([token for token in peer.tokens() if "/ours/%fibonacci%" in token]) == 5)
    ours = [token.split("/", 5)[5] for token in peer.tokens() if "/ours/%fibonacci%" in token]
    expected = [
        ("SC", *SEND, SERVICE_QOS),
        ("SC", *CANCEL, SERVICE_QOS),
        ("SC", *RESULT, SERVICE_QOS),
        ("MS", *FEEDBACK, FEEDBACK_QOS),
        ("MS", *STATUS, STATUS_QOS),
    ]
    assert sorted(ours) == sorted(f"{k}/%/%/ours/{n.replace('/', '%')}/{d}/{h}/{q}" for k, n, d, h, q in expected)

    seen: list[list[int]] = []
    goal = client.send_goal(Fibonacci.Goal(order=7), feedback=lambda f: seen.append(f.sequence.tolist())).wait()
    assert server.requests == [(SEND[0], CDR + goal.goal_id + struct.pack("<i", 7))]
    assert (goal.accepted, goal.stamp_ns) == (True, STAMP_NS)
    wait_until(lambda: seen == [[0, 1]])
    wait_until(lambda: goal.status is GoalState.EXECUTING)
    pending = goal.result()
    assert goal.cancel().wait()
    status, result = pending.wait()
    assert (status, result.sequence.tolist()) == (GoalState.CANCELED, [0, 1, 1])
    assert (RESULT[0], CDR + goal.goal_id) in server.requests
    assert (CANCEL[0], CDR + goal.goal_id + bytes(8)) in server.requests

    other = client.send_goal(Fibonacci.Goal(order=1), goal_id=GOAL_ID).wait()
    pending = other.result()
    server.finish(GOAL_ID, SUCCEEDED)
    assert pending.wait().status is GoalState.SUCCEEDED
    assert not client.send_goal(Fibonacci.Goal(order=0)).wait().accepted


def test_the_hashes_here_are_those_of_the_real_generator():
    found = {value for name, value in _flat(HASHES)}
    assert {part[2] for part in (SEND, CANCEL, RESULT, FEEDBACK, STATUS)} <= found


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, key)
    elif isinstance(value, str):
        yield name, value
