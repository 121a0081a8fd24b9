"""Of three gateways on one store one sends notices, and when it dies one of the others does: each once."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

from metaros.clock import ManualClock
from tests.gateway.alerting.alerts.findings import NOW, cleared, opened
from tests.gateway.alerting.alerts.notices.test_service import hook, notices
from tests.gateway.alerting.alerts.world import World, open_world
from tests.support.servers.receivers import http_receiver


async def test_each_alert_is_reported_once_whoever_dies(tmp_path: Path, shared_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with http_receiver() as receiver, AsyncExitStack() as stack:
        worlds = {
            name: await stack.enter_async_context(open_world(tmp_path, url=shared_url, clock=clock, name=name))
            for name in ("g1", "g2", "g3")
        }
        senders = {
            name: await stack.enter_async_context(notices(world, hook(receiver))) for name, world in worlds.items()
        }

        async def step(judge: World) -> None:
            """Every gateway that lives has its turn, all at once."""
            clock.advance(2.5)
            await asyncio.gather(*(sender.take_leadership() for sender in senders.values()))
            judge.manager.tick()
            await judge.manager.save()
            await asyncio.gather(*(worlds[name].manager.refresh() for name in senders))
            await asyncio.gather(*(sender.send_due("ops") for sender in senders.values()))

        sent: list[str] = []
        for number in range(3):
            judge = worlds[list(senders)[-1]]  # the one that was started last
            await judge.report(opened(robot=f"r{number}"))
            for _ in range(8):
                await step(judge)
            sent.append("opened")
            assert receiver.types == sent
            await judge.report(cleared(robot=f"r{number}"))
            for _ in range(16):
                await step(judge)
            sent.append("resolved")
            assert receiver.types == sent
            if len(senders) > 1:  # whoever has its turn stands still for good
                turns = [name for name, sender in senders.items() if await sender.take_leadership()]
                assert len(turns) == 1
                del senders[turns[0]]
