"""`Idempotency-Key`: the same request is carried out once, on a robot, or at the gateway where it makes something.

Routes that are answered with what the robot did have `carried_once`, those that make something give `once_of` to it.
Under a key the request is a command that is kept, so its end is the answer for ever, a failure's too, and another
request under the same key is refused. Without a key these routes work as ever, and do not wait for the store.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starlette.requests import Request

from gateway.api.authorization import principal_of
from gateway.api.middleware.audited import note
from gateway.api.services import services_of
from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.fleet.command import DONE, Command
from gateway.domain.idempotency import IdempotentRequest
from gateway.errors import CommandRefusedError, CommandTimeoutError
from gateway.fleet.command_dispatcher import TRAVEL_S
from gateway.fleet.command_manager import NewCommand
from gateway.fleet.ros.goal import Goal
from gateway.store.engine import StoreEngine
from gateway.store.fleet.idempotency import made_before, remember_made

__all__ = ["OnceGoal", "carried_once", "key_of", "once_of"]


def key_of(request: Request) -> str | None:
    """The request's key; None where it has none."""
    return request.headers.get("idempotency-key")


def once_of(request: Request, asked: Mapping[str, Any]) -> IdempotentRequest | None:
    """For what makes something; None without a key. `asked`: the request without its secrets. InvalidRequestError."""
    key = key_of(request)
    return IdempotentRequest.of(principal_of(request), key, asked) if key is not None else None


class OnceGoal:
    """The goal that a request under a key began; a request without a key has none, and begins another each time."""

    def __init__(self, request: Request, robot_id: str, asked: Mapping[str, Any]) -> None:
        """InvalidRequestError for what is no key."""
        self._services, self._robot = services_of(request), robot_id
        self._once = once_of(request, {"robot": robot_id, **asked})

    async def find(self) -> Goal | None:
        """The goal that the same request began. IdempotencyConflictError, UnknownGoalError when it is gone."""

        def job(engine: StoreEngine) -> str:
            with engine.transaction(write=False):
                return made_before(engine, self._once)

        begun = await self._services.store.read(job) if self._once else ""
        return self.settled(self._services.goals.find(self._robot, begun)) if begun else None

    async def claim(self, goal_id: str) -> str:
        """Keep the goal's id under the key, before the goal leaves; the id of the one that was faster."""
        once, now_ns = self._once, self._services.clock.wall_ns()

        def job(engine: StoreEngine) -> str:
            if begun := made_before(engine, once):
                return begun
            remember_made(engine, once, goal_id, now_ns=now_ns)
            return goal_id

        return await self._services.store.run(job) if once is not None else goal_id

    @staticmethod
    def settled(goal: Goal) -> Goal:
        """The goal; IdempotencyConflictError while nobody knows whether its server takes it."""
        if not goal.accepted and not goal.ended:
            raise IdempotencyConflictError("a request under this Idempotency-Key is under way: send it again")
        return goal


async def carried_once(request: Request, order: NewCommand) -> Command:
    """The order's good end, whether it came to it now or when it was sent before.

    Raises:
        CommandRefusedError: it failed; the code is the one that it failed with.
        CommandTimeoutError: it is under way still: the same request may be sent again.
        MetarosError: see CommandManager.send.
    """
    orders = services_of(request).command_manager
    command = await orders.send(order, principal_of(request))
    note(request, detail=f"{command.id} {command.kind} {command.state}")
    if not command.over:  # somebody else sent it a moment ago
        command = await orders.wait(command.id, order.timeout_s + TRAVEL_S)
    if not command.over:
        raise CommandTimeoutError(f"command {command.id} is under way")
    if command.state != DONE:
        raise CommandRefusedError(command.message or f"it ended as {command.state}", agent_code=command.code)
    return command
