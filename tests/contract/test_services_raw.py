"""Services against peers written from the wire sheet alone, in both directions, byte for byte."""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh

import metaros
from metaros.cdr import codec
from metaros.errors import PeerError, TimeoutError_
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.node.service import PendingRequest, Responder
from metaros.wire import qos_services as QOS
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

DDS = "example_interfaces::srv::dds_::AddTwoInts_"
HASH = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
KEY = f"0/add_two_ints/{DDS}/{HASH}"


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


def request(a: int, b: int) -> bytes:
    return CDR + struct.pack("<qq", a, b)


def serve(node: metaros.Node) -> None:
    @node.service(AddTwoInts, "add_two_ints")
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b


def test_a_raw_client_calls_our_service(node, peer):
    serve(node)
    client = peer.client("/add_two_ints", DDS, HASH)
    assert client.key == KEY
    wait_until(lambda: any(f"/SS/%/%/ours/%add_two_ints/{DDS}/{HASH}/::,10:,:,:,," in t for t in peer.tokens()))
    assert client.ask(request(3, 4)) == CDR + struct.pack("<q", 7)
    assert client.ask(request(-(2**62), 1)) == CDR + struct.pack("<q", 1 - 2**62)


def test_our_service_answers_old_and_wrong_attachments_as_rmw_does(node, peer):
    serve(node)
    wait_until(lambda: any("/SS/" in token and "%add_two_ints" in token for token in peer.tokens()))
    for attachment in (None, b"", bytes(32), pack_attachment(-1, STAMP_NS, bytes(16))):
        (reply,) = peer.session.get(KEY, payload=request(1, 2), attachment=attachment)
        assert reply.ok is None
    (reply,) = peer.session.get(KEY, attachment=pack_attachment(1, STAMP_NS, bytes(16)))
    assert reply.ok is None
    gid = bytes(range(16))
    old = (
        b"\x0fsequence_number"
        + struct.pack("<q", 5)
        + b"\x10source_timestamp"
        + struct.pack("<q", STAMP_NS)
        + b"\x0asource_gid\x10"
        + gid
    )
    (reply,) = peer.session.get(KEY, payload=request(1, 2), attachment=old)
    assert reply.ok is not None
    assert reply.ok.payload.to_bytes() == CDR + struct.pack("<q", 3)
    assert reply.ok.attachment is not None
    assert unpack_attachment(reply.ok.attachment.to_bytes())[::2] == (5, gid)


def test_the_same_request_twice_at_a_time_is_refused_the_second_time(node, peer):
    held: list[PendingRequest] = []
    coders = {"request": codec(AddTwoInts.Request), "response": codec(AddTwoInts.Response)}
    Responder(node, AddTwoInts, "add_two_ints", lambda request, waiting: held.append(waiting), qos=QOS, **coders)
    wait_until(lambda: any("/SS/" in token and "%add_two_ints" in token for token in peer.tokens()))
    attachment = pack_attachment(1, STAMP_NS, bytes(range(16)))
    first: SimpleQueue[zenoh.Reply] = SimpleQueue()
    peer.session.get(KEY, first.put, payload=request(1, 2), attachment=attachment)
    wait_until(lambda: held)
    (second,) = peer.session.get(KEY, payload=request(1, 2), attachment=attachment)
    assert second.err is not None
    assert b"served already" in second.err.payload.to_bytes()
    held[0].answer(AddTwoInts.Response(sum=3))
    assert first.get(timeout=60).ok is not None


def test_our_client_calls_a_raw_service(node, peer):
    seen: list[tuple[str, bytes, bytes, str]] = []

    def answer(query: zenoh.Query) -> None:
        assert query.payload is not None
        assert query.attachment is not None
        data, attachment = query.payload.to_bytes(), query.attachment.to_bytes()
        seen.append((str(query.key_expr), data, attachment, str(query.selector.parameters)))
        seq, _, gid = unpack_attachment(attachment)
        a, b = struct.unpack("<qq", data[4:])
        with query:
            query.reply(
                str(query.key_expr), CDR + struct.pack("<q", a + b), attachment=pack_attachment(seq, STAMP_NS, gid)
            )

    peer.serve("/add_two_ints", DDS, HASH, answer)
    client = node.create_client(AddTwoInts, "add_two_ints")
    assert client.wait_for_service(60)
    assert [client.call(AddTwoInts.Request(a=n, b=40), timeout_s=60).sum for n in (1, 2, 3)] == [41, 42, 43]
    assert [key for key, *_ in seen] == [KEY] * 3
    assert [data for _, data, *_ in seen] == [request(n, 40) for n in (1, 2, 3)]
    (token,) = [t for t in peer.tokens() if "/SC/" in t and "%add_two_ints" in t]
    assert token.endswith(f"/SC/%/%/ours/%add_two_ints/{DDS}/{HASH}/::,10:,:,:,,")
    sent = [unpack_attachment(attachment) for _, _, attachment, _ in seen]
    assert [seq for seq, _, _ in sent] == [1, 2, 3]
    assert {gid for _, _, gid in sent} == {gid_of(token)}
    assert all(stamp_ns > STAMP_NS for _, stamp_ns, _ in sent)


def test_our_client_takes_only_the_answer_to_its_own_request(node, peer):
    """Replies without an attachment, or with another's sequence number or GID, are no answers."""
    spoil: list[Any] = [
        lambda seq, gid: None,
        lambda seq, gid: pack_attachment(seq + 1, STAMP_NS, gid),
        lambda seq, gid: pack_attachment(seq, STAMP_NS, bytes(16)),
        lambda seq, gid: bytes(33),
    ]

    def answer(query: zenoh.Query) -> None:
        assert query.attachment is not None
        seq, _, gid = unpack_attachment(query.attachment.to_bytes())
        with query:
            query.reply(str(query.key_expr), CDR + bytes(8), attachment=spoil[0](seq, gid))

    peer.serve("/add_two_ints", DDS, HASH, answer)
    client = node.create_client(AddTwoInts, "add_two_ints")
    assert client.wait_for_service(60)
    while spoil:
        with pytest.raises(PeerError):
            client.call(AddTwoInts.Request(), timeout_s=60)
        spoil.pop(0)


def test_errors_and_silence_of_a_raw_service(node, peer):
    kept: list[zenoh.Query] = []

    def answer(query: zenoh.Query) -> None:
        assert query.payload is not None
        if query.payload.to_bytes() == request(0, 0):
            kept.append(query)
            return
        with query:
            query.reply_err(b"out of order")

    peer.serve("/add_two_ints", DDS, HASH, answer)
    client = node.create_client(AddTwoInts, "add_two_ints")
    assert client.wait_for_service(60)
    with pytest.raises(PeerError, match="out of order"):
        client.call(AddTwoInts.Request(a=1), timeout_s=60)
    with pytest.raises(TimeoutError_):
        client.call(AddTwoInts.Request(), timeout_s=0.1)
    (late,) = kept
    assert late.attachment is not None
    late.reply(KEY, CDR + bytes(8), attachment=late.attachment.to_bytes())  # nobody minds
    late.drop()
    with pytest.raises(PeerError, match="out of order"):
        client.call(AddTwoInts.Request(a=1), timeout_s=60)
