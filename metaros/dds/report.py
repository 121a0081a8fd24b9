"""What a DDS bridge carries: a row for each topic or service and direction."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["DdsReport", "Direction", "RouteRow"]


class Direction(StrEnum):
    """Which way samples go; of a service, on which side its server is."""

    TO_ROS = "DDS → ROS"
    TO_DDS = "ROS → DDS"
    SERVED_BY_DDS = "served on DDS"
    SERVED_BY_ROS = "served on ROS"


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteRow:
    """One topic in one direction, or one service. `bridged` samples or answered calls went on to the other side,
    `dropped` waited and were pushed out by newer ones, or their caller waited in vain; `failed` could not be carried.
    """

    name: str
    direction: Direction
    type: str
    bridged: int
    bytes: int
    dropped: int
    failed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DdsReport:
    """Everything at one moment. `problems` says what is not bridged, and why."""

    rows: tuple[RouteRow, ...] = ()
    participants: int = 0
    problems: tuple[str, ...] = ()
