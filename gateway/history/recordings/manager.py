"""Manages recordings: request, list, download, delete; and the messages of robots about them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gateway.domain.fleet.recording import (
    FAILED,
    REQUESTED,
    STORED,
    TRANSFERRING,
    Recording,
    is_recording_id,
    new_recording_id,
    plain_time,
)
from gateway.errors import InvalidRequestError, RecordingNotStoredError, StoreError, TooManyError, UnknownRecordingError
from gateway.history.recordings.download import Download
from gateway.history.recordings.partial_files import PartialFiles
from gateway.history.recordings.robot_requests import RobotRequests, RunCommand
from gateway.history.recordings.rows import Database, Rows
from gateway.history.recordings.storage import RecordingStorage
from gateway.history.recordings.uploads import SendToRobot, Uploads
from gateway.store.objects import ObjectStore, chunks
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["RecordingManager", "RobotLink"]

log = logging.getLogger(__name__)

LOOK_S = 5.0
MAX_SPAN_NS = 86_400 * 10**9
MAX_TOPICS = 64
MAX_TOPIC_CHARS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotLink:
    """What recordings need of the link; `app.py` connects it."""

    command: RunCommand
    send: SendToRobot
    online: Callable[[str], bool]
    clock_offset_ns: Callable[[str], int]  # the gateway's wall clock less the robot's, as its agent said last


class RecordingManager:
    """Everything about recordings; all methods on the event loop."""

    def __init__(
        self,
        database: Database,
        objects: ObjectStore,
        folder: Path,
        robots: RobotLink,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._rows = rows = Rows(database, clock=clock)
        self._objects = objects
        self._robots = robots
        self._clock = clock
        self._limits = limits
        self._closed = False
        self._tasks: set[asyncio.Task[None]] = set()
        self._downloads = 0
        self.waiting: Callable[[str, str, int], None] = lambda robot, recording_id, last_ns: None  # see `ask`
        self.deleted: Callable[[str], None] = lambda recording_id: None  # likewise: see `stop`
        # Two pools: an object store that is slow must not hold up what comes from robots.
        self._pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="gateway-recordings")
        self._slow_pool = ThreadPoolExecutor(max_workers=4, thread_name_prefix="gateway-files")
        self._storage = RecordingStorage(rows, objects, on_thread=self._on_slow_thread, clock=clock)
        self._requests = RobotRequests(rows, robots.command, online=robots.online, spawn=self._spawn, clock=clock)
        self._uploads = Uploads(
            rows,
            self._storage,
            PartialFiles(folder, reserve_bytes=limits.recording_reserve_bytes),
            send=robots.send,
            spawn=self._spawn,
            on_thread=self._on_thread,
            clock=clock,
            limits=limits,
        )

    def listen(self, listener: Callable[[Recording], None]) -> None:
        """Call this with every recording that comes to its end here."""
        self._rows.ended = listener

    async def request(
        self,
        robot_id: str,
        *,
        last_s: float | None = None,
        span_ns: tuple[int, int] | None = None,
        topics: tuple[str, ...] = (),
    ) -> Recording:
        """Ask for the robot's last seconds, or for a span by its clock; the robot need not be online.

        Raises:
            InvalidRequestError: no span, or one that cannot be.
            UnknownRobotError: no such robot.
            TooManyError: the robot has too many unfinished recordings.
            StoreError: the request cannot be stored now.
        """
        now_ns = self._clock.wall_ns()
        robot_now_ns = self.robot_now_ns(robot_id)
        if last_s is not None:
            span_ns = (robot_now_ns - round(last_s * 1e9), robot_now_ns)
        _check(span_ns, topics, now_ns=robot_now_ns)
        assert span_ns is not None
        recording = Recording(
            id=new_recording_id(now_ns),
            robot=robot_id,
            state=REQUESTED,
            from_ns=span_ns[0],
            to_ns=span_ns[1],
            topics=topics,
            requested_ns=now_ns,
            live_ns=now_ns,
        )
        await self._rows.add(recording, unfinished=self._limits.recordings_unfinished)
        last_ns = 0 if last_s is None else round(last_s * 1e9)
        self._requests.ask(recording, last_ns=last_ns)
        if not self._robots.online(robot_id):
            self.waiting(robot_id, recording.id, last_ns)
        return recording

    def ask(self, recording_id: str, last_ns: int) -> None:
        """Another gateway has taken a request in: if its robot is linked here it is asked now."""
        self._spawn(self._ask_one(recording_id, last_ns))

    def stop(self, recording_id: str) -> None:
        """Another gateway has deleted a recording: what comes of it here is wanted no more."""
        self._uploads.stop(recording_id)

    def robot_now_ns(self, robot_id: str) -> int:
        """What the robot's clock says now, as far as it is known."""
        return plain_time(self._clock.wall_ns() - self._robots.clock_offset_ns(robot_id))

    async def list(self, *, robot_id: str | None = None, limit: int, before: str | None = None) -> list[Recording]:
        """The newest recordings, newest first."""
        found = await self._rows.newest(robot_id=robot_id, limit=limit, before=before)
        return [self._shown(recording) for recording in found]

    async def get(self, recording_id: str) -> Recording:
        """One recording; UnknownRecordingError when there is none."""
        found = await self._rows.get(recording_id) if is_recording_id(recording_id) else None
        if found is None:
            raise UnknownRecordingError.of(recording_id)
        return self._shown(found)

    def download(self, recording: Recording, *, start: int = 0, size_bytes: int | None = None) -> Download:
        """A stored file, or a part of it.

        Raises:
            RecordingNotStoredError: its file is not here, or not yet.
            TooManyError: too many files are being fetched.
        """
        if recording.state != STORED or recording.object is None:
            why = recording.message or f"it is {recording.state}"
            raise RecordingNotStoredError(f"recording {recording.id} has no file: {why}")
        if self._downloads >= self._limits.recording_downloads:
            raise TooManyError(f"{self._downloads} files are being fetched already; try again")
        self._downloads += 1
        content = chunks(self._objects, recording.object, start=start, size_bytes=size_bytes)
        return Download(content, on_thread=self._on_slow_thread, closed=self._downloaded)

    async def delete(self, recording_id: str) -> None:
        """Delete a recording and its file, or give up an unfinished one; UnknownRecordingError when there is none."""
        removed = await self._storage.remove(recording_id) if is_recording_id(recording_id) else None
        if removed is None:
            raise UnknownRecordingError.of(recording_id)
        self._uploads.stop(recording_id)
        self.deleted(recording_id)

    def on_online(self, robot_id: str, online: bool) -> None:
        """The robot's link came or went."""
        if online:
            self._spawn(self._ask_all(robot_id))
        else:
            self._uploads.robot_left(robot_id)

    def on_part(self, robot_id: str, part: link_pb2.RecordingPart) -> None:
        """An offer or a piece of a recording arrived."""
        self._uploads.part(robot_id, part)

    async def run(self) -> None:
        """Look again and again at what is unfinished, until cancelled."""
        while True:
            try:
                await self.look()
            except StoreError as error:
                log.debug("recordings wait for the store: %s", error)
            await asyncio.sleep(LOOK_S)

    async def look(self) -> None:
        """Ask again where nothing came, give up what is too old, and clear away what nobody waits for."""
        unfinished = await self._uploads.tidy()
        before_ns = self._clock.wall_ns() - round(self._limits.recording_age_s * 1e9)
        alive = []
        for recording in unfinished:
            moved_ns = recording.live_ns if recording.state == TRANSFERRING else recording.requested_ns
            if moved_ns < before_ns:
                await self._expire(recording)
            else:
                alive.append(recording)
        self._requests.again(alive, arriving=self._uploads.moving())

    async def close(self) -> None:
        """Stop; what is half here is continued by the next gateway on this data directory."""
        self._closed = True
        self._storage.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for pool in (self._pool, self._slow_pool):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _ask_one(self, recording_id: str, last_ns: int) -> None:
        recording = await self._rows.get(recording_id) if is_recording_id(recording_id) else None
        if recording is not None and recording.unfinished:
            self._requests.ask(recording, last_ns=last_ns)

    async def _ask_all(self, robot_id: str) -> None:
        for recording in await self._rows.unfinished(robot_id):
            self._requests.ask(recording)

    async def _expire(self, recording: Recording) -> None:
        hours = self._limits.recording_age_s / 3600
        message = f"robot {recording.robot} did not deliver it within {hours:g} hours"
        await self._rows.change(recording.id, state=FAILED, code="expired", message=message)

    def _shown(self, recording: Recording) -> Recording:
        """With what has come here a moment ago."""
        received = self._uploads.received(recording.id) if recording.unfinished else None
        return recording if received is None else replace(recording, received_bytes=received)

    def _downloaded(self) -> None:
        self._downloads -= 1

    async def _on_thread(self, job: Callable[..., Any], *args: Any) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self._pool, job, *args)

    async def _on_slow_thread(self, job: Callable[..., Any], *args: Any) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self._slow_pool, job, *args)

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
            level = logging.WARNING if isinstance(error, StoreError) else logging.ERROR
            log.log(level, "recordings: %s", error, exc_info=None if isinstance(error, StoreError) else error)


def _check(span_ns: tuple[int, int] | None, topics: tuple[str, ...], *, now_ns: int) -> None:
    if span_ns is None or not span_ns[0] < span_ns[1] or span_ns[1] - span_ns[0] > MAX_SPAN_NS:
        raise InvalidRequestError("a recording has a span: last_s, or start and a later end, at most a day apart")
    if span_ns[0] >= now_ns:
        raise InvalidRequestError("a recording is of the past: start must be earlier than now")
    if len(topics) > MAX_TOPICS or any(not 1 <= len(topic) <= MAX_TOPIC_CHARS for topic in topics):
        raise InvalidRequestError(f"topics: at most {MAX_TOPICS} patterns of 1 to {MAX_TOPIC_CHARS} characters")
