"""Durable commands on their way: sent when the robot is here, again after every loss of its link, until they are over.

A command is `delivered` in the store before it goes out, so that nobody can cancel what is on its way, and its end is
in the store before the robot is told to forget it. Between the two the robot may be sent it as often as it takes: it
runs it once. One that has left is never ended by its expiry alone, as it may have run: its robot is asked again, and
says whether it came too late. Only one that stays silent for a day more is given up.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any

from gateway.domain.fleet.command import (
    DELIVERED,
    DONE,
    EXPIRED,
    FAILED,
    ISSUED,
    RUNNING,
    Command,
    command_of_wire,
    wire_id,
)
from gateway.errors import RobotOfflineError, StoreError
from gateway.fleet.command_rows import CommandRows
from gateway.fleet.robots import SendFrame
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Delivery"]

log = logging.getLogger(__name__)

LOOK_S = 2.0
PURGE_EVERY = 150  # looks
PURGE_STEPS = 1000
IN_FLIGHT = 16  # durable commands that one robot has at a time; further ones wait
INBOX = 512  # results of one robot that wait for the store
IMMEDIATE_GRACE_S = 60.0
OVERDUE = 500
PASSING = frozenset({"busy"})  # refusals after which the same is sent again
MESSAGE_CHARS = 500
ReadResult = Callable[[link_pb2.Command, bytes], Awaitable[str]]


class Delivery:
    """Lives on the event loop."""

    def __init__(
        self,
        rows: CommandRows,
        send: SendFrame,
        *,
        online: Callable[[str], bool],
        read: ReadResult,
        changed: Callable[[str], None],
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        """`read` makes JSON of an answer; `changed` hears of every command that has another state."""
        self._rows = rows
        self._send = send
        self._online = online
        self._read = read
        self._changed = changed
        self._clock = clock
        self._limits = limits
        self._sent: dict[str, set[str]] = {}  # by robot: what went out over this link and has no result
        self._inbox: dict[str, dict[bytes, link_pb2.CommandResult]] = {}
        self._delivering: dict[str, bool] = {}  # by robot; true: and once more
        self._tasks: set[asyncio.Task[None]] = set()
        self._closed = False

    def on_online(self, robot: str, online: bool) -> None:
        """The robot's link came or went."""
        self._sent.pop(robot, None)
        if online:
            self.deliver(robot)

    def on_result(self, robot: str, result: link_pb2.CommandResult) -> None:
        """A result came that no request waits for."""
        box = self._inbox.get(robot)
        if box is None:
            box = self._inbox[robot] = {}
            self._spawn(self._take_in(robot, box))
        if result.running and result.command_id in box:
            return  # its result is here
        if len(box) < INBOX or result.command_id in box:
            if len(result.payload) > self._limits.result_bytes:
                result.ClearField("payload")
                result.message = f"the answer was over {self._limits.result_bytes} bytes and was not kept"
            box[result.command_id] = result

    def deliver(self, robot: str) -> None:
        """Send what waits for the robot, soon."""
        if robot in self._delivering:
            self._delivering[robot] = True
        elif self._online(robot):
            self._delivering[robot] = False
            self._spawn(self._deliver(robot))

    async def run(self) -> None:
        """Look again and again, until cancelled: at what other gateways issued, and what time has ended."""
        looks = 0
        while True:
            try:
                await self.look()
                if looks % PURGE_EVERY == 0:
                    await self._purge()
            except StoreError as error:
                log.debug("commands wait for the store: %s", error)
            looks += 1
            await asyncio.sleep(LOOK_S)

    async def look(self) -> None:
        """One look."""
        now_ns = self._clock.wall_ns()
        overdue = await self._rows.overdue(
            now_ns=now_ns,
            silence_ns=round(self._limits.command_silence_s * 1e9),
            immediate_ns=round(IMMEDIATE_GRACE_S * 1e9),
            limit=OVERDUE,
        )
        for command in overdue:
            await self._overdue(command)
        for robot in await self._rows.waiting_robots():
            self.deliver(robot)

    async def close(self) -> None:
        """Stop; the next gateway goes on."""
        self._closed = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _overdue(self, command: Command) -> None:
        if not command.durable:
            end = {"state": FAILED, "code": "timeout", "message": "its gateway ended while it ran: nobody knows"}
            await self._end(command, **end)
        elif command.state == ISSUED:
            await self._end(command, within=(ISSUED,), state=EXPIRED, code="expired", message="its robot did not come")
        else:
            text = "its robot did not say in time how it went: whether it was carried out is not known"
            await self._end(command, state=EXPIRED, code="expired", message=text)

    async def _end(self, command: Command, **values: Any) -> bool:
        done = await self._rows.change(command.id, ended_ns=self._clock.wall_ns(), wire=b"", **values)
        self._sent.get(command.robot, set()).discard(command.id)
        self._changed(command.id)
        return done

    async def _deliver(self, robot: str) -> None:
        try:
            while True:
                self._delivering[robot] = False
                with suppress(StoreError, RobotOfflineError):  # looked at again in a moment
                    await self._deliver_all(robot)
                if not self._delivering[robot]:
                    return
        finally:
            del self._delivering[robot]

    async def _deliver_all(self, robot: str) -> None:
        for command in await self._rows.open(robot, limit=4 * IN_FLIGHT):
            sent = self._sent.setdefault(robot, set())
            if command.id in sent:
                continue
            if len(sent) >= IN_FLIGHT or not self._online(robot):
                return
            now_ns = self._clock.wall_ns()
            if command.state == ISSUED and command.expires_ns <= now_ns:
                await self._overdue(command)
                continue
            if command.state == ISSUED:
                moved = await self._rows.change(command.id, within=(ISSUED,), state=DELIVERED, delivered_ns=now_ns)
                if not moved:  # cancelled, or another gateway was faster
                    continue
                self._changed(command.id)
            self._put(robot, command)

    def _put(self, robot: str, command: Command) -> None:
        frame = link_pb2.Command.FromString(command.wire)
        frame.command_id, frame.timeout_ms = wire_id(command.id), command.timeout_ms
        frame.durable, frame.expires_ns, frame.sent_ns = True, command.expires_ns, self._clock.wall_ns()
        self._send(robot, link_pb2.GatewayFrame(command=frame))
        self._sent.setdefault(robot, set()).add(command.id)

    async def _take_in(self, robot: str, box: dict[bytes, link_pb2.CommandResult]) -> None:
        """Store a robot's results one after the other."""
        try:
            while box:
                wire = next(iter(box))
                result = box.pop(wire)
                try:
                    await self._resulted(robot, result)
                except StoreError as error:
                    log.debug("a result of %s waits for the store: %s", robot, error)
                    self._sent.get(robot, set()).discard(command_of_wire(wire) or "")  # asked for again
        finally:
            del self._inbox[robot]
        self.deliver(robot)

    async def _resulted(self, robot: str, result: link_pb2.CommandResult) -> None:
        command_id = command_of_wire(result.command_id)
        command = await self._rows.get(command_id) if command_id is not None else None
        if command is not None and command.robot == robot and command.durable and not command.over:
            if result.running:
                now_ns = self._clock.wall_ns()
                await self._rows.change(command.id, within=(ISSUED, DELIVERED), state=RUNNING, running_ns=now_ns)
                self._changed(command.id)
                return
            if result.code in PASSING and not result.kept:
                self._sent.get(robot, set()).discard(command.id)  # the next look sends it again
                return
            await self._finish(command, result)
        if result.kept:  # whatever it was: the robot need not keep it for us
            stored = link_pb2.ResultStored(command_id=result.command_id)
            with suppress(RobotOfflineError):
                self._send(robot, link_pb2.GatewayFrame(result_stored=stored))

    async def _finish(self, command: Command, result: link_pb2.CommandResult) -> None:
        state = DONE if result.ok else EXPIRED if result.code == "expired" else FAILED
        text = await self._read(link_pb2.Command.FromString(command.wire), result.payload) if result.ok else ""
        await self._end(
            command,
            state=state,
            code="" if result.ok else plain(result.code),
            message=result.message[:MESSAGE_CHARS].replace("\0", ""),
            result=text,
        )

    async def _purge(self) -> None:
        before_ns = self._clock.wall_ns() - round(self._limits.commands_kept_s * 1e9)
        for _ in range(PURGE_STEPS):
            if not await self._rows.purge(before_ns=before_ns, most=self._limits.commands_kept):
                return

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        if self._closed:
            work.close()
            return
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("commands: %s", error, exc_info=error)


def plain(code: str) -> str:
    """An agent's word as a code, whatever it sent."""
    text = code[:64]
    good = text.isascii() and text.replace("_", "").isalnum() and text == text.lower()
    return text if good else "failed"
