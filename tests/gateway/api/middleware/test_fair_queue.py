"""FairQueue of strangers: nobody waits while few come, and whoever floods waits behind their own requests."""

from __future__ import annotations

import asyncio

import pytest

from gateway.api.middleware.fair_queue import FairQueue
from gateway.errors import TooManyRequestsError
from metaros.clock import ManualClock

PER_S = 0.5


@pytest.fixture(autouse=True)
async def clock(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    """The loop's own: nobody is let in until a test says that time has passed."""
    made = ManualClock()
    monkeypatch.setattr(asyncio.get_running_loop(), "time", made.monotonic_s)
    return made


def fair_queue(free: int, *, per_s: float = PER_S, most_each: int = 8, most: int = 100) -> FairQueue:
    """`free` at once, then one after the other."""
    left = iter(range(free))
    return FairQueue(lambda: next(left, None) is not None, per_s=per_s, most_each=most_each, most=most)


async def arrive(line: FairQueue, address: str, order: list[str]) -> asyncio.Task[None]:
    """A request that has come, and waits."""

    async def one() -> None:
        await line.wait(address)
        order.append(address)

    task = asyncio.create_task(one())
    await asyncio.sleep(0)
    return task


async def let_in(clock: ManualClock, count: int) -> None:
    """So many turns pass."""
    for _ in range(count):
        clock.advance(1 / PER_S)
        for _ in range(3):  # the timer, its future, who waits for that
            await asyncio.sleep(0)


async def test_few_do_not_wait_and_without_a_rate_nobody_does() -> None:
    line, order = fair_queue(2), []
    for address in ("a", "b"):
        assert (await arrive(line, address, order)).done()
    assert not (await arrive(line, "c", order)).done()
    free = fair_queue(0, per_s=0.0)
    for _ in range(100):
        await free.wait("a")


async def test_addresses_take_turns_whoever_came_first(clock: ManualClock) -> None:
    line, order = fair_queue(0), []
    for address in (*["flood"] * 5, "other", "honest"):
        await arrive(line, address, order)
    await let_in(clock, 3)
    assert order == ["flood", "other", "honest"]
    await let_in(clock, 4)
    assert order[3:] == ["flood"] * 4


async def test_who_goes_away_costs_nobody_a_turn_and_too_many_are_refused(clock: ManualClock) -> None:
    line, order = fair_queue(0, most_each=2, most=4), []
    gone = await arrive(line, "a", order)
    await arrive(line, "a", order)
    with pytest.raises(TooManyRequestsError) as refused:
        await line.wait("a")
    assert refused.value.retry_after_s >= 1 / PER_S
    for address in ("b", "c"):
        await arrive(line, address, order)
    with pytest.raises(TooManyRequestsError):
        await line.wait("d")
    gone.cancel()
    await let_in(clock, 3)
    assert order == ["b", "c", "a"]
    assert not (await arrive(line, "d", order)).done()  # one after the other goes on, and ends, again
    last = await arrive(line, "e", order)
    await let_in(clock, 2)
    assert last.done()
