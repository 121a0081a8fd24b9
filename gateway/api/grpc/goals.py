"""Goals of a robot's actions as replies: how a goal stands, its feedback, its result."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from contextlib import aclosing

from gateway.api.grpc.fields import text_of
from gateway.fleet.ros.goal import Goal
from metaros._proto import telemetry_pb2

__all__ = ["goal_replies"]


async def goal_replies(goal: Goal) -> AsyncGenerator[telemetry_pb2.GoalReply, None]:
    """How it stands, then what comes, until its result; a reader that is behind gets the newest feedback only."""
    async with aclosing(goal.events()) as events:
        async for event in events:
            value = "" if event.value is None else text_of(event.value)
            yield telemetry_pb2.GoalReply(
                goal=goal.id, kind=event.kind, status=event.status, json=value, message=event.message
            )
