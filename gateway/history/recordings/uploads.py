"""Uploads of recordings from robots: each offer is checked against the request, few transfers a robot at a time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any

from gateway.domain.fleet.recording import FAILED, STORED, TRANSFERRING, Recording, plain_time
from gateway.errors import DamagedError, GatewayError, StoreError
from gateway.history.recordings.partial_files import PartialFiles
from gateway.history.recordings.robot_requests import good_code
from gateway.history.recordings.rows import Rows
from gateway.history.recordings.storage import RecordingStorage
from gateway.history.recordings.transfer import Budget, OnThread, Transfer, TransferHooks
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import Limits

__all__ = ["SendToRobot", "Uploads"]

log = logging.getLogger(__name__)

STALLED_S = 60.0
PROGRESS_S = 2.0  # between two updates of a recording's row
KEEP_RETRY_S = 5.0
MAX_OFFERS = 64  # of one robot, looked up at a time; more are offered again
MAX_COUNT = 2**63 - 1
SendToRobot = Callable[[str, link_pb2.RecordingWanted], None]


@dataclass(slots=True)
class _Upload:
    """One file on its way."""

    recording: Recording
    transfer: Transfer
    running: bool = False  # false: it waits for its turn
    whole: bool = False
    replaced: bool = False
    moved_s: float = 0.0  # when something last came
    saved_s: float = 0.0
    said: str = ""
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class Uploads:
    """All files on their way to this gateway; lives on the event loop."""

    def __init__(
        self,
        rows: Rows,
        storage: RecordingStorage,
        files: PartialFiles,
        *,
        send: SendToRobot,
        spawn: Callable[[Coroutine[Any, Any, None]], object],
        on_thread: OnThread,
        clock: Clock,
        limits: Limits,
    ) -> None:
        self._rows = rows
        self._storage = storage
        self._files = files
        self._send = send
        self._spawn = spawn
        self._on_thread = on_thread
        self._clock = clock
        self._limits = limits
        self._budget = Budget(limits.recordings_queue_bytes)
        self._here: dict[str, _Upload] = {}
        self._offers: set[tuple[str, str]] = set()  # robot and recording: being looked up

    @property
    def ids(self) -> set[str]:
        """The recordings that are on their way here."""
        return {*self._here, *(recording_id for _, recording_id in self._offers)}

    def moving(self) -> set[str]:
        """Those of them that wait for no word of their robot's: one that stalls may have missed ours."""
        since_s = self._clock.monotonic_s() - STALLED_S
        idle = {a.recording.id for a in self._here.values() if a.running and not a.whole and a.moved_s < since_s}
        return self.ids - idle

    def received(self, recording_id: str) -> int | None:
        """How much of a file is on this gateway's disk; None when it does not come here."""
        arrival = self._here.get(recording_id)
        return arrival.transfer.offset if arrival is not None else None

    def part(self, robot_id: str, part: link_pb2.RecordingPart) -> None:
        """An offer or a piece came from a robot."""
        arrival = self._here.get(part.recording_id)
        known = arrival is not None and arrival.recording.robot == robot_id
        if known and arrival is not None and part.data and arrival.transfer.matches(part):
            arrival.transfer.part(part)
        elif (offer := (robot_id, part.recording_id)) not in self._offers and self._may_offer(robot_id):
            self._offers.add(offer)
            self._spawn(self._offered(robot_id, part))

    def robot_left(self, robot_id: str) -> None:
        """Its link is gone: what is under way goes on in its next session."""
        for arrival in list(self._here.values()):
            if arrival.recording.robot == robot_id:
                arrival.transfer.pause()
                if not arrival.running:
                    self._forget(arrival)

    def stop(self, recording_id: str) -> None:
        """Nobody wants it here any more; its robot is told, and what has come is deleted."""
        arrival = self._here.get(recording_id)
        if arrival is not None:
            arrival.transfer.stop()
            if not arrival.running:
                self._forget(arrival)
                self._spawn(self._ended(arrival.recording))

    async def tidy(self) -> list[Recording]:
        """Take up whole files whose gateway ended before it could store them; delete those that nobody waits for.

        Returns the unfinished recordings.
        """
        before, files = self.ids, await self._on_thread(self._files.ids)
        # Read after those two: what is unknown by now had its end, and does not come back.
        unfinished = await self._rows.unfinished()
        wanted = {recording.id for recording in unfinished}
        for recording_id in before - wanted:
            if (arrival := self._here.get(recording_id)) is not None and not arrival.whole:
                self.stop(recording_id)
        for recording_id in files - wanted - self.ids:
            log.info("recording %s: what had come of it is deleted", recording_id)
            await self._on_thread(self._files.discard, recording_id)
        for recording in unfinished:
            if recording.state == TRANSFERRING and recording.sha256 and recording.id not in self.ids:
                await self._take_up(recording)
        return unfinished

    async def _take_up(self, recording: Recording) -> None:
        arrival = self._arrival(recording)
        if await self._on_thread(arrival.transfer.partial.size) == recording.size_bytes and (
            recording.id not in self.ids
        ):
            arrival.transfer.pause()
            self._begin(arrival)

    def _may_offer(self, robot_id: str) -> bool:
        return sum(robot == robot_id for robot, _ in self._offers) < MAX_OFFERS

    async def _offered(self, robot_id: str, part: link_pb2.RecordingPart) -> None:
        try:
            await self._answer(robot_id, part)
        except StoreError as error:
            log.warning("recording %s: its offer waits: %s", part.recording_id, error)
        finally:
            self._offers.discard((robot_id, part.recording_id))

    async def _answer(self, robot_id: str, part: link_pb2.RecordingPart) -> None:
        asked = await self._rows.get(part.recording_id)
        if asked is None or asked.robot != robot_id or asked.state == FAILED:
            self._unwanted(robot_id, part.recording_id)
        elif asked.state == STORED:
            self._stored(asked)
        elif part.failed:
            await self._fail(asked, good_code(part.failed), f"robot {robot_id} has no file of it: {part.failed[:200]}")
        elif not 0 < part.size_bytes <= self._limits.recording_bytes or len(part.sha256) != 32:
            size = f"{part.size_bytes} bytes are not 1 to {self._limits.recording_bytes}"
            await self._fail(asked, "too_large", f"robot {robot_id} offers a file that is not taken: {size}")
        else:
            await self._take(asked, part)

    async def _take(self, asked: Recording, part: link_pb2.RecordingPart) -> None:
        arrival = self._here.get(asked.id)
        if arrival is not None and not arrival.transfer.matches(part):
            arrival.replaced = True  # the robot cut it again, into another file
            arrival.transfer.stop()
            if arrival.running:
                await arrival.ended.wait()
            self._forget(arrival)
            arrival = None
        if arrival is not None:
            arrival.transfer.offered()
            return
        values: dict[str, Any] = {
            "state": TRANSFERRING,
            "size_bytes": part.size_bytes,
            "sha256": part.sha256.hex(),
            "message": "",
        }
        if part.messages or part.from_ns:  # a part with data may have come without its offer, after a failed look-up
            values |= {
                "first_ns": plain_time(part.from_ns),
                "last_ns": plain_time(part.to_ns),
                "messages": min(part.messages, MAX_COUNT),
            }
        if not await self._rows.change(asked.id, **values):
            self._unwanted(asked.robot, asked.id)
            return
        found = await self._rows.get(asked.id)
        if found is not None and found.unfinished:
            arrival = self._here[asked.id] = self._arrival(found)
            self._next(asked.robot)

    def _arrival(self, recording: Recording) -> _Upload:
        partial = self._files.file(recording.id, sha256=recording.sha256, size_bytes=recording.size_bytes)
        hooks = TransferHooks(
            wanted=lambda offset: self._send(
                recording.robot, link_pb2.RecordingWanted(recording_id=recording.id, offset=offset)
            ),
            progress=lambda offset, message: self._progress(recording.id, offset, message),
            on_thread=self._on_thread,
        )
        transfer = Transfer(
            partial,
            size_bytes=recording.size_bytes,
            sha256=recording.sha256,
            hooks=hooks,
            budget=self._budget,
            window_bytes=self._limits.recording_window_bytes,
        )
        return _Upload(recording, transfer, moved_s=self._clock.monotonic_s())

    def _next(self, robot_id: str) -> None:
        """Begin what waits of a robot's, as far as its number at a time allows."""
        ours = [arrival for arrival in self._here.values() if arrival.recording.robot == robot_id]
        busy = sum(1 for a in ours if a.running and not a.transfer.paused and not a.whole)
        waiting = [arrival for arrival in ours if not arrival.running]
        for arrival in waiting[: max(0, self._limits.recordings_at_a_time - busy)]:
            self._begin(arrival)

    def _begin(self, arrival: _Upload) -> None:
        self._here[arrival.recording.id] = arrival
        arrival.running = True
        self._spawn(self._carry(arrival))

    async def _carry(self, arrival: _Upload) -> None:
        """A file from its first byte to its place."""
        recording, transfer = arrival.recording, arrival.transfer
        try:
            arrival.whole = await transfer.run()
            self._next(recording.robot)
            if arrival.whole and await self._keep(arrival):
                self._stored(recording)
            elif not arrival.whole and not transfer.cancelled:
                await self._fail(recording, "corrupt", "the file's checksum did not hold, several times")
            elif not arrival.replaced:
                await self._ended(recording)
            await self._on_thread(transfer.partial.discard)
        finally:
            arrival.ended.set()
            self._forget(arrival)
            self._next(recording.robot)

    async def _keep(self, arrival: _Upload) -> bool:
        """Store a whole file, however long the object store is away; False when nobody wants it any more."""
        recording, partial = arrival.recording, arrival.transfer.partial
        while True:
            try:
                return await self._storage.keep(
                    recording.id, partial.path, size_bytes=recording.size_bytes, sha256=recording.sha256
                )
            except DamagedError as error:
                await self._fail(recording, "corrupt", f"what had come was damaged on the gateway's disk: {error}")
                return False
            except MetarosError as error:
                log.warning("recording %s cannot be stored now: %s", recording.id, error)
                await self._progress(recording.id, recording.size_bytes, str(error))
            if arrival.transfer.cancelled:
                return False
            await asyncio.sleep(KEEP_RETRY_S)

    async def _progress(self, recording_id: str, offset: int, message: str) -> None:
        """Show how far it is, not too often; stop it when nobody wants it any more."""
        arrival, now_s = self._here.get(recording_id), self._clock.monotonic_s()
        if arrival is not None:
            arrival.moved_s = now_s
        if arrival is None or (message == arrival.said and now_s - arrival.saved_s < PROGRESS_S):
            return
        arrival.saved_s, arrival.said = now_s, message
        try:
            if not await self._rows.change(recording_id, received_bytes=offset, message=message[:500]):
                arrival.transfer.stop()
        except GatewayError as error:
            log.debug("recording %s: %s", recording_id, error)

    async def _fail(self, recording: Recording, code: str, message: str) -> None:
        log.warning("recording %s of robot %s failed: %s", recording.id, recording.robot, message)
        await self._rows.change(recording.id, state=FAILED, code=code, message=message)
        self._unwanted(recording.robot, recording.id)

    async def _ended(self, recording: Recording) -> None:
        """It is not waited for here any more: deleted, or another gateway has stored it meanwhile."""
        try:
            found = await self._rows.get(recording.id)
        except StoreError as error:
            log.warning("recording %s: its robot is told with its next offer: %s", recording.id, error)
            return
        if found is not None and found.state == STORED:
            self._stored(found)
        else:
            self._unwanted(recording.robot, recording.id)

    def _stored(self, recording: Recording) -> None:
        wanted = link_pb2.RecordingWanted(recording_id=recording.id, offset=recording.size_bytes, stored=True)
        self._send(recording.robot, wanted)

    def _unwanted(self, robot_id: str, recording_id: str) -> None:
        self._send(robot_id, link_pb2.RecordingWanted(recording_id=recording_id, unwanted=True))

    def _forget(self, arrival: _Upload) -> None:
        if self._here.get(arrival.recording.id) is arrival:
            del self._here[arrival.recording.id]
