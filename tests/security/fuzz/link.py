"""Targets of the link: frames as each side reads them, and what either half of a session makes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import zstandard
from cryptography.hazmat.primitives.asymmetric import ec
from google.protobuf.message import DecodeError, Message

from edge_agent.errors import LinkError as AgentLinkError
from edge_agent.uplink.lane import LANES
from gateway.errors import LinkError, ProtocolError
from gateway.ingest.quota import Meter, Quota
from gateway.ingest.session import Session
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.errors import FrameError
from metaros.limits import LIMITS, Limits
from metaros.link import (
    ClockOffset,
    Reassembler,
    decompress,
    pack_batch,
    pack_metrics,
    split_sample,
    unpack_batch,
    unpack_metrics,
)
from metaros.link.proof import verify
from tests.edge_agent.session_rig import SessionRig
from tests.security.fuzz.target import MIB, Target

__all__ = ["TARGETS"]

SMALL = Limits(chunk_bytes=64, batch_bytes=256, sample_bytes=1024)
EPOCH = 77


def frames(data: bytes, kind: type[Any]) -> Iterator[tuple[int, Any]]:
    """(lane, frame) of each length-delimited frame; bytes that are none raise protobuf's DecodeError."""
    place = 0
    while place + 3 <= len(data):
        lane, size = data[place] % 3, int.from_bytes(data[place + 1 : place + 3], "little")
        yield LANES[lane], kind.FromString(data[place + 3 : place + 3 + size])
        place += 3 + size


def packed(*items: tuple[int, Message]) -> bytes:
    """Frames as `frames` reads them."""
    out = b""
    for lane, frame in items:
        body = frame.SerializeToString()
        out += bytes([lane]) + len(body).to_bytes(2, "little") + body
    return out


def hello(lane: int) -> link_pb2.Hello:
    """A robot's first frame of a lane, with something in every field."""
    return link_pb2.Hello(
        protocol=1,
        robot_id="r1",
        session_id=bytes(16),
        session_number=3,
        lane=lane,
        agent_version="2",
        namespace="/r1",
        hostname="h",
        labels={"site": "x"},
        streams=[link_pb2.StreamState(stream_id=1, epoch=EPOCH, base_seq=0, last_seq=9)],
        writers=["a"],
        epochs=[EPOCH],
    )


def opened() -> Session:
    """A gateway's half with its lanes open and two channels announced."""
    limits = Limits(dead_after_s=15.0)
    meter = Meter(Quota(messages_per_s=1000, bytes_per_s=1_000_000), limits=limits)
    session = Session(hello(LANES[0]), StreamTable(), gateway_id="g", store_id="s", limits=limits, meter=meter)
    for lane in LANES:
        session.open_lane(hello(lane), now_s=1.0, wall_ns=10**18)
    session.receive(LANES[1], link_pb2.AgentFrame(announce=announce()), now_s=1.0, wall_ns=10**18)
    return session


def announce() -> link_pb2.Announce:
    """A bulk channel, a live one and two series."""
    channels = [
        link_pb2.Channel(
            channel_id=number, topic=f"/r1/t{number}", schema_name="std_msgs/msg/String", schema=b"string data\n"
        )
        for number in (1, 2)
    ]
    for channel, delivery in zip(channels, (3, 4), strict=True):
        setattr(channel, "class", delivery)
    return link_pb2.Announce(channels=channels, series=[link_pb2.Series(series_id=n, name=f"t{n}.x") for n in (1, 2)])


def agent_frames() -> bytes:
    """Everything that an agent sends."""
    whole = pack_batch(1, EPOCH, 10, [1, 2], [b"one", b"two"])
    pieces = list(split_sample(2, EPOCH, 1, 5, b"x" * 300, limits=SMALL))
    kinds: tuple[tuple[int, dict[str, Any]], ...] = (
        (1, {"announce": announce()}),
        (1, {"batches": link_pb2.Batches(batches=[whole, squeezed()])}),
        (1, {"batches": link_pb2.Batches(batches=pieces)}),
        (1, {"metrics": pack_metrics(EPOCH, 1, [1, 2], [5, 6], [0.5, 1.5])}),
        (2, {"gap": link_pb2.Gap(stream_id=1, epoch=EPOCH, from_seq=12, to_seq=20, reason="quota")}),
        (0, {"heartbeat": link_pb2.Heartbeat(sent_ns=5, echo_ns=10**18, held_ns=3)}),
        (0, {"result": link_pb2.CommandResult(command_id=b"1" * 16, ok=True, payload=b"x")}),
        (0, {"statistics": link_pb2.TopicStatistics()}),
        (1, {"resumed": link_pb2.Resumed(token=1)}),
        (2, {"recording": link_pb2.RecordingPart(recording_id="0" * 26, offset=5, data=b"abc", sha256=bytes(32))}),
        (0, {"proof": link_pb2.Proof(signature=b"s" * 70)}),
    )
    return packed(*((lane, link_pb2.AgentFrame(**fields)) for lane, fields in kinds))


def squeezed() -> link_pb2.Batch:
    """A batch whose payload is compressed."""
    batch = pack_batch(1, EPOCH, 12, [3], [bytes(range(64)) * 4])
    batch.payload, batch.compression = zstandard.compress(batch.payload), link_pb2.COMPRESSION_ZSTD
    return batch


def gateway_half(data: bytes) -> None:
    """Whatever comes after the Hellos is an event, or ends the session; nothing is raised."""
    session = opened()
    for lane, frame in frames(data, link_pb2.AgentFrame):
        events = session.receive(lane, frame, now_s=2.0, wall_ns=10**18)
        for event in events:  # what the shell would write
            sent = getattr(event, "frame", None)
            assert sent is None or len(sent.SerializeToString()) < LIMITS.frame_bytes
    session.tick(now_s=3.0, wall_ns=10**18)


def first_frame(data: bytes) -> None:
    """A Hello opens a session and its lanes, or is refused."""
    said = link_pb2.Hello.FromString(data)
    session = Session(said, StreamTable(), gateway_id="g", store_id="s")
    for event in session.open_lane(said, now_s=1.0, wall_ns=10**18):
        sent = getattr(event, "frame", None)
        assert sent is None or len(sent.SerializeToString()) < LIMITS.frame_bytes


def agent_half(data: bytes) -> None:
    """What a gateway sends reaches an agent's session, welcomed before or not; then the agent goes on."""
    rig = SessionRig()
    if data[:1] < b"\x80":
        rig.connect()
        rig.put("/bulk/a", b"sample", "bulk")
        rig.send()
    for lane, frame in frames(data, link_pb2.GatewayFrame):
        rig.session.receive(lane, frame)
        if rig.session.established:
            rig.session.next_frame(lane)
            rig.session.wait_s(lane)
    rig.session.check()


def gateway_frames() -> bytes:
    """Everything that a gateway sends."""
    epoch = SessionRig().epoch
    kinds: tuple[tuple[int, dict[str, Any]], ...] = (
        (1, {"ack": link_pb2.Ack(watermarks=[link_pb2.Watermark(stream_id=2, epoch=epoch, seq=1)])}),
        (0, {"heartbeat": link_pb2.Heartbeat(sent_ns=10**18, echo_ns=5, held_ns=3)}),
        (0, {"demand": link_pb2.Demand(entries=[link_pb2.DemandEntry(channel_id=4, max_rate_hz=5.0)])}),
        (
            0,
            {
                "command": link_pb2.Command(
                    command_id=b"1" * 16, publish=link_pb2.PublishMessage(topic="/a", payload=b"x")
                )
            },
        ),
        (0, {"teleop": link_pb2.Teleop(lease_id="l", seq=1, sent_ns=10**18)}),
        (2, {"recording_wanted": link_pb2.RecordingWanted(recording_id="0" * 26, offset=3)}),
        (1, {"retry_later": link_pb2.RetryLater(token=1, retry_after_ms=50, reason="full")}),
    )
    return packed(*((lane, link_pb2.GatewayFrame(**fields)) for lane, fields in kinds))


def welcomes() -> bytes:
    """How a session begins."""
    welcome = link_pb2.Welcome(
        gateway_id="g",
        store_id="s",
        watermarks=[link_pb2.Watermark(stream_id=2, epoch=5, seq=1)],
        window_bytes=1 << 20,
        window_batches=16,
        heartbeat_s=5.0,
        stored_writers=[link_pb2.EpochWriter(epoch=5, writer="w")],
    )
    return b"\x81" + packed(*((lane, link_pb2.GatewayFrame(welcome=welcome)) for lane in range(3)))[1:]


def batch(data: bytes) -> None:
    """One batch, expanded and taken apart."""
    columns = unpack_batch(decompress(link_pb2.Batch.FromString(data)))
    assert sum(len(payload) for _, _, payload in columns.samples()) == len(columns.payload)
    columns.after(columns.count // 2)


def metrics(data: bytes) -> None:
    """One batch of metric rows."""
    columns = unpack_metrics(link_pb2.MetricBatch.FromString(data))
    assert len(columns.series_ids) == len(columns.stamps_ns) == columns.count


def chunked(data: bytes) -> None:
    """Pieces of samples, of which memory holds no more than was announced."""
    pieces = Reassembler(limits=SMALL, max_bytes=4096)
    for _, frame in frames(data, link_pb2.Batch):
        pieces.feed(frame)
        assert pieces.pending_bytes <= 4096


def beats(data: bytes) -> None:
    """Any heartbeats: the peer's clock is at most wrong."""
    offset = ClockOffset(ManualClock())
    for sent, echo, held in np.frombuffer(data[: len(data) // 24 * 24], "<i8").reshape(-1, 3).tolist():
        beat = offset.beat()
        offset.received(sent, echo if echo % 2 else beat.sent_ns, held)
        link_pb2.Heartbeat(sent_ns=beat.sent_ns, echo_ns=beat.echo_ns, held_ns=beat.held_ns)
    offset.age_s(0)


KEY = ec.derive_private_key(5, ec.SECP256R1()).public_key()
LINK_ERRORS = (DecodeError,)
AGENT_ERRORS = (DecodeError, FrameError, AgentLinkError)


def frame_target(
    name: str, run: Callable[[bytes], Any], errors: tuple[type[Exception], ...], *seeds: bytes, cost: int = 1
) -> Target:
    """A target of the link."""
    return Target(name=name, run=run, errors=errors, seeds=seeds, base_bytes=8 * MIB, cost=cost)


TARGETS = (
    frame_target("agent frames", gateway_half, LINK_ERRORS, agent_frames(), cost=4),
    frame_target(
        "hello",
        first_frame,
        (DecodeError, ProtocolError, LinkError),
        *(hello(lane).SerializeToString() for lane in LANES),
    ),
    frame_target("gateway frames", agent_half, AGENT_ERRORS, gateway_frames(), welcomes(), cost=16),
    frame_target(
        "batch",
        batch,
        (DecodeError, FrameError),
        pack_batch(1, EPOCH, 10, [1, 2], [b"one", b"two"]).SerializeToString(),
        squeezed().SerializeToString(),
    ),
    frame_target(
        "metric batch", metrics, (DecodeError, FrameError), pack_metrics(1, 1, [1], [2], [3.0]).SerializeToString()
    ),
    frame_target(
        "pieces",
        chunked,
        (DecodeError, FrameError),
        packed(*((0, piece) for piece in split_sample(2, EPOCH, 1, 5, b"x" * 300, limits=SMALL))),
    ),
    frame_target("heartbeats", beats, (), np.arange(24, dtype="<i8").tobytes(), b"\xff" * 48),
    frame_target("signature", lambda data: verify(KEY, b"text", data), (), bytes.fromhex("3006020101020101")),
)
