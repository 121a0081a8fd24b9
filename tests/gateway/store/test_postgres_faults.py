"""PostgreSQL killed, restarted, frozen and full under load: what was acknowledged is there, and everything once."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.errors import StoreError
from gateway.store import Committed, Store
from gateway.store.commit import Committer
from gateway.store.postgres import PostgresEngine
from gateway.store.retention import Retention
from gateway.store.writer import Pace
from metaros.clock import SystemClock
from tests.gateway.store.samples import content, run_write
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async


@pytest.fixture(scope="module")
def victim(postgres_server: PostgresServer) -> Iterator[PostgresServer]:
    """A server of these tests' own, to be killed; `postgres_server` says whether there can be one."""
    server = PostgresServer()
    try:
        server.start()
        yield server
    finally:
        server.close()


class Robot:
    """Sends numbers in order, at most a window of them unacknowledged; what is refused it sends again."""

    def __init__(self, folder: Path, url: str, *, seed: int) -> None:
        self.store = Store(
            folder,
            clock=SystemClock(),
            retention=Retention(age_s=1e9, size_bytes=1 << 40),
            queue_bytes=1 << 24,
            url=url,
            pace=Pace(commit_every_s=0.002, retry_every_s=0.02),
        )
        self.acked = 0
        self.next = 1
        self.refusals = 0
        self._rng = random.Random(seed)
        self._refused = False

    def start(self) -> None:
        self.store.start(self._on_commit, self._on_refused)

    def _on_commit(self, done: Committed) -> None:
        for mark in done.marks:
            assert mark.seq < self.next, "more is stored than was ever sent"
            assert mark.seq >= self.acked, "what was acknowledged is gone"
            self.acked = mark.seq

    def _on_refused(self, _robots: object) -> None:
        self.refusals += 1
        self._refused = True

    async def run(self, stop: asyncio.Event) -> None:
        """Send until told to stop."""
        while not stop.is_set():
            if self._refused:
                self._refused = False
                await asyncio.sleep(0.01)
                resend = self.acked + 1
                while resend < self.next:
                    resend = self._send(resend)
            if self.next - self.acked < 400:
                self.next = self._send(self.next)
            await asyncio.sleep(0.001)

    def _send(self, first: int) -> int:
        count = self._rng.randrange(1, 6)
        self.next = max(self.next, first + count)
        self.store.submit(run_write(first, [payload(seq) for seq in range(first, first + count)]))
        return first + count

    async def finish(self) -> None:
        """All that was ever sent is acknowledged."""
        for _ in range(200):
            first = self.acked + 1
            if first == self.next and self.store.error is None:
                return
            if first < self.next:
                self.store.submit(run_write(first, [payload(seq) for seq in range(first, self.next)]))
            await asyncio.sleep(0.1)
        raise AssertionError(f"acknowledged {self.acked} of {self.next - 1}: {self.store.error}")


def payload(seq: int) -> bytes:
    """What the sample of a number holds."""
    return b"%d " % seq * 50


async def ordeal(server: PostgresServer, folder: Path, *, cycles: int, seed: int) -> Robot:
    """Kill the server again and again at random moments under load; then everything must be there, once."""
    rng = random.Random(seed)
    url = server.schema()
    robot = Robot(folder, url, seed=seed)
    robot.start()
    stop = asyncio.Event()
    running = asyncio.create_task(robot.run(stop))
    try:
        for cycle in range(cycles):
            before = robot.acked
            await wait_until_async(lambda before=before: robot.acked > before or running.done(), timeout_s=60)
            await asyncio.sleep(rng.random() * 0.05)
            (server.kill if cycle % 4 else server.stop)()
            await asyncio.sleep(rng.random() * 0.1)
            await asyncio.to_thread(server.start)
        stop.set()
        await running
        await robot.finish()
    finally:
        running.cancel()
        await robot.store.close()
    assert await asyncio.to_thread(held, url) == {seq: payload(seq) for seq in range(1, robot.next)}, f"seed {seed}"
    return robot


async def test_killed_at_random_moments(tmp_path: Path, victim: PostgresServer) -> None:
    """Five crashes and two shutdowns; load_tests/campaigns/postgres.py has them by the hundred."""
    robot = await ordeal(victim, tmp_path, cycles=7, seed=2)
    assert robot.refusals > 0


async def test_a_commit_of_unknown_outcome_is_repeated(postgres: PostgresServer) -> None:
    """The connection breaks after the COMMIT left and before its answer came: it may be either."""
    url = postgres.schema()
    outcomes = []
    for number in range(1, 7):

        def job(number: int = number) -> bool:
            engine = BreakingEngine(url, breaks="after" if number % 2 else "before")
            engine.open()
            committer = Committer(engine)
            with pytest.raises(StoreError):
                committer.commit([run_write(number, [payload(number)])], now_ns=1)
            happened = number in content(engine)[0]
            marks = committer.commit([run_write(number, [payload(number)])], now_ns=2).marks
            assert [mark.seq for mark in marks] == [number]
            engine.close()
            return happened

        outcomes.append(await asyncio.to_thread(job))
    assert outcomes == [True, False] * 3


class BreakingEngine(PostgresEngine):
    """The connection breaks around a COMMIT."""

    def __init__(self, url: str, *, breaks: str) -> None:
        super().__init__(url)
        self.breaks = ""
        self._later = breaks

    def open(self) -> str:
        opened = super().open()
        self.breaks = self._later
        return opened

    def _statements(self, text: str) -> str:
        if text != "COMMIT" or not self.breaks:
            return super()._statements(text)
        breaks, self.breaks = self.breaks, ""
        if breaks == "after":
            super()._statements(text)
        raise OSError("the connection broke")


async def test_frozen_is_refused_in_time(
    tmp_path: Path, victim: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.store.postgres.STATEMENT_S", 0.5)
    monkeypatch.setattr("gateway.store.postgres.CONNECT_S", 0.5)
    robot = Robot(tmp_path, victim.schema(), seed=3)
    robot.start()
    stop = asyncio.Event()
    running = asyncio.create_task(robot.run(stop))
    try:
        await wait_until_async(lambda: robot.acked > 20, timeout_s=60)
        victim.freeze(True)
        await wait_until_async(lambda: robot.refusals, timeout_s=60)
        victim.freeze(False)
        stuck = robot.acked
        await wait_until_async(lambda: robot.acked > stuck + 20, timeout_s=60)
        stop.set()
        await running
        await robot.finish()
    finally:
        victim.freeze(False)
        running.cancel()
        await robot.store.close()


async def test_no_room_is_refused_and_then_goes_on(tmp_path: Path, postgres: PostgresServer) -> None:
    """As a full disk: the database takes nothing more for a while."""
    url = postgres.schema()
    robot = Robot(tmp_path, url, seed=4)
    robot.start()
    stop = asyncio.Event()
    running = asyncio.create_task(robot.run(stop))
    full = (
        "CREATE FUNCTION no_room() RETURNS trigger LANGUAGE plpgsql AS"
        " $$ BEGIN RAISE EXCEPTION 'No space left on device' USING ERRCODE = 'disk_full'; END $$"
    )
    try:
        await wait_until_async(lambda: robot.acked > 20, timeout_s=60)
        postgres.ask(full, url=url)
        postgres.ask("CREATE TRIGGER no_room BEFORE INSERT ON sample_batches EXECUTE FUNCTION no_room()", url=url)
        await wait_until_async(lambda: "No space left" in (robot.store.error or ""), timeout_s=60)
        postgres.ask("DROP TRIGGER no_room ON sample_batches", url=url)
        stuck = robot.acked
        await wait_until_async(lambda: robot.acked > stuck + 20, timeout_s=60)
        stop.set()
        await running
        await robot.finish()
    finally:
        running.cancel()
        await robot.store.close()
    assert robot.refusals > 0
    assert len(await asyncio.to_thread(held, url)) == robot.next - 1


def held(url: str) -> dict[int, bytes]:
    """The samples that the store has, each once, and no loss beside them."""
    engine = PostgresEngine(url)
    try:
        found, lost = content(engine)
        assert not lost
        return found
    finally:
        engine.close()


async def test_another_database_at_the_same_address_is_refused(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    robot = Robot(tmp_path, url, seed=5)
    robot.start()
    robot.store.submit(run_write(1, [b"1"]))
    robot.next = 2
    await wait_until_async(lambda: robot.acked == 1, timeout_s=60)
    postgres.ask("UPDATE meta SET value = 'other' WHERE key = 'store_id'", url=url)
    others = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = $1 AND pid <> pg_backend_pid()"
    postgres.ask(others, url.rpartition("/")[2])
    robot.store.submit(run_write(2, [b"2"]))
    robot.next = 3
    await wait_until_async(lambda: "is store other now" in (robot.store.error or ""), timeout_s=60)
    assert robot.refusals > 0
    await robot.store.close()
