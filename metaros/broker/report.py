"""The broker's report: a row for each topic and direction."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["BrokerReport", "Direction", "TopicRow"]


class Direction(StrEnum):
    """Which way a topic's messages go."""

    TO_ROS = "ZeroMQ → ROS"
    TO_ZMQ = "ROS → ZeroMQ"


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicRow:
    """One topic in one direction, counted since the beginning.

    `messages` came to the broker, `bridged` went on to the other side. `dropped` waited and were pushed out by newer
    ones, `malformed` could not be converted; the others found nobody who listens.
    """

    topic: str
    direction: Direction
    type: str
    messages: int
    bytes: int
    bridged: int
    dropped: int
    malformed: int
    heard: bool  # whether anybody listens on the other side now


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokerReport:
    """Everything at one moment.

    `hub_frames` came from ZeroMQ publishers (a message has one or two), `hub_missed` of them too fast for the bridge to
    see. `unreadable` counts messages without a topic that ROS allows, or of more topics than the limit.
    """

    rows: tuple[TopicRow, ...] = ()
    hub_frames: int = 0
    hub_bytes: int = 0
    hub_missed: int = 0
    unreadable: int = 0
    subscriptions: tuple[str, ...] = ()
