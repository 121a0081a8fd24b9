"""Commands from the gateway: publish, call a service, leases, the byte budget, recordings.

At most once each, also over restarts; within their time; answered always.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Coroutine

from edge_agent.blackbox.saver import Saver
from edge_agent.command_log import CommandLog
from edge_agent.errors import BusyError, DuplicateError, ExpiredError, ScopeError, UnsupportedError
from edge_agent.scope import Scope
from edge_agent.teleop import Teleop
from edge_agent.uplink.session import CommandArrived
from edge_agent.uplink_limit import UplinkLimit
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS
from metaros.node import Node

__all__ = ["Commands"]

LOG = logging.getLogger("metaros.agent.commands")
AT_ONCE = 16
Answer = Callable[[link_pb2.CommandResult], None]


class Commands:
    """Runs commands. Leases change at once; the others wait until their ids are on disk, and keep their order.

    A service call, a limit that is to be kept, and a recording take their time in tasks of their own.
    """

    def __init__(
        self,
        node: Node,
        teleop: Teleop,
        scope: Scope,
        clock: Clock,
        *,
        log: CommandLog,
        limit: UplinkLimit,
        saver: Saver,
    ) -> None:
        self._node = node
        self._teleop = teleop
        self._scope = scope
        self._clock = clock
        self._log = log
        self._limit = limit
        self._saver = saver
        self._calls = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def handle(self, event: CommandArrived, answer: Answer) -> None:
        """Execute a command, in order of arrival; its result goes to `answer`, a service's when it has answered."""
        command = event.command
        result = link_pb2.CommandResult(command_id=command.command_id)
        try:
            self._admit(event)
            match command.WhichOneof("action"):
                case "grant_lease":
                    self._teleop.grant(command.grant_lease.lease_id, command.grant_lease.valid_ms / 1000)
                case "release_lease":
                    self._teleop.release(command.release_lease.lease_id)
                case "publish" | "call_service" | "set_uplink" | "save_recording" as action:
                    self._calls += action == "call_service"
                    self._spawn(self._later(event, result, answer))
                    return
                case _:
                    raise UnsupportedError("this agent does not know the command; update it")
            self._log.wake()
            result.ok = True
        except DuplicateError as error:  # the first one may still wait: its answer comes first
            result.code, result.message = error.code, str(error)
            self._spawn(self._answer_in_turn(result, answer))
            return
        except MetarosError as error:
            result.code, result.message = error.code, str(error)
        answer(result)

    async def close(self) -> None:
        """Cancel what is under way."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._saver.close()
        await self._log.close()

    def _admit(self, event: CommandArrived) -> None:
        """Note the command, or raise the CommandError that says why it does not run."""
        self._remaining_s(event)
        action = event.command.WhichOneof("action")
        if action == "call_service" and self._calls >= AT_ONCE:
            raise BusyError(f"{AT_ONCE} service calls are under way")
        if action not in ("grant_lease", "release_lease") and len(self._tasks) >= LIMITS.commands_waiting:
            raise BusyError(f"{LIMITS.commands_waiting} commands are under way")
        if not self._log.first_time(event.command.command_id):
            raise DuplicateError("this command id was executed before")

    def _remaining_s(self, event: CommandArrived) -> float:
        """Seconds left for the command; ExpiredError when there are none."""
        timeout_s = event.command.timeout_ms / 1000 or LIMITS.command_timeout_s
        remaining_s = event.arrived_s + timeout_s - self._clock.monotonic_s()
        if remaining_s <= 0:
            raise ExpiredError(f"came {-remaining_s:.3f} s after its deadline")
        return remaining_s

    def _spawn(self, call: Coroutine[None, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(call)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _later(self, event: CommandArrived, result: link_pb2.CommandResult, answer: Answer) -> None:
        """What runs only once its id is kept."""
        command = event.command
        try:
            await self._log.keep()
            remaining_s = self._remaining_s(event)
            match command.WhichOneof("action"):
                case "publish":
                    self._teleop.publish(command.publish, command.lease_id)
                case "call_service":
                    result.payload = await self._call(command.call_service, remaining_s)
                case "set_uplink":
                    await self._limit.set(command.set_uplink.bytes_per_s)
                case "save_recording":
                    await self._saver.save(command.save_recording)
            result.ok = True
        except MetarosError as error:
            result.code, result.message = error.code, str(error)
        except Exception as error:
            LOG.exception("a command failed")
            result.code, result.message = "internal", f"{type(error).__name__}: {error}"
        finally:
            self._calls -= command.WhichOneof("action") == "call_service"
        answer(result)

    async def _answer_in_turn(self, result: link_pb2.CommandResult, answer: Answer) -> None:
        await self._log.keep()
        answer(result)

    async def _call(self, call: link_pb2.CallService, timeout_s: float) -> bytes:
        """Call a service; its response as CDR."""
        if not self._scope.includes(call.service):
            raise ScopeError(f"{call.service} is outside the agent's namespace {self._scope.namespace}")
        client = self._node.create_raw_client(call.service, call.type_name, call.type_hash)
        with contextlib.closing(client):
            response: bytes = await client.call_async(call.request, timeout_s)
            return response
