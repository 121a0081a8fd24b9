"""The recording manager on a real store and a manual clock: retries, expiry, storing, and object stores that fail."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.fleet.recording import CUTTING, FAILED, REQUESTED, STORED, TRANSFERRING, Recording
from gateway.domain.robot import Robot
from gateway.errors import (
    CommandRefusedError,
    CommandTimeoutError,
    ObjectStoreError,
    RecordingNotStoredError,
    RobotOfflineError,
    TooManyError,
    UnknownRecordingError,
)
from gateway.history.recordings.manager import RecordingManager, RobotLink
from gateway.store import RobotWrite, Store, ledger
from gateway.store.objects import DirectoryStore, ObjectStore
from gateway.store.retention import Retention
from metaros._proto import link_pb2
from metaros.clock import ManualClock

BLOB = b"a recording " * 1000


class World:
    """A store with one robot, and what the manager sent to it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.clock = ManualClock()
        self.online = True
        self.offset_ns = 0
        self.commands: list[link_pb2.SaveRecording] = []
        self.outcomes: list[Exception | None] = []
        self.told: list[link_pb2.RecordingWanted] = []
        self.store = Store(
            folder / "data", clock=self.clock, retention=Retention(age_s=1e9, size_bytes=1 << 40), queue_bytes=1 << 20
        )
        self.objects = DirectoryStore(folder / "objects")
        self.manager = self.another_manager()

    def another_manager(self, objects: Any = None, *, folder: str = "incoming") -> RecordingManager:
        """As another gateway process would make it."""
        side = RobotLink(
            command=self._command,
            send=lambda robot, wanted: self.told.append(wanted),
            online=lambda robot: self.online,
            clock_offset_ns=lambda robot: self.offset_ns,
        )
        return RecordingManager(self.store, objects or self.objects, self.folder / folder, side, clock=self.clock)

    async def _command(self, robot: str, command: link_pb2.Command, *, timeout_s: float) -> link_pb2.CommandResult:
        self.commands.append(command.save_recording)
        outcome = self.outcomes.pop(0) if self.outcomes else None
        if outcome is not None:
            raise outcome
        return link_pb2.CommandResult(ok=True)

    async def until(self, good: Callable[[], Any]) -> None:
        """Let the manager's tasks run until it is so."""
        async with asyncio.timeout(60):
            while not good():
                await self.store.flush()

    async def state(self, recording: Recording, state: str) -> Recording:
        """The recording once it is in that state."""
        async with asyncio.timeout(60):
            while (found := await self.manager.get(recording.id)).state != state:
                await self.store.flush()
        return found

    def part(self, recording: Recording, offset: int = 0, data: bytes = b"", blob: bytes = BLOB) -> None:
        """The robot offers, or sends a piece."""
        sha256 = hashlib.sha256(blob).digest()
        self.manager.on_part(
            recording.robot,
            link_pb2.RecordingPart(
                recording_id=recording.id, offset=offset, data=data, size_bytes=len(blob), sha256=sha256, messages=3
            ),
        )


@asynccontextmanager
async def opened(folder: Path) -> AsyncIterator[World]:
    """A world, closed at the end."""
    world = World(folder)
    world.store.start()
    world.store.submit(RobotWrite(Robot("r1", "/", "h", "1", {}), world.clock.wall_ns()))
    await world.store.flush()
    try:
        yield world
    finally:
        await world.manager.close()
        await world.store.close()


async def fetched(world: World, recording: Recording, **span: int) -> bytes:
    """The bytes of a stored file."""
    download = world.manager.download(recording, **span)
    try:
        return b"".join([piece async for piece in download.pieces()])
    finally:
        download.close()


async def test_the_span_is_by_the_robots_clock(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        world.offset_ns = 5 * 10**9  # the robot is five seconds behind
        asked = await world.manager.request("r1", last_s=60)
        assert asked.to_ns == world.clock.wall_ns() - 5 * 10**9
        assert asked.to_ns - asked.from_ns == 60 * 10**9
        assert world.manager.robot_now_ns("r1") == asked.to_ns


@pytest.mark.parametrize("offset_ns", [-(2**63), 2**63 - 1])
async def test_a_robot_whose_clock_is_nowhere(tmp_path: Path, offset_ns: int) -> None:
    async with opened(tmp_path) as world:
        world.offset_ns = offset_ns
        asked = await world.manager.request("r1", last_s=60)
        assert (asked.from_ns, asked.to_ns) == (-60 * 10**9, 0)


@pytest.mark.parametrize(
    "outcome",
    [
        RobotOfflineError("gone"),
        CommandTimeoutError("late"),
        CommandRefusedError("busy", agent_code="busy"),
    ],
)
async def test_what_passes_is_asked_again_after_a_while(tmp_path: Path, outcome: Exception) -> None:
    async with opened(tmp_path) as world:
        world.outcomes = [outcome]
        asked = await world.manager.request("r1", last_s=60)
        await world.until(lambda: len(world.commands) == 1)
        held = await world.state(asked, REQUESTED)
        assert held.message == str(outcome)
        await world.manager.look()
        await world.store.flush()
        assert len(world.commands) == 1
        world.clock.advance(31)
        await world.manager.look()
        await world.until(lambda: len(world.commands) == 2)
        assert world.commands[1].last_ns == 0
        assert (world.commands[1].from_ns, world.commands[1].to_ns) == (asked.from_ns, asked.to_ns)
        await world.state(asked, CUTTING)


async def test_an_answer_without_an_offer_is_asked_for_again(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        await world.manager.request("r1", last_s=60)
        await world.until(lambda: len(world.commands) == 1)
        world.clock.advance(31)
        await world.manager.look()
        await world.until(lambda: len(world.commands) == 2)


async def test_a_transfer_that_stalls_is_asked_for_again(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        await world.until(lambda: len(world.commands) == 1)
        world.part(asked)
        await world.until(lambda: world.told)
        world.clock.advance(59)
        await world.manager.look()
        await world.store.flush()
        assert len(world.commands) == 1
        world.clock.advance(2)
        await world.manager.look()
        await world.until(lambda: len(world.commands) == 2)
        world.told.clear()
        world.part(asked)  # which is how an agent answers
        await world.until(lambda: world.told)
        assert world.told[0].offset == 0


async def test_nothing_is_sent_to_a_robot_that_is_remote(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        world.online = False
        asked = await world.manager.request("r1", last_s=60)
        world.clock.advance(31)
        await world.manager.look()
        assert (await world.manager.get(asked.id)).state == REQUESTED
        assert world.commands == []


@pytest.mark.parametrize("offered", [False, True])
async def test_after_a_day_it_is_given_up(tmp_path: Path, offered: bool) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        if offered:
            world.part(asked)
            await world.state(asked, TRANSFERRING)
        world.manager.on_online("r1", False)
        world.online = False
        world.clock.advance(86_399)
        await world.manager.look()
        assert (await world.manager.get(asked.id)).unfinished
        world.clock.advance(2)
        await world.manager.look()
        assert (await world.state(asked, FAILED)).code == "expired"
        world.told.clear()
        world.part(asked)
        await world.until(lambda: world.told)
        assert world.told[0].unwanted


async def test_an_object_store_that_is_away_holds_it_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Away(DirectoryStore):
        """Refuses the first two."""

        left = 2

        def put(self, *args: Any, **more: Any) -> None:
            """Fail, then work."""
            if Away.left:
                Away.left -= 1
                raise ObjectStoreError("no answer")
            super().put(*args, **more)

    monkeypatch.setattr("gateway.history.recordings.uploads.KEEP_RETRY_S", 0.0)
    async with opened(tmp_path) as world:
        world.manager = world.another_manager(Away(tmp_path / "objects"))
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        world.part(asked, 0, BLOB)
        stored = await world.state(asked, STORED)
        assert await fetched(world, stored) == BLOB
        await world.until(lambda: world.told[-1].stored)
        names = await world.store.run(
            lambda engine: engine.fetch("SELECT state, count(*) FROM objects GROUP BY state ORDER BY state")
        )
        assert [tuple(row) for row in names] == [("doomed", 2), ("stored", 1)]


async def test_a_whole_file_is_stored_by_the_next_gateway(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.state(asked, TRANSFERRING)
        await world.manager.close()
        partial = tmp_path / "incoming" / f"{asked.id}-{hashlib.sha256(BLOB).hexdigest()[:16]}.partial"
        partial.write_bytes(BLOB)  # all had come when it was killed
        world.online = False
        world.manager = world.another_manager()
        await world.manager.look()
        stored = await world.state(asked, STORED)
        assert await fetched(world, stored, start=5, size_bytes=7) == BLOB[5:12]
        await world.until(lambda: not partial.exists())


async def test_what_nobody_waits_for_is_cleared_away(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        left = tmp_path / "incoming" / "01ARZ3NDEKTSV4RRFFQ69G5FAV-0123456789abcdef.partial"
        left.write_bytes(b"x")
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        world.part(asked, 0, BLOB[:5])
        await world.until(lambda: world.told[-1].offset == 5)
        await world.manager.look()
        assert not left.exists()
        assert (await world.manager.get(asked.id)).received_bytes == 5


async def test_what_another_gateway_has_stored_is_reported_as_stored(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        world.part(asked, 0, BLOB[:100])
        await world.until(lambda: world.told[-1].offset == 100)
        here, world.manager = world.manager, world.another_manager(folder="elsewhere")
        world.part(asked)
        await world.until(lambda: world.told[-1].offset == 0)
        world.part(asked, 0, BLOB)
        await world.state(asked, STORED)
        await world.until(lambda: world.told[-1].stored)
        world.told.clear()
        await here.look()
        await world.until(lambda: world.told)
        assert [(wanted.stored, wanted.unwanted) for wanted in world.told] == [(True, False)]
        await here.close()


async def test_a_robot_that_cuts_again_sends_another_file(tmp_path: Path) -> None:
    other = BLOB[::-1]
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        world.part(asked, 0, BLOB[:100])
        await world.until(lambda: world.told[-1].offset == 100)
        world.told.clear()
        world.part(asked, blob=other)
        await world.until(lambda: world.told)
        assert [(wanted.offset, wanted.unwanted) for wanted in world.told] == [(0, False)]
        world.part(asked, 0, other, blob=other)
        stored = await world.state(asked, STORED)
        assert await fetched(world, stored) == other


async def test_stored_fetched_and_deleted_in_every_object_store(tmp_path: Path, objects: ObjectStore) -> None:
    blob = bytes(range(256)) * 40_000  # more than one piece of an upload to S3
    async with opened(tmp_path) as world:
        await world.manager.close()
        world.manager = world.another_manager(objects)
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked, blob=blob)
        sent = 0
        while sent < len(blob):
            await world.until(lambda sent=sent: world.told and world.told[-1].offset == sent)
            world.part(asked, sent, blob[sent : sent + 250_000], blob=blob)
            sent = min(len(blob), sent + 250_000)
        stored = await world.state(asked, STORED)
        assert await fetched(world, stored) == blob
        assert await fetched(world, stored, start=5_000_000, size_bytes=3) == blob[5_000_000:5_000_003]
        assert [item.size_bytes for item in objects.names("recordings/")] == [len(blob)]
        await world.manager.delete(asked.id)
        jobs = await asyncio.to_thread(sweep, world, asyncio.get_running_loop(), objects)
        assert jobs == 1
        assert list(objects.names()) == []


def sweep(world: World, loop: asyncio.AbstractEventLoop, objects: ObjectStore) -> int:
    """Housekeeping of the object store, on a thread."""

    def run(job: Callable[..., Any], /) -> Any:
        return asyncio.run_coroutine_threadsafe(world.store.run(job), loop).result(60)

    return ledger.sweep_objects(run, objects, now_ns=world.clock.wall_ns())


async def test_deleting_dooms_the_object(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        with pytest.raises(RecordingNotStoredError):
            world.manager.download(await world.manager.get(asked.id))
        world.part(asked, 0, BLOB)
        await world.state(asked, STORED)
        await world.manager.delete(asked.id)
        rows = await world.store.run(lambda engine: engine.fetch("SELECT kind, state FROM objects"))
        assert [tuple(row) for row in rows] == [("recording", "doomed")]
        for gone in (asked.id, "../x"):
            with pytest.raises(UnknownRecordingError):
                await world.manager.delete(gone)
            with pytest.raises(UnknownRecordingError):
                await world.manager.get(gone)


async def test_so_many_downloads_at_a_time(tmp_path: Path) -> None:
    async with opened(tmp_path) as world:
        asked = await world.manager.request("r1", last_s=60)
        world.part(asked)
        await world.until(lambda: world.told)
        world.part(asked, 0, BLOB)
        stored = await world.state(asked, STORED)
        running = [world.manager.download(stored) for _ in range(16)]
        with pytest.raises(TooManyError):
            world.manager.download(stored)
        running[3].close()
        running[3].close()  # counts once
        assert await fetched(world, stored) == BLOB
        again = world.manager.download(stored)
        with pytest.raises(TooManyError):
            world.manager.download(stored)
        again.close()
