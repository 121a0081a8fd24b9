"""A hundred edits at two gateways at once, while robots move between them: every robot ends at what is desired."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

import orjson
import pytest

from tests.gateway.fleet.twin_model import Model
from tests.gateway.fleet.twin_rig import rig_on
from tests.gateway.fleet.twin_robot import ModelFleet
from tests.support.servers.postgres import PostgresServer

ROBOTS = {"a1": "lab", "a2": "lab", "b1": "hall", "b2": "hall"}


@pytest.mark.integration
async def test_a_hundred_edits_at_two_gateways_while_robots_move(tmp_path: Path, postgres: PostgresServer) -> None:
    url, fleet, model = postgres.schema(), ModelFleet(), Model(ROBOTS)
    async with AsyncExitStack() as stack:
        rigs = [await stack.enter_async_context(rig_on(url, tmp_path / str(n), fleet)) for n in range(2)]
        home = dict.fromkeys(ROBOTS, 0)
        for name, site in ROBOTS.items():
            await rigs[0].robot(name, site=site)
        names = sorted(ROBOTS)
        for turn in range(4):
            async with asyncio.TaskGroup() as group:
                for number in range(30):
                    step = ("patch" if number % 3 else "patch if unchanged", names[(number * 7 + turn) % 4])
                    group.create_task(model.edit(rigs[number % 2].twins, step))
            name = names[turn % 4]
            robot = fleet.robots[name]
            rigs[home[name]].read(robot, turn % 3)
            rigs[home[name]].cut(name)
            home[name] = 1 - home[name]
            rigs[home[name]].link(name)
        assert model.edits == 120

        def done() -> bool:
            for name, at in home.items():
                rigs[at].read(fleet.robots[name])
            robots = fleet.robots.items()
            return all((r.state, r.document) == ("applied", model.document(n)) for n, r in robots)

        async with asyncio.timeout(60):
            while not done():  # noqa: ASYNC110  (robots read in it)
                await asyncio.sleep(0.02)
    for robot in fleet.robots.values():  # the same revision over two links perhaps, never an older one after a newer
        assert robot.seen == sorted(robot.seen), robot
    total = sum(
        len(rows) for robot in fleet.robots.values() for rows in orjson.loads(robot.document)["parameters"].values()
    )
    assert total >= 72  # those of every edit that was accepted
