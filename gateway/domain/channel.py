"""A channel: topic + encoding + schema, as its robot announced it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BULK", "CLASSES", "EVENT", "LIVE", "METRIC", "METRIC_STREAM", "Channel", "Series"]

# The four delivery classes, by their number on the link.
CLASSES: dict[int, str] = {1: "event", 2: "metric", 3: "bulk", 4: "live"}
BULK = "bulk"
EVENT = "event"
LIVE = "live"
METRIC = "metric"
METRIC_STREAM = 0  # the stream id of a robot's metric rows; every other stream id is a channel's


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One announced topic. `delivery` is one of `CLASSES`; `max_rate_hz` 0 means no limit.

    A `history` channel carries copies of a live topic's samples for the store alone: nobody watches it, and no list
    of topics has it. Its live channel says at which rate it takes them, `history_rate_hz`.
    """

    robot: str
    channel_id: int
    topic: str
    schema_name: str
    type_hash: str
    encoding: str = "cdr"
    schema_encoding: str = ""
    schema: bytes = b""
    qos: str = ""
    delivery: str = LIVE
    max_rate_hz: float = 0.0
    forward: bool = True
    history: bool = False
    history_rate_hz: float = 0.0

    @property
    def identity(self) -> tuple[str, str, str, str, str, bytes]:
        """What makes two announcements the same channel to a viewer, whatever number an agent gave it."""
        return (self.robot, self.topic, self.encoding, self.schema_name, self.type_hash, self.schema)


@dataclass(frozen=True, slots=True)
class Series:
    """One numeric field of one topic, kept as a series under `name`."""

    name: str
    topic: str
    field: str
