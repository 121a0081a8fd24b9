"""Commands from the gateway: publish, call a service, leases, the byte budget, recordings, nodes.

At most once each, also over restarts; within their time; answered always. What moves the robot needs the lease and a
fresh stamp, whoever asks, and is never durable.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from typing import Any

from edge_agent.blackbox.saver import Saver
from edge_agent.commands.durable import Answer, DurableCommands
from edge_agent.commands.executed_ids import CommandLog
from edge_agent.commands.stored_results import StoredResults
from edge_agent.commands.teleop import Teleop
from edge_agent.errors import BusyError, DuplicateError, ExpiredError, LeaseError, ScopeError, UnsupportedError
from edge_agent.forwarding.scope import Scope
from edge_agent.link.byte_budget_override import UplinkLimit
from edge_agent.link.frames import CommandArrived
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS
from metaros.node import Node

__all__ = ["Action", "CommandDispatcher"]

LOG = logging.getLogger("metaros.agent.commands")
AT_ONCE = 16
LEASES = ("grant_lease", "release_lease", "grant_talk", "release_talk")
Action = Callable[[link_pb2.Command, float], Awaitable[bytes]]  # command and seconds left; the result's payload


class CommandDispatcher:
    """Runs commands. Leases and actuators at once; the others wait until their ids are on disk, and keep their order.

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
        kept: StoredResults,
        actions: Mapping[str, Action] | None = None,
    ) -> None:
        """`actions` are further kinds of commands, by their names in `Command.action`."""
        self._node = node
        self._teleop = teleop
        self._scope = scope
        self._clock = clock
        self._log = log
        self._saver = saver
        self._calls = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self.durable = DurableCommands(kept, log, clock, run=self._run, spawn=self._spawn)

        async def set_uplink(command: link_pb2.Command, remaining_s: float) -> bytes:
            await limit.set(command.set_uplink.bytes_per_s)
            return b""

        async def save_recording(command: link_pb2.Command, remaining_s: float) -> bytes:
            await saver.save(command.save_recording)
            return b""

        self._actions: dict[str, Action] = {
            "publish": self._publish,
            "call_service": self._call,
            "set_uplink": set_uplink,
            "save_recording": save_recording,
            **(actions or {}),
        }

    def handle(self, event: CommandArrived, answer: Answer) -> None:
        """Execute a command, in order of arrival; its result goes to `answer`, a service's when it has answered."""
        command = event.command
        result = link_pb2.CommandResult(command_id=command.command_id)
        try:
            if command.durable:
                self._check_durable(command)
                self.durable.arrived(event, answer)
                return
            self._admit(event)
            if self._at_once(event):
                self._log.wake()
                result.ok = True
            else:
                self._calls += command.WhichOneof("action") == "call_service"
                self._spawn(self._later(event, answer))
                return
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

    def _check_durable(self, command: link_pb2.Command) -> None:
        """What moves the robot is of this moment: nobody may have it come later."""
        action = command.WhichOneof("action")
        if action not in self._actions:
            raise UnsupportedError("this agent does not know the command, or not as a durable one; update it")
        name = driven(command)
        if name and self._teleop.is_actuator(name):
            raise LeaseError(f"{name} is an actuator: what moves the robot is never durable")

    def _admit(self, event: CommandArrived) -> None:
        """Note the command, or raise the CommandError that says why it does not run."""
        action = event.command.WhichOneof("action")
        self._remaining_s(event)
        if action not in LEASES and action not in self._actions:
            raise UnsupportedError("this agent does not know the command; update it")
        if action == "call_service" and self._calls >= AT_ONCE:
            raise BusyError(f"{AT_ONCE} service calls are under way")
        if action not in LEASES and len(self._tasks) >= LIMITS.commands_waiting:
            raise BusyError(f"{LIMITS.commands_waiting} commands are under way")
        if not self._log.first_time(event.command.command_id):
            raise DuplicateError("this command id was executed before")

    def _at_once(self, event: CommandArrived) -> bool:
        """Carry out what does not wait for the disk; False when it is none of that. Its stamp keeps it from replay."""
        command = event.command
        match command.WhichOneof("action"):
            case "grant_lease":
                self._teleop.grant(command.grant_lease.lease_id, command.grant_lease.valid_ms / 1000)
            case "grant_talk":
                self._teleop.grant_talk(command.grant_talk.lease_id, command.grant_talk.valid_ms / 1000)
            case "release_lease" | "release_talk":
                self._teleop.release(command.release_lease.lease_id or command.release_talk.lease_id)
            case "publish" if self._teleop.is_actuator(command.publish.topic):
                age_s = event.age_s(self._clock.monotonic_s())
                self._teleop.publish(command.publish, command.lease_id, age_s=age_s)
            case _:
                return False
        return True

    def _remaining_s(self, event: CommandArrived) -> float:
        """Seconds left for the command; ExpiredError when there are none. A lease's way here counts, too."""
        timeout_s, now_s = event.command.timeout_ms / 1000 or LIMITS.command_timeout_s, self._clock.monotonic_s()
        spent_s = now_s - event.arrived_s
        if event.command.WhichOneof("action") in ("grant_lease", "grant_talk"):
            spent_s = max(spent_s, event.age_s(now_s) or 0.0)
        if spent_s >= timeout_s:
            raise ExpiredError(f"came {spent_s - timeout_s:.3f} s after its deadline")
        return timeout_s - spent_s

    def _spawn(self, call: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(call)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _later(self, event: CommandArrived, answer: Answer) -> None:
        """What runs only once its id is kept."""
        try:
            await self._log.keep()
            answer(await self._run(event))
        finally:
            self._calls -= event.command.WhichOneof("action") == "call_service"

    async def _run(self, event: CommandArrived) -> link_pb2.CommandResult:
        """Carry it out; how it went."""
        command = event.command
        result = link_pb2.CommandResult(command_id=command.command_id)
        try:
            remaining_s = self._remaining_s(event)
            if command.WhichOneof("action") in ("call_service", "send_goal"):
                age_s = event.age_s(self._clock.monotonic_s())
                self._teleop.check(driven(command), command.lease_id, age_s=age_s)
            result.payload = await self._actions[command.WhichOneof("action") or ""](command, remaining_s)
            result.ok = True
        except MetarosError as error:
            result.code, result.message = error.code, str(error)
        except Exception as error:
            LOG.exception("a command failed")
            result.code, result.message = "internal", f"{type(error).__name__}: {error}"
        return result

    async def _answer_in_turn(self, result: link_pb2.CommandResult, answer: Answer) -> None:
        await self._log.keep()
        answer(result)

    async def _publish(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        self._teleop.publish(command.publish, command.lease_id)
        return b""

    async def _call(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        """Call a service; its response as CDR. One that moves the robot only under the lease."""
        call = command.call_service
        if not self._scope.includes(call.service):
            raise ScopeError(f"{call.service} is outside the agent's namespace {self._scope.namespace}")
        client = self._node.create_raw_client(call.service, call.type_name, call.type_hash)
        with contextlib.closing(client):
            response: bytes = await client.call_async(call.request, remaining_s)
            return response


def driven(command: link_pb2.Command) -> str:
    """The topic, service or action that a command uses, which may move the robot; "" where it uses none."""
    match command.WhichOneof("action"):
        case "publish":
            return command.publish.topic
        case "call_service":
            return command.call_service.service
        case "send_goal":
            return command.send_goal.action
    return ""
