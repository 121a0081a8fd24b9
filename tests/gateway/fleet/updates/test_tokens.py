"""Robots' tokens: good at every gateway of the store for a day, and no longer than the identity."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

from gateway.fleet.updates.tokens import FetchTokens
from gateway.store import Store
from gateway.store.retention import Retention
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.servers.postgres import PostgresServer

NOW_NS = 1_800_000_000 * 10**9


@asynccontextmanager
async def tokens(
    folder: Path, url: str, clock: ManualClock, identities: Mapping[str, int | None]
) -> AsyncIterator[FetchTokens]:
    retention = Retention(age_s=100.0, size_bytes=1 << 30)
    store = Store(folder, clock=clock, retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    try:
        made = FetchTokens(store, clock=clock, enrolled_ns=lambda robot: identities.get(robot, 0))
        assert made.make("r1") == ""  # before it knows the store's secret
        await made.load()
        yield made
    finally:
        await store.close()


async def test_a_token_at_two_gateways(tmp_path: Path, postgres: PostgresServer) -> None:
    url, clock, identities = postgres.schema(), ManualClock(wall_ns=NOW_NS), dict[str, int | None]()
    async with (
        tokens(tmp_path / "a", url, clock, identities) as first,
        tokens(tmp_path / "b", url, clock, identities) as second,
    ):
        text = first.make("r1.lab")
        for authenticator in (first, second):
            found = await authenticator.by_key(text)
            assert found is not None
            assert (found.kind, found.id, found.robots) == ("robot", "r1.lab", ("r1.lab",))
            assert await authenticator.by_session(text) is None
        clock.advance(LIMITS.fetch_token_s - 1)
        assert await second.by_key(text) is not None
        clock.advance(1)
        assert await second.by_key(text) is None
        fresh = second.make("r1.lab")
        assert await first.by_key(fresh) is not None
        identities["r1.lab"] = NOW_NS  # it was enrolled: whoever had its name before is another
        assert await first.by_key(fresh) is None
        enrolled = first.make("r1.lab")
        assert await second.by_key(enrolled) is not None
        identities["r1.lab"] = None  # revoked
        assert (await first.by_key(enrolled), first.make("r1.lab")) == (None, "")
        identities["r1.lab"] = NOW_NS + 1  # and enrolled again: what was taken from it then opens nothing now
        assert await first.by_key(enrolled) is None
        assert await second.by_key(first.make("r1.lab")) is not None


async def test_a_token_ends_with_its_day(tmp_path: Path) -> None:
    clock = ManualClock(wall_ns=NOW_NS)
    async with tokens(tmp_path, "", clock, {}) as authenticator:
        text = authenticator.make("r1")
        clock.advance(LIMITS.fetch_token_s - 1)
        assert await authenticator.by_key(text) is not None
        clock.advance(1)
        assert await authenticator.by_key(text) is None


async def test_another_store_has_another_secret(tmp_path: Path) -> None:
    clock = ManualClock(wall_ns=NOW_NS)
    async with tokens(tmp_path / "a", "", clock, {}) as first, tokens(tmp_path / "b", "", clock, {}) as second:
        assert await first.by_key(first.make("r1")) is not None
        assert await second.by_key(first.make("r1")) is None
