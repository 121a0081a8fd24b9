"""Services that a client calls, and goals that it sends: of robots, and rosapi's own."""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.api.robot_access import ResolvedName
from gateway.api.rosbridge.client import Client
from gateway.api.rosbridge.dialect import decode, encode
from gateway.api.rosbridge.requests import CallService, CancelGoal, SendGoal, Shape
from gateway.api.rosbridge.rosapi import Rosapi
from gateway.errors import InvalidRequestError
from gateway.fleet.ros.errors import UnknownActionError, UnknownServiceError
from gateway.fleet.ros.goal import Goal, GoalEvent
from gateway.fleet.ros.typed import catalogue_for
from gateway.fleet.ros.types import full_type_name
from metaros.errors import MetarosError
from metaros.idl import Catalogue
from metaros.limits import LIMITS

__all__ = ["Calling", "Goals"]

CANCEL_ALL = "/_action/cancel_goal"  # what roslib calls to end all goals of an action; the graph does not list it
CANCEL_TYPE = "action_msgs/srv/CancelGoal"
LARGE_BYTES = 32 * 1024  # beyond it values are made in a thread
LOST = 0  # the status of a goal of which nobody knows


async def _values(name: str, payload: bytes, catalogue: Catalogue) -> dict[str, Any]:
    if len(payload) > LARGE_BYTES:
        return await asyncio.to_thread(decode, name, payload, catalogue)
    return decode(name, payload, catalogue)


async def _cdr(name: str, value: Any, catalogue: Catalogue, *, chars: int, now_ns: int) -> bytes:
    if chars > LARGE_BYTES:
        return await asyncio.to_thread(encode, name, value, catalogue, now_ns=now_ns)
    return encode(name, value, catalogue, now_ns=now_ns)


class Calling:
    """The op `call_service` of one client."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._rosapi = Rosapi(client.access)

    def call(self, request: CallService) -> None:
        """Call, and answer when the answer is there. TooManyError."""
        self._client.spawn(self._call(request), request.id)

    async def _call(self, request: CallService) -> None:
        answer: dict[str, Any] = {"op": "service_response", "service": request.service, "id": request.id}
        try:
            values = await self._answer(request)
        except MetarosError as error:
            self._client.say({**answer, "values": str(error), "result": False}, request.shape)
        else:
            self._client.say({**answer, "values": values, "result": True}, request.shape)

    async def _answer(self, request: CallService) -> Any:
        if self._rosapi.serves(request.service):
            return await self._rosapi.answer(request.service, request.args)
        access = self._client.access
        resolved = access.find_service(request.service)
        access.check("robots.call", resolved.robot)
        type_name, catalogue = self._type(resolved, request.type_name)
        cdr = await _cdr(
            f"{type_name}_Request", request.args, catalogue, chars=request.chars, now_ns=self._client.now_ns
        )
        timeout_s = request.timeout_s if request.timeout_s is not None else LIMITS.command_timeout_s
        payload: bytes = await access.call(
            request.service,
            type_name=type_name,
            request=request.args,
            cdr=cdr,
            raw=True,
            timeout_s=timeout_s,
            lease_id=request.lease_id,
        )
        return await _values(f"{type_name}_Response", payload, catalogue)

    def _type(self, resolved: ResolvedName, said: str) -> tuple[str, Catalogue]:
        graph = self._client.services.graphs.of(resolved.robot)
        info = graph.services.get(resolved.name)
        known = CANCEL_TYPE if resolved.name.endswith(CANCEL_ALL) else (info.type_name if info is not None else "")
        if not said and not known:
            raise UnknownServiceError(f"type is missing, and robot {resolved.robot} has no service {resolved.name}")
        type_name = full_type_name(said or known, "srv")
        type_hash = info.type_hash if info is not None and info.type_name == type_name else ""
        return type_name, catalogue_for(graph, type_name, type_hash)


class Goals:
    """The ops `send_action_goal` and `cancel_action_goal` of one client."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._goals: dict[str, Goal | None] = {}  # by the client's id; None: not yet sent
        self._cancelled: set[str] = set()  # while they were not yet sent

    def send(self, request: SendGoal) -> None:
        """Start a goal and tell of it until its end. InvalidRequestError, TooManyError."""
        name = request.id or ""
        if name in self._goals:
            raise InvalidRequestError(f"id {name} is that of another goal of yours")
        self._client.spawn(self._follow(request, name), name)
        self._goals[name] = None

    def cancel(self, request: CancelGoal) -> None:
        """Have a goal stopped; its result says whether it was. InvalidRequestError, TooManyError."""
        name = request.id or ""
        if name not in self._goals:
            raise InvalidRequestError(f"there is no goal {name!r} of yours")
        goal = self._goals[name]
        if goal is None:
            self._cancelled.add(name)
        else:
            self._client.spawn(self._cancel(goal), name)

    async def _follow(self, request: SendGoal, name: str) -> None:
        shape = request.shape
        answer: dict[str, Any] = {"action": request.action, "id": name}
        try:
            goal = await self._sent(request)
            self._goals[name] = goal
            if name in self._cancelled:
                await self._cancel(goal)
            async for event in goal.events():
                if event.kind == "feedback" and request.feedback:
                    values = await self._part(event, "feedback")
                    self._client.say({"op": "action_feedback", **answer, "values": values}, shape)
                elif event.kind == "result":
                    await self._end(event, goal, answer, shape)
        except MetarosError as error:
            end = {"op": "action_result", **answer, "values": str(error), "status": LOST, "result": False}
            self._client.say(end, shape)
        finally:
            del self._goals[name]
            self._cancelled.discard(name)

    async def _sent(self, request: SendGoal) -> Goal:
        access = self._client.access
        resolved = access.find_action(request.action)
        access.check("robots.call", resolved.robot)
        graph = self._client.services.graphs.of(resolved.robot)
        info = graph.actions.get(resolved.name)
        if not request.type_name and info is None:
            raise UnknownActionError(
                f"action_type is missing, and robot {resolved.robot} has no action {resolved.name}"
            )
        type_name = full_type_name(request.type_name or (info.type_name if info is not None else ""), "action")
        type_hash = info.type_hash if info is not None and info.type_name == type_name else ""
        catalogue = catalogue_for(graph, f"{type_name}_SendGoal", type_hash)
        cdr = await _cdr(f"{type_name}_Goal", request.args, catalogue, chars=request.chars, now_ns=self._client.now_ns)
        return await access.send_goal(request.action, type_name=type_name, cdr=cdr, lease_id=request.lease_id)

    async def _cancel(self, goal: Goal) -> None:
        await self._client.access.cancel_goal(goal.robot, goal.id)

    async def _end(self, event: GoalEvent, goal: Goal, answer: dict[str, Any], shape: Shape) -> None:
        """What it gave; one that was rejected or lost gave nothing but a reason."""
        values = await self._part(event, "result") if event.cdr else None
        if values is None:
            values = event.message or goal.status
        end = {"op": "action_result", **answer, "values": values, "status": goal.status_number}
        self._client.say({**end, "result": isinstance(values, dict)}, shape)

    @staticmethod
    async def _part(event: GoalEvent, name: str) -> Any:
        if event.catalogue is None:
            return None
        return (await _values(event.part, event.cdr, event.catalogue))[name]
