"""Three replicas of the gateway on one PostgreSQL: each may be killed under load, or ended, one after the other."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Sequence
from pathlib import Path

import httpx
import pytest

from tests.support.gateways.replica_schedules import alerts, fired, schedule, wait_for_all
from tests.support.gateways.replicas import Fleet, Replica, Replicas, fleet
from tests.support.processes.stack import Stack
from tests.support.robots.uplinks import wait
from tests.support.servers.postgres import PostgresServer

TIMES = 4  # at which a schedule fires
EVERY_S = 3
PAUSE_S = 0.1  # between two batches of a robot's: always some are under way, and how many at most is the campaign's


async def check_samples(run: Fleet) -> None:
    """Each accepted sample is stored, once."""
    for robot in run.robots:
        found = await run.replicas.stored(robot.name)
        assert len(found) == len(set(found)), "nothing is stored twice"
        assert set(found) == set(robot.sent), "nothing is lost"


@pytest.mark.integration
@pytest.mark.timeout(600)
async def test_replicas_are_killed_under_load_and_restarted_one_after_the_other(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    with Stack(tmp_path) as stack:
        replicas = Replicas(stack, postgres.schema(), options=("--drain-s", "5"))
        async with fleet(replicas, pause_s=PAUSE_S) as run:
            names = await schedule(replicas.all[0], times=TIMES, every_s=EVERY_S)
            for killed in replicas.all[:2]:
                await check_kill(run, killed)
            sent = await check_restarts(run, replicas.all[1:])
            other = replicas.all[0]
            await wait_for_all(other, names)
            await run.settle()
            await check_commands(run, sent)
            assert set((await fired(other)).values()) == {1}, "each schedule fired once"
            opened = await alerts(other)
            assert len(opened) == len(set(opened))
            assert len(opened) >= TIMES
            async with other.client() as http:
                reported = [
                    event["id"] for event in (await http.get("/api/v1/events?after=0&limit=1000")).json()["events"]
                ]
            await wait(lambda: set(reported) <= set(run.watcher.events))
            received = run.watcher.events
            assert len(received) == len(set(received)), "a viewer's events go on where they ended, at another replica"
            moved = [seconds for robot in run.robots for seconds in robot.back_s]
            print(f"links back after {max(moved):.2f} s at most, of {len(moved)}")
        await check_samples(run)


async def check_kill(run: Fleet, killed: Replica) -> None:
    """Its robots are soon at another one, and a viewer sees them all there."""
    await wait(lambda: all(run.watcher.seen[run.watcher.at.name, robot.name] for robot in run.robots))
    had = await run.kill(killed)
    assert had, "it had robots to lose"
    await run.back(had)
    run.watcher.seen.clear()
    await wait(lambda: all(run.watcher.seen[run.watcher.at.name, robot.name] for robot in run.robots))
    await run.replicas.begin(killed)


async def check_restarts(run: Fleet, ended: Sequence[Replica]) -> dict[str, str]:
    """Each ends in good order and comes back, while robots are given commands, which are returned by their keys."""
    sent: dict[str, str] = {}
    orders = asyncio.create_task(order(run, sent))
    try:
        for replica in ended:
            before = len(sent)
            await wait(lambda before=before: len(sent) > before + 10)
            had = run.homed(replica)
            assert await run.replicas.end(replica) == 0
            await run.back(had)
            await run.replicas.begin(replica)
        before = len(sent)
        await wait(lambda: len(sent) > before + 10)
    finally:
        orders.cancel()
        await asyncio.gather(orders, return_exceptions=True)
    return sent


async def check_commands(run: Fleet, sent: dict[str, str]) -> None:
    """Each was carried out, once."""
    async with run.replicas.all[0].client() as http:
        for command_id in sent.values():
            await done(http, command_id)
    arrived = [command for robot in run.robots for command in robot.commands]
    assert len(arrived) == len(set(arrived)) >= len(sent)


async def order(run: Fleet, sent: dict[str, str]) -> None:
    """Give robots commands through whichever replica answers, until cancelled."""
    body = {"kind": "publish", "durable": True, "expires_s": 600}
    body["request"] = {"topic": "/word", "type": "std_msgs/msg/String", "message": {"data": "x"}}
    number = 0
    while True:
        robot, key = run.robots[number % len(run.robots)], secrets.token_hex(8)
        while key not in sent:
            for replica in run.replicas.others():
                try:
                    async with replica.client() as http:
                        path = f"/api/v1/robots/{robot.name}/commands"
                        answer = await http.post(path, json=body, headers={"Idempotency-Key": key})
                except (httpx.HTTPError, OSError):
                    continue
                if answer.status_code in (200, 201, 202):
                    sent[key] = str(answer.json()["id"])
                    break
                assert answer.status_code in (401, 503), answer.text  # it ends, or has just begun
            await asyncio.sleep(0.05)
        number += 1


async def done(http: httpx.AsyncClient, command_id: str) -> None:
    """Until the command was carried out."""
    async with asyncio.timeout(60):
        while True:
            command = (await http.get(f"/api/v1/commands/{command_id}")).json()
            if command["state"] == "done":
                return
            assert command["state"] in ("issued", "delivered", "running"), command
            await asyncio.sleep(0.1)
