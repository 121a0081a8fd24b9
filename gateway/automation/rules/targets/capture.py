"""Saves what a robot's black box has of the last seconds."""

from __future__ import annotations

from typing import Protocol

from gateway.domain.delivery import Dead, Delivery, Done, Result, Retry
from gateway.domain.recording import Recording
from gateway.errors import StoreError, TooManyError
from gateway.rules.targets.calls import Calls, Given, OutOfScopeError, scoped_robot
from metaros.errors import MetarosError

__all__ = ["CaptureTarget", "Recordings"]


class Recordings(Protocol):
    """What is needed of the desk of recordings."""

    async def request(self, robot_id: str, *, last_s: float | None = None, topics: tuple[str, ...] = ()) -> Recording:
        """Ask for the robot's last seconds; the robot need not be online."""


class CaptureTarget:
    """A handler of the queue. A gateway that ends in the middle may ask a second time: a second recording is the worst
    that comes of it.
    """

    def __init__(self, recordings: Recordings) -> None:
        self._calls = Calls()
        self.room, self.timeout_s, self.ended = self._calls.room, self._calls.timeout_s, self._calls.ended
        self._recordings = recordings

    async def deliver(self, delivery: Delivery) -> Result:
        """Ask for it: the desk of recordings sees to the rest."""
        given = Given(delivery)
        try:
            with self._calls.counted():
                asked = await self._recordings.request(
                    scoped_robot(given),
                    last_s=float(given.fields["last_s"]),
                    topics=tuple(given.fields.get("topics", ())),
                )
        except OutOfScopeError as error:
            return Dead("out_of_scope", str(error))
        except (StoreError, TooManyError) as error:
            return Retry(error.code, str(error), counts=False)
        except MetarosError as error:
            return Dead(error.code, str(error))
        return Done(asked.id)
