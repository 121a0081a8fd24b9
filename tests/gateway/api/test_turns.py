"""Turns of strangers: nobody waits while few come, and whoever floods waits behind their own requests."""

from __future__ import annotations

import asyncio

import pytest

from gateway.api.turns import Turns
from gateway.errors import TooManyRequestsError

QUICK = 1000.0


def turns(free: int, *, per_s: float = QUICK, most_each: int = 8, most: int = 100) -> Turns:
    """`free` at once, then one after the other."""
    left = iter(range(free))
    return Turns(lambda: next(left, None) is not None, per_s=per_s, most_each=most_each, most=most)


async def arrive(line: Turns, address: str, order: list[str]) -> asyncio.Task[None]:
    """A request that has come, and waits."""

    async def one() -> None:
        await line.wait(address)
        order.append(address)

    task = asyncio.create_task(one())
    await asyncio.sleep(0)
    return task


async def test_few_do_not_wait_and_without_a_rate_nobody_does() -> None:
    line, order = turns(2), []
    for address in ("a", "b"):
        assert (await arrive(line, address, order)).done()
    assert not (await arrive(line, "c", order)).done()
    free = turns(0, per_s=0.0)
    for _ in range(100):
        await free.wait("a")


async def test_addresses_take_turns_whoever_came_first() -> None:
    line, order = turns(0), []
    tasks = [await arrive(line, "flood", order) for _ in range(5)]
    tasks += [await arrive(line, "other", order), await arrive(line, "honest", order)]
    await asyncio.gather(*tasks)
    assert order[:3] == ["flood", "other", "honest"]
    assert order[3:] == ["flood"] * 4


async def test_who_goes_away_costs_nobody_a_turn_and_too_many_are_refused() -> None:
    line, order = turns(0, most_each=2, most=4), []
    gone, stays = await arrive(line, "a", order), await arrive(line, "a", order)
    with pytest.raises(TooManyRequestsError) as refused:
        await line.wait("a")
    assert refused.value.retry_after_s >= 1 / QUICK
    others = [await arrive(line, address, order) for address in ("b", "c")]
    with pytest.raises(TooManyRequestsError):
        await line.wait("d")
    gone.cancel()
    await asyncio.gather(stays, *others)
    assert sorted(order) == ["a", "b", "c"]
    assert not (await arrive(line, "d", order)).done()  # one after the other goes on, and ends, again
    await asyncio.wait_for(asyncio.shield(asyncio.create_task(line.wait("e"))), 60)
