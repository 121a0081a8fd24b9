"""A service or an action that a client of the gateway serves in a robot's ROS graph, and what it is asked."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Literal

from gateway.fleet.ros.typed import decode, encode
from metaros._proto import link_pb2
from metaros.idl import Catalogue

__all__ = ["JSON", "Answer", "Dialect", "Execute", "Offer", "OfferedGoal"]

Answer = Callable[[Any], Awaitable[tuple[bool, Any]]]  # the request; whether it went well, and the response or why not
GoalEnd = Literal["succeeded", "canceled", "aborted"]


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a client's values become CDR and back, by the name of the type's part."""

    encode: Callable[[str, Any, Catalogue], bytes]
    decode: Callable[[str, bytes, Catalogue], Any]


JSON = Dialect(encode, decode)


class OfferedGoal:
    """A goal that somebody on the robot sent to an offered action; its client here works on it."""

    def __init__(self, goal_id: bytes, goal: Any, feedback: Callable[[Any], None]) -> None:
        self.goal_id = goal_id
        self.goal = goal  # JSON-able values
        self._feedback = feedback
        self._cancel = asyncio.Event()

    @property
    def id(self) -> str:
        """32 hexadecimal digits."""
        return self.goal_id.hex()

    @property
    def cancel_requested(self) -> bool:
        """Whether it is to stop."""
        return self._cancel.is_set()

    def feedback(self, values: Any) -> None:
        """Tell how far it is; FieldError when that does not fit the type."""
        self._feedback(values)

    async def cancelled(self) -> None:
        """Until it is to stop."""
        await self._cancel.wait()

    def cancel(self) -> None:
        """It is to stop."""
        self._cancel.set()


Execute = Callable[[OfferedGoal], Awaitable[tuple[GoalEnd, Any]]]


@dataclass(slots=True, eq=False)
class Offer:
    """One offer; `close` takes it back."""

    robot: str
    number: int
    name: str
    type_name: str
    type_hash: str
    catalogue: Catalogue = field(repr=False)
    answer: Answer | None = field(repr=False)
    execute: Execute | None = field(repr=False)
    withdraw: Callable[[Offer], None] = field(repr=False)
    dialect: Dialect = field(default=JSON, repr=False)
    text: link_pb2.TypeText | None = field(default=None, repr=False)
    stands: asyncio.Future[link_pb2.OfferState] | None = field(default=None, repr=False)

    def close(self) -> None:
        """Nobody is served any more. Nothing happens the second time."""
        self.withdraw(self)

    def frame(self) -> link_pb2.Offer:
        """As the robot is told."""
        message = link_pb2.Offer(
            number=self.number,
            action=self.execute is not None,
            name=self.name,
            type_name=self.type_name,
            type_hash=self.type_hash,
        )
        if self.text is not None:
            message.type.CopyFrom(self.text)
        return message
