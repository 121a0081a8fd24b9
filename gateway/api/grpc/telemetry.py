"""TelemetryService: what robots say and what is said to them; every call is authorized, see serving.py."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import document, stamp, text_of
from gateway.api.grpc.goals import goal_replies
from gateway.api.grpc.query import QueryReplies
from gateway.api.grpc.stream_authorization import while_authorized
from gateway.api.grpc.subscribe import Subscription
from gateway.errors import TooManyError
from gateway.fleet.command_manager import NewCommand
from metaros._proto import telemetry_pb2
from metaros.limits import LIMITS

__all__ = ["TelemetryService"]


class TelemetryService:
    """Each method is one call that was let in."""

    async def Subscribe(self, request: telemetry_pb2.SubscribeRequest, call: Call) -> AsyncIterator[bytes]:
        """Samples and values as they arrive; serialised already, as many calls share them. TooManyError when full."""
        open_connections = call.services.open_connections
        if open_connections.viewers_full(call.principal):
            raise TooManyError(f"of {LIMITS.viewers} viewers, {LIMITS.viewers_each} of a user or key, all look already")
        with open_connections.count_viewer(call.principal):
            async with while_authorized(call), aclosing(Subscription(request, call).replies()) as replies:
                async for reply in replies:
                    yield reply

    async def Query(self, request: telemetry_pb2.QueryRequest, call: Call) -> AsyncIterator[Any]:
        """Stored messages of a range, a page at a time: the next one is read when the last one was taken."""
        call.require(request.robot)
        async with while_authorized(call), aclosing(QueryReplies(request, call).replies()) as replies:
            async for reply in replies:
                yield reply

    async def Publish(self, request: telemetry_pb2.PublishRequest, call: Call) -> Any:
        """Publish once; ends after the agent's result."""
        call.require(request.robot)
        cdr = request.cdr if request.WhichOneof("message") == "cdr" else None
        message = document(request.json, "json") if cdr is None else None
        asked: dict[str, Any] = {"topic": request.topic, "type": request.type_name}
        asked |= {"message": message} if cdr is None else {"cdr_bytes": len(cdr)}
        order = NewCommand(robot=request.robot, kind="publish", request=asked)
        with call.services.command_manager.track(order, call.principal):
            await call.services.fleet.publish(
                request.robot,
                request.topic,
                type_name=request.type_name,
                message=message,
                cdr=cdr,
                lease_id=request.lease_id,
                sent_ns=stamp(request.sent_ns),
            )
        return telemetry_pb2.PublishResponse()

    async def CallService(self, request: telemetry_pb2.CallServiceRequest, call: Call) -> Any:
        """Call a service of the robot."""
        call.require(request.robot)
        timeout_s = request.timeout_s or LIMITS.command_timeout_s
        value = document(request.json, "json")
        asked = {"service": request.service, "type": request.type_name, "request": value}
        order = NewCommand(robot=request.robot, kind="call_service", request=asked, timeout_s=timeout_s)
        with call.services.command_manager.track(order, call.principal) as noted:
            noted.result = await call.services.fleet.call(
                request.robot,
                request.service,
                type_name=request.type_name,
                request=value,
                timeout_s=timeout_s,
                lease_id=request.lease_id,
                sent_ns=stamp(request.sent_ns),
            )
        return telemetry_pb2.CallServiceResponse(json=text_of(noted.result))

    async def SendGoal(self, request: telemetry_pb2.SendGoalRequest, call: Call) -> AsyncIterator[Any]:
        """Start an action; how it goes, until its result. Who ends the call leaves the goal alone."""
        call.require(request.robot)
        goal = await call.services.goals.send(
            request.robot,
            request.action,
            type_name=request.type_name,
            goal=document(request.json, "json"),
            timeout_s=request.timeout_s or LIMITS.command_timeout_s,
            lease_id=request.lease_id,
            sent_ns=stamp(request.sent_ns),
            by=call.principal.name or call.principal.id,
        )
        call.detail = f"goal {goal.id} of {goal.action[:100]}"
        async with while_authorized(call), aclosing(goal_replies(goal)) as replies:
            async for reply in replies:
                yield reply

    async def WatchGoal(self, request: telemetry_pb2.WatchGoalRequest, call: Call) -> AsyncIterator[Any]:
        """How a goal goes that was sent before."""
        call.require(request.robot)
        goal = call.services.goals.find(request.robot, request.goal)
        async with while_authorized(call), aclosing(goal_replies(goal)) as replies:
            async for reply in replies:
                yield reply

    async def CancelGoal(self, request: telemetry_pb2.CancelGoalRequest, call: Call) -> Any:
        """Ask the action's server to stop it."""
        call.require(request.robot)
        call.detail = f"goal {request.goal[:32]}"
        canceling = await call.services.goals.cancel(request.robot, request.goal)
        return telemetry_pb2.CancelGoalResponse(canceling=canceling)
