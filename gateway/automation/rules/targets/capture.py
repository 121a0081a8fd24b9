"""Saves what a robot's black box has of the last seconds."""

from __future__ import annotations

from typing import Protocol

from gateway.automation.rules.targets.calls import Calls, OutOfScopeError, RuleContext, scoped_robot
from gateway.domain.automation.delivery import Dead, Delivery, Done, Result, Retry
from gateway.domain.fleet.recording import Recording
from gateway.errors import StoreError, TooManyError
from metaros.errors import MetarosError

__all__ = ["CaptureTarget", "Recordings"]


class Recordings(Protocol):
    """What is needed of the recording manager."""

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
        """Ask for it: the recording manager sees to the rest."""
        rule_context = RuleContext(delivery)
        try:
            with self._calls.counted():
                asked = await self._recordings.request(
                    scoped_robot(rule_context),
                    last_s=float(rule_context.fields["last_s"]),
                    topics=tuple(rule_context.fields.get("topics", ())),
                )
        except OutOfScopeError as error:
            return Dead("out_of_scope", str(error))
        except (StoreError, TooManyError) as error:
            return Retry(error.code, str(error), counts=False)
        except MetarosError as error:
            return Dead(error.code, str(error))
        return Done(asked.id)
