"""A robot's link as `Links` keeps it, and one of its lanes as `serve_lane` holds it."""

from __future__ import annotations

from dataclasses import dataclass, field

from gateway.domain.identity import Admitted
from gateway.ingest.outbox import LaneOutbox
from gateway.ingest.registry import RobotRecord
from gateway.ingest.session import Session

__all__ = ["Lane", "LiveLink"]


@dataclass(slots=True)
class LiveLink:
    """A robot's session and its lanes' outboxes."""

    session: Session
    record: RobotRecord
    outboxes: dict[int, LaneOutbox] = field(default_factory=dict)
    admitted: set[Admitted] = field(default_factory=set)
    closed: bool = False
    seen_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Lane:
    """One open connection of a session, as `serve_lane` holds it."""

    robot_id: str
    number: int
    outbox: LaneOutbox
    live: LiveLink
