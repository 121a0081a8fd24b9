"""Durable commands: run at most once, whatever restarts; answered by their kept result as often as they come.

The gateway sends one again after every loss of the link until it has its result. What is refused before it began
(it came too late, or there is no room) leaves nothing behind; from its begin on there is a file with its outcome.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from edge_agent.commands.executed_ids import CommandLog
from edge_agent.commands.stored_results import StoredResults, interrupted
from edge_agent.errors import BusyError, DiskError, ExpiredError, UnsupportedError
from edge_agent.link.frames import CommandArrived, ControlFrame
from edge_agent.link.handler import SendFrame
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Answer", "DurableCommands"]

Answer = Callable[[link_pb2.CommandResult], None]
_KINDS = ("publish", "call_service", "set_uplink", "save_recording", "node_verb", "read_log")


class DurableCommands:
    """Lives on the event loop; a `ControlHandler` of the link."""

    frames = frozenset({"result_stored"})

    def __init__(
        self,
        kept: StoredResults,
        log: CommandLog,
        clock: Clock,
        *,
        run: Callable[[CommandArrived], Awaitable[link_pb2.CommandResult]],
        spawn: Callable[[Coroutine[Any, Any, None]], object],
    ) -> None:
        """`run` carries a command out and says how it went; it does not raise."""
        self._kept = kept
        self._log = log
        self._clock = clock
        self._run = run
        self._spawn = spawn
        self._under_way: dict[bytes, Answer] = {}
        for result in kept:
            log.first_time(result.command_id)

    def arrived(self, event: CommandArrived, answer: Answer) -> None:
        """One came, for the first time or again; its result goes to the `answer` that came last.

        Raises:
            ExpiredError: after its end by the gateway's clock; it did not run.
            BusyError: too many are kept, or the gateway's time is not known: it may come again.
            UnsupportedError: it is none that can be durable.
        """
        command_id = event.command.command_id
        if (result := self._kept.get(command_id)) is not None:
            answer(result)
        elif command_id in self._under_way:
            self._under_way[command_id] = answer
        elif self._log.knows(command_id):
            answer(interrupted(command_id))
        else:
            self._check(event)
            self._under_way[command_id] = answer
            self._spawn(self._carry(event))

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """A new link: what is kept goes out again, and what runs answers there."""

        def answer(result: link_pb2.CommandResult) -> None:
            send(link_pb2.AgentFrame(result=result))

        for result in self._kept:
            answer(result)
        for command_id in self._under_way:
            self._under_way[command_id] = answer

    def link_down(self) -> None:
        """What runs goes on, and answers on the next link."""

    def take(self, received: ControlFrame) -> None:
        """The gateway has a result."""
        command_id = received.frame.result_stored.command_id
        if self._kept.get(command_id) is not None:
            self._spawn(self._forget(command_id))

    async def _forget(self, command_id: bytes) -> None:
        """Once the id alone keeps the command from running again; else the result goes out with the next link."""
        await self._log.keep()
        if self._log.on_disk(command_id):
            await self._kept.forget(command_id)

    def _check(self, event: CommandArrived) -> None:
        command = event.command
        if command.WhichOneof("action") not in _KINDS:
            raise UnsupportedError("this cannot be a durable command")
        if event.peer_ns is None:
            raise BusyError("the gateway's time is not known yet")
        waited_s = self._clock.monotonic_s() - event.arrived_s
        if event.peer_ns + round(waited_s * 1e9) >= command.expires_ns:
            raise ExpiredError("it came after its end, and was not executed")
        if len(self._kept) + len(self._under_way) >= LIMITS.durable_kept:
            raise BusyError(f"{LIMITS.durable_kept} durable commands are under way or wait for the gateway")

    async def _carry(self, event: CommandArrived) -> None:
        command_id = event.command.command_id
        try:
            result = await self._outcome(event)
        except BaseException:  # the agent ends: the next one reports what was begun as interrupted
            del self._under_way[command_id]
            raise
        self._under_way.pop(command_id)(result)

    async def _outcome(self, event: CommandArrived) -> link_pb2.CommandResult:
        """Keep that it begins, run it, keep how it went."""
        command_id = event.command.command_id
        try:
            await self._kept.begin(command_id)
        except DiskError as error:
            text = f"it cannot be kept now, and did not run: {error}"
            return link_pb2.CommandResult(command_id=command_id, code=BusyError.code, message=text)
        self._log.first_time(command_id)
        await self._log.keep()
        try:
            self._check_again(event)
        except ExpiredError as error:
            result = link_pb2.CommandResult(command_id=command_id, code=error.code, message=str(error))
        else:
            self._under_way[command_id](link_pb2.CommandResult(command_id=command_id, running=True))
            result = await self._run(event)
        return await self._kept.keep(result)

    def _check_again(self, event: CommandArrived) -> None:
        """The disk may have taken long."""
        waited_ns = round((self._clock.monotonic_s() - event.arrived_s) * 1e9)
        if (event.peer_ns or 0) + waited_ns >= event.command.expires_ns:
            raise ExpiredError("it waited for the disk until after its end, and was not executed")
