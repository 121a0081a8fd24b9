"""One file's way to the disk: holes, duplicates, full queues, a full disk, and a checksum that does not hold."""

from __future__ import annotations

import asyncio
import hashlib
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.errors import StoreError
from gateway.history.recordings.partial_files import PartialFile, PartialFiles
from gateway.history.recordings.transfer import Budget, Transfer, TransferHooks
from metaros._proto import link_pb2

WINDOW = 64
BLOB = bytes(range(256))
SHA = hashlib.sha256(BLOB).hexdigest()
RID = "01ARZ3NDEKTSV4RRFFQ69G5FAV"


class Rig:
    """A transfer, and what it told."""

    def __init__(self, folder: Path, *, budget: int = 10_000, reserve_bytes: int = 0, sha256: str = SHA) -> None:
        self.partial = PartialFiles(folder, reserve_bytes=reserve_bytes).file(RID, sha256=sha256, size_bytes=len(BLOB))
        self.told: list[int] = []
        self.said: list[str] = []
        self.budget = Budget(budget)
        self.gate = asyncio.Event()
        self.gate.set()
        self.news = asyncio.Event()
        hooks = TransferHooks(wanted=self._wanted, progress=self._progress, on_thread=self._call)
        self.transfer = Transfer(
            self.partial,
            size_bytes=len(BLOB),
            sha256=sha256,
            hooks=hooks,
            budget=self.budget,
            window_bytes=WINDOW,
            retry_s=0.0,
        )

    def part(self, start: int, end: int) -> None:
        """A piece arrives."""
        self.transfer.part(link_pb2.RecordingPart(recording_id=RID, offset=start, data=BLOB[start:end]))

    async def until(self, good: Callable[[], bool]) -> None:
        """Wait for something told."""
        async with asyncio.timeout(60):
            while not good():
                self.news.clear()
                await self.news.wait()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[asyncio.Task[bool]]:
        """Its task; cancelled at the end unless it is done."""
        task = asyncio.create_task(self.transfer.run())
        try:
            yield task
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def _wanted(self, offset: int) -> None:
        self.told.append(offset)
        self.news.set()

    async def _progress(self, offset: int, message: str) -> None:
        self.said.append(message)
        self.news.set()

    async def _call(self, job: Callable[..., Any], *args: Any) -> Any:
        await self.gate.wait()
        return job(*args)


async def test_all_of_it_in_order(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        for start in range(0, 256, 32):
            rig.part(start, start + 32)
            await rig.until(lambda start=start: start == 224 or rig.told[-1] == start + 32)
        assert await task
    assert rig.partial.path.read_bytes() == BLOB
    assert rig.told == list(range(0, 256, 32))
    assert rig.budget.left == 10_000


async def test_what_was_there_is_not_asked_for_again(tmp_path: Path) -> None:
    Rig(tmp_path).partial.append(0, [BLOB[:100]])
    rig = Rig(tmp_path)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [100])
        rig.part(90, 120)  # the first ten are known
        rig.part(120, 200)
        await rig.until(lambda: rig.told[-1] == 200)
        rig.part(200, 256)
        assert await task
    assert rig.partial.path.read_bytes() == BLOB


async def test_after_a_hole_the_robot_is_sent_back_once(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        rig.part(32, 64)
        await rig.until(lambda: rig.told == [0, 0])
        rig.part(64, 96)  # was under way
        rig.part(96, 128)
        rig.part(0, 32)
        await rig.until(lambda: rig.told == [0, 0, 32])
        rig.part(64, 96)  # a new hole, behind something good
        rig.part(32, 64)
        await rig.until(lambda: rig.told == [0, 0, 32, 64, 64] or rig.told == [0, 0, 32, 32, 64])
        for start in (64, 128, 192):
            rig.part(start, start + 64)
            await rig.until(lambda start=start: start == 192 or rig.told[-1] == start + 64)
        assert await task


async def test_more_than_the_window_is_dropped_and_sent_again(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        rig.gate.clear()
        rig.part(0, 64)
        rig.part(64, 128)
        rig.part(128, 192)  # over twice the window
        assert rig.budget.left == 10_000 - 128
        rig.gate.set()
        await rig.until(lambda: rig.told == [0, 128, 128])
        rig.part(128, 256)
        assert await task
    assert rig.partial.path.read_bytes() == BLOB


async def test_all_transfers_together_hold_so_much(tmp_path: Path) -> None:
    rig = Rig(tmp_path, budget=50)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        rig.part(0, 64)
        assert rig.budget.left == 50
        await rig.until(lambda: rig.told == [0, 0])
        for start in range(0, 256, 32):
            rig.part(start, start + 32)
            await rig.until(lambda start=start: start == 224 or rig.told[-1] == start + 32)
        assert await task


async def test_a_full_disk_is_tried_again(tmp_path: Path) -> None:
    rig = Rig(tmp_path, reserve_bytes=1 << 62)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        rig.part(0, 64)
        await rig.until(lambda: rig.told == [0, 0])
        assert "full" in rig.said[0]
        assert not rig.partial.path.exists()
        rig.transfer.partial = PartialFile(rig.partial.path, reserve_bytes=0)
        for start in (0, 128):
            rig.part(start, start + 128)
            await rig.until(lambda: rig.told[-1] == 128)
        assert await task
    assert rig.budget.left == 10_000


async def test_a_wrong_checksum_begins_again_and_ends(tmp_path: Path) -> None:
    rig = Rig(tmp_path, sha256="00" * 32)
    async with rig.running() as task:
        for tries in (1, 2, 3):
            await rig.until(lambda tries=tries: rig.told.count(0) == tries)
            rig.part(0, 128)
            await rig.until(lambda: rig.told[-1] == 128)
            rig.part(128, 256)
        assert not await task
    assert not rig.transfer.cancelled


async def test_a_new_session_starts_at_what_is_on_the_disk(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    async with rig.running():
        await rig.until(lambda: rig.told == [0])
        rig.part(0, 32)
        await rig.until(lambda: rig.told == [0, 32])
        rig.transfer.pause()
        rig.part(32, 64)  # the last of the old session
        await rig.until(lambda: rig.transfer.offset == 64)
        assert rig.told == [0, 32]
        rig.transfer.offered()
        await rig.until(lambda: rig.told == [0, 32, 64])


async def test_stopped_in_the_middle(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    async with rig.running() as task:
        await rig.until(lambda: rig.told == [0])
        rig.transfer.stop()
        assert not await task
    assert rig.transfer.cancelled


def test_a_failed_write_adds_nothing(tmp_path: Path) -> None:
    partial = PartialFiles(tmp_path, reserve_bytes=0).file(RID, sha256=SHA, size_bytes=256)
    assert partial.append(0, [b"abc", b"def"]) == 6
    with pytest.raises(StoreError, match="full"):
        PartialFile(partial.path, reserve_bytes=1 << 62).append(6, [b"x"])
    assert partial.size() == 6
    partial.path.unlink()
    partial.path.mkdir()
    with pytest.raises(StoreError, match="disk failed"):
        partial.append(0, [b"x"])


def test_no_byte_is_taken_of_what_is_kept_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    partial = PartialFiles(tmp_path, reserve_bytes=100).file(RID, sha256=SHA, size_bytes=256)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=106 - partial.size()))
    assert partial.append(0, [b"abc"]) == 3
    with pytest.raises(StoreError, match="full"):
        partial.append(3, [b"de", b"fg"])
    assert partial.append(3, [b"de", b"f"]) == 6


def test_another_content_is_another_file(tmp_path: Path) -> None:
    incoming = PartialFiles(tmp_path, reserve_bytes=0)
    one = incoming.file(RID, sha256="11" * 32, size_bytes=10)
    one.append(0, [b"12345"])
    assert incoming.file(RID, sha256="22" * 32, size_bytes=10).size() == 0
    assert incoming.file(RID, sha256="11" * 32, size_bytes=10).size() == 5
    assert incoming.file(RID, sha256="11" * 32, size_bytes=4).size() == 0  # it was never that
    one.append(0, [b"1"])
    assert incoming.ids() == {RID}
    incoming.discard(RID)
    assert incoming.ids() == set()
