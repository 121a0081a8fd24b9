"""Speech on its way to a robot keeps its order, and never ends a link that is slow."""

from __future__ import annotations

from gateway.ingest.outbox import TALK_WAITING, LaneOutbox
from metaros._proto import link_pb2


def talk(seq: int) -> link_pb2.GatewayFrame:
    return link_pb2.GatewayFrame(talk=link_pb2.Teleop(seq=seq, payload=bytes(100)))


async def test_speech_keeps_its_order_and_late_speech_is_dropped() -> None:
    outbox = LaneOutbox(max_bytes=1_000_000)
    assert all(outbox.put(talk(seq)) for seq in range(3 * TALK_WAITING))
    assert outbox.put(link_pb2.GatewayFrame(teleop=link_pb2.Teleop(seq=7)))
    first = await outbox.next()
    assert first is not None
    assert first.teleop.seq == 7  # who drives goes before who talks
    seqs = [frame.talk.seq for _ in range(TALK_WAITING) if (frame := await outbox.next()) is not None]
    assert seqs == list(range(TALK_WAITING))
    assert outbox.put(talk(99))
    last = await outbox.next()
    assert last is not None
    assert last.talk.seq == 99


async def test_speech_that_finds_no_room_is_no_reason_to_hang_up() -> None:
    outbox = LaneOutbox(max_bytes=150)
    assert outbox.put(talk(1))
    assert outbox.put(talk(2))
    assert not outbox.put(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=bytes(100))))
