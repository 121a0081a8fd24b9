"""Samples are framed once for all who have them under the same number."""

from __future__ import annotations

import struct

from gateway.api.foxglove.encoding import MessageData
from gateway.api.ws.writer import BINARY, split_frames
from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.encoding import Block


def test_a_block_is_one_message_a_sample_and_made_once() -> None:
    channel = Channel(robot="r", channel_id=1, topic="/t", schema_name="a/msg/B", type_hash="")
    payloads = [b"one", bytes(200), bytes(70_000)]
    block = Block(channel, [Record(seq, 100 + seq, 0, payload) for seq, payload in enumerate(payloads)])
    data = block.encoded(MessageData(7))
    assert block.encoded(MessageData(7)) is data
    assert block.encoded(MessageData(8)) is not data
    frames = list(split_frames(data))
    assert [opcode for opcode, _ in frames] == [BINARY] * 3
    assert [message[:13] for _, message in frames] == [struct.pack("<BIQ", 1, 7, 100 + seq) for seq in range(3)]
    assert [message[13:] for _, message in frames] == payloads
