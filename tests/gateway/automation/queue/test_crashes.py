"""Nothing that was accepted is lost, however often the gateways die; only what was under way is delivered twice."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections import Counter

from gateway.domain.automation.delivery import DeadFilter, Delivery, Done, Policy, Result, Retry, Share
from tests.gateway.automation.queue.world import Reported, World, one

LIVES = 9
EACH = 36  # accepted in one life
SEED = 1  # load_tests/campaigns/functions.py draws others


async def test_random_deaths_lose_nothing(any_world: World) -> None:
    world, rng = any_world, random.Random(SEED)
    ends: Counter[str] = Counter()
    accepted: list[str] = []
    outstanding = 0  # what was under way at a death: the most that may be delivered twice

    async def act(delivery: Delivery) -> Result:
        for _ in range(rng.randrange(4)):
            await asyncio.sleep(0)
        if rng.random() < 0.1:
            return Retry("away", after_s=rng.uniform(0.0, 5.0), counts=False)
        ends[delivery.id] += 1
        return Done()

    names = "ab" if world.shared else "a"
    policy = Policy(most_attempts=100)
    for life in range(LIVES):
        reported = Reported(act=act, at_once=20)
        manager = await world.manager(reported, name=names[life % len(names)], seed=rng.getrandbits(32))
        for _ in range(6):
            number = EACH // 6
            accepted += await manager.accept([one(str(rng.randrange(7)), policy=policy) for _ in range(number)])
            await manager.dispatcher.scan()
            await manager.dispatcher.expire()
            await manager.dispatcher.step()
            for _ in range(rng.randrange(60)):
                await asyncio.sleep(0)
            world.clock.advance(rng.uniform(0.0, 3.0))
        outstanding += len(manager.dispatcher.in_flight)
        await world.crash(manager)

    last = await world.manager(Reported(act=act), name="a", seed=SEED)
    for _ in range(12):
        await world.drive(last)
        world.clock.advance(10.0)
    assert set(ends) == set(accepted)
    assert len(accepted) == LIVES * EACH
    assert sum(ends.values()) - len(accepted) <= outstanding
    assert outstanding > 0
    assert await last.dead_page(DeadFilter(), limit=9) == []
    assert await world.counted() == {}
    assert (await world.totals()).live == Share()
