"""Commands from the gateway: publish, call a service, leases. At most once each, within their time, answered always."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import OrderedDict
from collections.abc import Callable, Coroutine

from edge_agent.errors import BusyError, DuplicateError, ExpiredError, ScopeError, UnsupportedError
from edge_agent.scope import Scope
from edge_agent.teleop import Teleop
from edge_agent.uplink.session import CommandArrived
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS
from metaros.node import Node

__all__ = ["CommandLog", "Commands"]

LOG = logging.getLogger("metaros.agent.commands")
REMEMBERED = 10_000
AT_ONCE = 16
Answer = Callable[[link_pb2.CommandResult], None]


class CommandLog:
    """Remembers the ids of executed commands, so that none runs twice; the oldest are forgotten. Pure."""

    def __init__(self, *, remembered: int = REMEMBERED) -> None:
        self._remembered = remembered
        self._ids: OrderedDict[bytes, None] = OrderedDict()

    def first_time(self, command_id: bytes) -> bool:
        """Whether this id is new; it is known from now on."""
        if command_id in self._ids:
            return False
        self._ids[command_id] = None
        if len(self._ids) > self._remembered:
            self._ids.popitem(last=False)
        return True


class Commands:
    """Runs commands as they come; a service call waits as a task of its own."""

    def __init__(self, node: Node, teleop: Teleop, scope: Scope, clock: Clock) -> None:
        self._node = node
        self._teleop = teleop
        self._scope = scope
        self._clock = clock
        self._log = CommandLog()
        self._tasks: set[asyncio.Task[None]] = set()

    def handle(self, event: CommandArrived, answer: Answer) -> None:
        """Execute a command, in order of arrival; its result goes to `answer`, a service's when it has answered."""
        command = event.command
        result = link_pb2.CommandResult(command_id=command.command_id)
        try:
            remaining_s = self._admit(event)
            if command.WhichOneof("action") == "call_service":
                self._spawn(self._call(command.call_service, remaining_s, result, answer))
                return
            self._execute(command)
            result.ok = True
        except MetarosError as error:
            result.code, result.message = error.code, str(error)
        answer(result)

    async def close(self) -> None:
        """Cancel what is under way."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _admit(self, event: CommandArrived) -> float:
        """Seconds left for the command, or a CommandError that says why it does not run."""
        timeout_s = event.command.timeout_ms / 1000 or LIMITS.command_timeout_s
        remaining_s = event.arrived_s + timeout_s - self._clock.monotonic_s()
        if remaining_s <= 0:
            raise ExpiredError(f"came {-remaining_s:.3f} s after its deadline")
        if len(self._tasks) >= AT_ONCE:
            raise BusyError(f"{AT_ONCE} commands are under way")
        if not self._log.first_time(event.command.command_id):
            raise DuplicateError("this command id was executed before")
        return remaining_s

    def _execute(self, command: link_pb2.Command) -> None:
        match command.WhichOneof("action"):
            case "publish":
                self._teleop.publish(command.publish, command.lease_id)
            case "grant_lease":
                self._teleop.grant(command.grant_lease.lease_id, command.grant_lease.valid_ms / 1000)
            case "release_lease":
                self._teleop.release(command.release_lease.lease_id)
            case _:
                raise UnsupportedError("this agent does not know the command; update it")

    def _spawn(self, call: Coroutine[None, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(call)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _call(
        self, call: link_pb2.CallService, timeout_s: float, result: link_pb2.CommandResult, answer: Answer
    ) -> None:
        try:
            if not self._scope.includes(call.service):
                raise ScopeError(f"{call.service} is outside the agent's namespace {self._scope.namespace}")
            client = self._node.create_raw_client(call.service, call.type_name, call.type_hash)
            with contextlib.closing(client):
                result.payload = await client.call_async(call.request, timeout_s)
            result.ok = True
        except MetarosError as error:
            result.code, result.message = error.code, str(error)
        except Exception as error:
            LOG.exception("calling %s failed", call.service)
            result.code, result.message = "internal", f"{type(error).__name__}: {error}"
        answer(result)
