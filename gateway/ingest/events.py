"""Events that a session returns: frames to send, and what was received."""

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
    "RecordingArrived",
    "Reported",
    "Resulted",
    "RosReceived",
    "RowsArrived",
    "Send",
    "WriterKnown",
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
    """New samples of one channel; `durable` ones are acknowledged once they are stored.

    `fresh` ones are of now, the others of a time without a link.
    """

    run: Run
    epoch: int
    seq: int
    durable: bool
    duplicates: int
    fresh: bool = True


@dataclass(frozen=True, slots=True)
class RowsArrived:
    """New metric rows; `fresh` ones are of now."""

    rows: Rows
    stream_id: int
    epoch: int
    seq: int
    duplicates: int
    fresh: bool = True


@dataclass(frozen=True, slots=True)
class GapDeclared:
    """Samples that will never come; the watermark moves over them."""

    stream_id: int
    epoch: int
    gap: Gap


@dataclass(frozen=True, slots=True)
class WriterKnown:
    """This process of the agent now writes under these epochs."""

    writers: dict[int, str]


@dataclass(frozen=True, slots=True)
class Reported:
    """The agent's statistics."""

    statistics: link_pb2.TopicStatistics


@dataclass(frozen=True, slots=True)
class RecordingArrived:
    """An offer of a recording, or a piece of one."""

    part: link_pb2.RecordingPart


@dataclass(frozen=True, slots=True)
class TwinReported:
    """What the robot is, and how far it is with what it is to be."""

    report: link_pb2.TwinReport


@dataclass(frozen=True, slots=True)
class LeasesAnswered:
    """The robot sent a moment of its clock, from which leases may count."""

    boot_ns: int


@dataclass(frozen=True, slots=True)
class RosReceived:
    """A frame about the robot's ROS graph: the graph itself, goals of actions, what is offered in it."""

    frame: link_pb2.AgentFrame


@dataclass(frozen=True, slots=True)
class Resulted:
    """A command's result."""

    result: link_pb2.CommandResult


@dataclass(frozen=True, slots=True)
class OverQuota:
    """The robot sends more than it may: live samples were dropped, or a lane was told to send durable frames later."""

    dropped: int = 0
    put_off: bool = False


@dataclass(frozen=True, slots=True)
class Measured:
    """A round trip over the link."""

    rtt_s: float


@dataclass(frozen=True, slots=True)
class Closed:
    """The session is over; every lane has to end. `code` is "" when the agent left by itself."""

    code: str
    message: str = ""


Event = (
    Send
    | Online
    | Announced
    | Arrived
    | RowsArrived
    | GapDeclared
    | WriterKnown
    | RecordingArrived
    | Reported
    | Resulted
    | RosReceived
    | TwinReported
    | LeasesAnswered
    | OverQuota
    | Measured
    | Closed
)
