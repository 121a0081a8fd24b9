"""What a session tells its shell: frames to send, and things that happened."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.channel import Channel, Series
from gateway.domain.sample import Gap, Rows, Run
from metaros._proto import link_pb2

__all__ = [
    "Announced",
    "Arrived",
    "Closed",
    "Event",
    "GapDeclared",
    "Measured",
    "Online",
    "Reported",
    "Resulted",
    "RowsArrived",
    "Send",
]


@dataclass(frozen=True, slots=True)
class Send:
    """Put a frame on a lane."""

    lane: int
    frame: link_pb2.GatewayFrame


@dataclass(frozen=True, slots=True)
class Online:
    """Control and data lane are both open."""


@dataclass(frozen=True, slots=True)
class Announced:
    """Channels and series were declared or changed."""

    channels: tuple[Channel, ...]
    series: tuple[Series, ...]


@dataclass(frozen=True, slots=True)
class Arrived:
    """New samples of one channel; `durable` ones are acknowledged once their watermark is stored."""

    run: Run
    epoch: int
    seq: int
    durable: bool
    duplicates: int


@dataclass(frozen=True, slots=True)
class RowsArrived:
    """New metric rows."""

    rows: Rows
    epoch: int
    seq: int
    duplicates: int


@dataclass(frozen=True, slots=True)
class GapDeclared:
    """Samples that will never come; the watermark moves over them."""

    stream_id: int
    epoch: int
    gap: Gap


@dataclass(frozen=True, slots=True)
class Reported:
    """The agent's statistics."""

    statistics: link_pb2.TopicStatistics


@dataclass(frozen=True, slots=True)
class Resulted:
    """A command's result."""

    result: link_pb2.CommandResult


@dataclass(frozen=True, slots=True)
class Measured:
    """A round trip over the link."""

    rtt_s: float


@dataclass(frozen=True, slots=True)
class Closed:
    """The session is over; every lane has to end. `code` is "" when the agent left by itself."""

    code: str
    message: str = ""


Event = Send | Online | Announced | Arrived | RowsArrived | GapDeclared | Reported | Resulted | Measured | Closed
