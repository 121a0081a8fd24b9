"""From a SaveRecording command to a stored recording: holds the ring, writes the clip on a thread, one at a time."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Final

from edge_agent.blackbox.box import BlackBox
from edge_agent.blackbox.clip import Clip, Span, write_clip
from edge_agent.blackbox.recording_store import RecordingStore, SavedRecording
from edge_agent.blackbox.ring import free_floor
from edge_agent.errors import BlackBoxOffError, BusyError, DiskFullError
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError, UsageError
from metaros.idl.globs import Glob

__all__ = ["Saver"]

_AT_ONCE: Final = 4  # cuts that wait for their turn; further ones are refused
_MOST_TOPICS: Final = 256


class Saver:
    """Runs on the event loop. `free` gives free and all bytes of the disk; `changed` is called for each recording."""

    def __init__(
        self,
        box: BlackBox | None,
        recordings: RecordingStore | None,
        clock: Clock,
        *,
        robot_id: str,
        free: Callable[[], tuple[int, int]],
        changed: Callable[[], None],
    ) -> None:
        self._box, self._recordings, self._clock = box, recordings, clock
        self._robot_id, self._free, self._changed = robot_id, free, changed
        self._turn = asyncio.Lock()
        self._cutting: dict[str, asyncio.Task[None]] = {}
        self._closed = threading.Event()

    async def save(self, wanted: link_pb2.SaveRecording) -> None:
        """Until the recording is stored; at once where it is, or was. Several calls for one id are one.

        Raises:
            CommandError: what its code says: black_box_off, nothing_there, too_many_recordings, busy.
            DiskError: the disk did not take it, disk_full among others.
            UsageError: an id, a span or a pattern that is none.
        """
        if self._box is None or self._recordings is None:
            raise BlackBoxOffError("the black box of this robot is off")
        name = wanted.recording_id
        if self._recordings.get(name) is not None or self._recordings.was_here(name):
            self._changed()
            return
        task = self._cutting.get(name)
        if task is None:
            self._recordings.check(name)
            span = span_of(wanted, now_ns=self._clock.wall_ns())
            if len(self._cutting) >= _AT_ONCE:
                raise BusyError(f"{_AT_ONCE} recordings are being cut")
            task = self._cutting[name] = asyncio.create_task(self._save(self._box, self._recordings, span))
            task.add_done_callback(lambda done: self._ended(name, done))
        await asyncio.shield(task)

    async def close(self) -> None:
        """End what is under way; its files go."""
        self._closed.set()
        await asyncio.gather(*self._cutting.values(), return_exceptions=True)

    async def _save(self, box: BlackBox, recordings: RecordingStore, span: Span) -> None:
        held = await asyncio.wrap_future(box.hold())  # before the turn: the ring goes on, and the span with it
        try:
            async with self._turn:
                recordings.check(span.recording_id, size_bytes=sum(piece.size_bytes for piece in span.of(held.files)))

                def work() -> SavedRecording:
                    draft = recordings.draft(span.recording_id)
                    clip: Clip = write_clip(held, span, draft, robot_id=self._robot_id, check=self._go_on)
                    return recordings.keep(span.recording_id, clip, made_ns=self._clock.wall_ns())

                recordings.add(await asyncio.to_thread(work))
        finally:
            box.release()
        self._changed()

    def _go_on(self) -> None:
        """On the writing thread: whether it may go on."""
        if self._closed.is_set():
            raise BlackBoxOffError("the agent ends")
        free, total = self._free()
        if free < free_floor(total):
            raise DiskFullError(f"less than {free_floor(total)} bytes are free on the robot's disk")

    def _ended(self, name: str, task: asyncio.Task[None]) -> None:
        del self._cutting[name]
        if not task.cancelled():
            task.exception()  # it was raised to who waited, if anybody still does


def span_of(wanted: link_pb2.SaveRecording, *, now_ns: int) -> Span:
    """The command's span by this robot's clock; UsageError."""
    from_ns, to_ns = wanted.from_ns, wanted.to_ns
    if wanted.last_ns:
        from_ns, to_ns = now_ns - wanted.last_ns, now_ns
    if not 0 <= from_ns <= to_ns:
        raise UsageError("the recording's begin must not be after its end")
    if len(wanted.topics) > _MOST_TOPICS:
        raise UsageError(f"{len(wanted.topics)} patterns of topics: at most {_MOST_TOPICS} are taken")
    for pattern in wanted.topics:
        try:
            Glob(pattern)
        except MetarosError as error:
            raise UsageError(str(error)) from error
    return Span(recording_id=wanted.recording_id, from_ns=from_ns, to_ns=to_ns, topics=tuple(wanted.topics))
