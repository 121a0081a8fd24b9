"""Requests robots to clip a recording: now, when they come online, and again until it is offered or refused."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Collection, Coroutine, Sequence
from typing import Any, Protocol

from gateway.domain.fleet.recording import CUTTING, FAILED, REQUESTED, UNFINISHED, Recording
from gateway.errors import CommandRefusedError, CommandTimeoutError, RobotOfflineError, StoreError, TooManyError
from gateway.history.recordings.rows import Rows
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["RobotRequests", "RunCommand", "good_code"]

log = logging.getLogger(__name__)

CUT_TIMEOUT_S = 120.0  # what an agent may take to cut
AGAIN_S = 30.0
FRESH_NS = 2 * 10**9  # until then "the last minute" may be said as such
PASSING = frozenset({"busy", "expired", "timeout"})  # refusals after which the same may be asked again


class RunCommand(Protocol):
    """Sends a command and returns its good result, as the command dispatcher does."""

    def __call__(self, robot: str, command: link_pb2.Command, *, timeout_s: float) -> Awaitable[link_pb2.CommandResult]:
        """Raises RobotOfflineError, CommandTimeoutError, CommandRefusedError, TooManyError."""


class RobotRequests:
    """Tracks which robot was sent which request; lives on the event loop."""

    def __init__(
        self,
        rows: Rows,
        command: RunCommand,
        *,
        online: Callable[[str], bool],
        spawn: Callable[[Coroutine[Any, Any, None]], object],
        clock: Clock,
    ) -> None:
        self._rows = rows
        self._command = command
        self._online = online
        self._spawn = spawn
        self._clock = clock
        self._under_way: set[str] = set()
        self._repeat: set[str] = set()
        self._asked_s: dict[str, float] = {}  # when the last answer came

    def ask(self, recording: Recording, *, last_ns: int = 0) -> None:
        """Have the span cut if the robot is here; `last_ns` only while the span ends now."""
        if not self._online(recording.robot):
            return
        if recording.id in self._under_way:
            self._repeat.add(recording.id)  # the one under way may have been for a link that is gone
        else:
            self._under_way.add(recording.id)
            self._spawn(self._ask(recording, last_ns))

    def again(self, unfinished: Sequence[Recording], *, arriving: Collection[str]) -> None:
        """Ask once more about those of which nothing has come for a while."""
        now_s = self._clock.monotonic_s()
        self._asked_s = {item.id: s for item in unfinished if (s := self._asked_s.get(item.id)) is not None}
        for recording in unfinished:
            if recording.id not in arriving and now_s - self._asked_s.get(recording.id, -AGAIN_S) >= AGAIN_S:
                self.ask(recording)

    async def _ask(self, asked: Recording, last_ns: int) -> None:
        try:
            recording = await self._rows.get(asked.id)
            if recording is None or not recording.unfinished:
                return
            if recording.state == REQUESTED and not await self._move(recording, (REQUESTED,), CUTTING):
                return
            save = link_pb2.SaveRecording(
                recording_id=recording.id,
                from_ns=recording.from_ns,
                to_ns=recording.to_ns,
                topics=recording.topics,
                last_ns=last_ns if self._clock.wall_ns() - recording.requested_ns < FRESH_NS else 0,
            )
            await self._order(recording, link_pb2.Command(save_recording=save))
        except StoreError as error:
            log.warning("recording %s: %s; asked again later", asked.id, error)
        finally:
            self._under_way.discard(asked.id)
            self._asked_s[asked.id] = self._clock.monotonic_s()
            if asked.id in self._repeat:
                self._repeat.discard(asked.id)
                self.ask(asked)

    async def _order(self, recording: Recording, command: link_pb2.Command) -> None:
        try:
            await self._command(recording.robot, command, timeout_s=CUT_TIMEOUT_S)
        except (RobotOfflineError, CommandTimeoutError, TooManyError) as error:
            await self._move(recording, (CUTTING,), REQUESTED, message=str(error))
        except CommandRefusedError as error:
            if error.agent_code in PASSING:
                await self._move(recording, (CUTTING,), REQUESTED, message=str(error))
            else:
                log.warning("recording %s of robot %s: %s", recording.id, recording.robot, error)
                code = good_code(error.agent_code)
                await self._move(recording, UNFINISHED, FAILED, code=code, message=str(error)[:500])

    async def _move(self, recording: Recording, within: Sequence[str], state: str, **values: str) -> bool:
        return await self._rows.change(recording.id, within=within, state=state, **values)


def good_code(text: str) -> str:
    """An agent's word as a code, whatever it sent."""
    plain = text[:64]
    return plain if plain.isascii() and plain.replace("_", "").isalnum() and plain == plain.lower() else "failed"
