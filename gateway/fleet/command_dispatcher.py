"""Dispatches commands to robots: an id, a deadline, and exactly one outcome for the caller."""

from __future__ import annotations

import asyncio
import uuid
from dataclasses import dataclass

from gateway.errors import CommandRefusedError, CommandTimeoutError, RobotOfflineError, TooManyError
from gateway.fleet.robots import SendFrame
from metaros._proto import link_pb2
from metaros.clock import Clock, SystemClock

__all__ = ["CommandDispatcher"]

PENDING_PER_ROBOT = 64
LEASES = ("grant_lease", "release_lease")  # one at a time of each driver; nobody else's work keeps one from the wheel
LOOKS_PER_ROBOT = 16  # of them that only look: whoever may read leaves room for who drives
TRAVEL_S = 1.0  # what a result may take on the way, beside the command's own time


@dataclass(slots=True)
class _Pending:
    """A command without a result yet."""

    robot: str
    look: bool
    done: asyncio.Future[link_pb2.CommandResult]


class CommandDispatcher:
    """Sends commands and matches results; lives on the event loop."""

    def __init__(self, send: SendFrame, *, clock: Clock | None = None) -> None:
        """`send` puts a frame on a robot's control lane or raises RobotOfflineError."""
        self._send = send
        self._clock = clock or SystemClock()
        self._pending: dict[bytes, _Pending] = {}

    @property
    def under_way(self) -> int:
        """How many commands wait for their results."""
        return len(self._pending)

    async def run(
        self, robot: str, command: link_pb2.Command, *, timeout_s: float, command_id: bytes = b"", look: bool = False
    ) -> link_pb2.CommandResult:
        """Send a command (its id and times are set here) and return its good result.

        A stamp that the command has already stays, as far as it is not ahead: it says when its client made it. `look`:
        it changes nothing, and people without a right to change anything may ask for it.

        Raises:
            RobotOfflineError: no link, or the link went before the result.
            CommandTimeoutError: no result in time; whether the robot acted is not known.
            CommandRefusedError: the agent refused or failed; carries its code.
            TooManyError: so many are under way already.
        """
        if command.WhichOneof("action") not in LEASES:
            under_way = [item.look for item in self._pending.values() if item.robot == robot]
            if len(under_way) >= PENDING_PER_ROBOT or (look and sum(under_way) >= LOOKS_PER_ROBOT):
                raise TooManyError(f"robot {robot} has {len(under_way)} commands under way already")
        command_id = command_id or uuid.uuid4().bytes
        now_ns = self._clock.wall_ns()
        command.command_id, command.sent_ns = command_id, min(command.sent_ns or now_ns, now_ns)
        command.timeout_ms = max(1, round(timeout_s * 1000))
        pending = _Pending(robot, look, asyncio.get_running_loop().create_future())
        self._pending[command_id] = pending
        try:
            self._send(robot, link_pb2.GatewayFrame(command=command))
            async with asyncio.timeout(timeout_s + TRAVEL_S):
                result = await pending.done
        except TimeoutError as error:
            raise CommandTimeoutError(f"robot {robot} gave no result within {timeout_s:g} s") from error
        finally:
            del self._pending[command_id]
        if not result.ok:
            text = result.message or f"robot {robot} refused: {result.code}"
            raise CommandRefusedError(text, agent_code=result.code)
        return result

    def on_result(self, robot: str, result: link_pb2.CommandResult) -> bool:
        """A result came; False when nobody here waits for it (any more), or it is from another robot."""
        pending = self._pending.get(result.command_id)
        if pending is None or pending.robot != robot or pending.done.done():
            return False
        pending.done.set_result(result)
        return True

    def lost(self, robot: str, command_id: bytes, why: str) -> None:
        """Of this command no result will come; nothing happens to one that is over, or another robot's."""
        pending = self._pending.get(command_id)
        if pending is not None and pending.robot == robot and not pending.done.done():
            pending.done.set_exception(RobotOfflineError(why))

    def on_offline(self, robot: str) -> None:
        """The robot's link is gone: its commands will have no result."""
        for pending in self._pending.values():
            if pending.robot == robot and not pending.done.done():
                pending.done.set_exception(RobotOfflineError(f"robot {robot} lost its link; the outcome is not known"))
