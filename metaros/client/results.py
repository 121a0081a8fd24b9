"""The clients' results: frozen, typed, with the gateway's whole document where it says more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Command", "Event", "GoalUpdate", "Robot", "Sample", "Series", "Values"]

Document = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot as the gateway knows it; `document` is all that REST says of it."""

    id: str
    online: bool
    namespace: str
    hostname: str
    labels: Mapping[str, str]
    document: Document = field(repr=False)

    @classmethod
    def of(cls, document: Document) -> Robot:
        """From REST's."""
        return cls(
            id=document["id"],
            online=document["state"] == "online",
            namespace=document["namespace"],
            hostname=document["hostname"],
            labels=dict(document["labels"]),
            document=document,
        )


@dataclass(frozen=True, slots=True)
class Sample:
    """One message on one topic. `message` is decoded; None where it cannot be (sealed, not of its type), or was not to
    be. `receive_ns` is the gateway's clock, `stamp_ns` its sender's, by the robot's offset.
    """

    robot: str
    topic: str
    type_name: str
    seq: int
    stamp_ns: int
    receive_ns: int
    cdr: bytes = field(repr=False)
    message: Any = None


@dataclass(frozen=True, slots=True)
class Values:
    """Newest values of a robot's series, by name."""

    robot: str
    stamp_ns: int
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Series:
    """A series over a time: one row a point, buckets where there were more rows than points."""

    name: str
    stamp_ms: tuple[float, ...]
    mean: tuple[float, ...]
    min: tuple[float, ...]
    max: tuple[float, ...]
    count: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Command:
    """A command: issued, delivered, running, or its end: done, failed, expired, cancelled."""

    id: str
    robot: str
    kind: str
    state: str
    result: Any
    code: str
    message: str
    document: Document = field(repr=False)

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.state in ("done", "failed", "expired", "cancelled")

    @classmethod
    def of(cls, document: Document) -> Command:
        """From REST's."""
        names = ("id", "robot", "kind", "state", "result", "code", "message")
        return cls(**{name: document[name] for name in names}, document=document)


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened; `cursor` is where `events(after=…)` goes on, `robot` "" is of no single one."""

    cursor: int
    kind: str
    robot: str
    time_ns: int
    data: Document


@dataclass(frozen=True, slots=True)
class GoalUpdate:
    """How a goal goes: `kind` is status, feedback or result."""

    kind: str
    status: str
    value: Any
    message: str = ""
