"""One agent of a host publishes its metrics, and the next takes over."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from edge_agent.forwarding.host_metrics_election import election_lock, hold_leadership
from tests.support.waiting import wait_until_async

HOLD = """
import sys
from metaros.concurrency.file_lock import take_lock
file = open(sys.argv[1], "a")
print(take_lock(file.fileno()), flush=True)
input()
"""


async def test_the_next_has_it_when_the_first_ends(tmp_path: Path) -> None:
    path, turns = tmp_path / "host.turn", []
    leave = asyncio.Event()

    async def first() -> None:
        async with hold_leadership(path, retry_s=0.01):
            turns.append("first")
            await leave.wait()

    async def second() -> None:
        async with hold_leadership(path, retry_s=0.01):
            turns.append("second")

    async with asyncio.TaskGroup() as group:
        group.create_task(first())
        await wait_until_async(lambda: turns == ["first"])
        waiting = group.create_task(second())
        await asyncio.sleep(0)
        assert not waiting.done()
        leave.set()
    assert turns == ["first", "second"]


async def test_a_killed_process_gives_it_up(tmp_path: Path) -> None:
    path = tmp_path / "host.turn"
    pipe = asyncio.subprocess.PIPE
    holder = await asyncio.create_subprocess_exec(sys.executable, "-c", HOLD, path, stdin=pipe, stdout=pipe)
    try:
        assert holder.stdout is not None
        assert await holder.stdout.readline() == b"True\n"
    finally:
        holder.kill()
        await holder.communicate()
    async with asyncio.timeout(60), hold_leadership(path, retry_s=0.01):
        pass


def test_each_graph_and_namespace_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path))
    names = {
        election_lock(zenoh_port=port, domain=domain, namespace=namespace).name
        for port in (7447, 7448)
        for domain in (0, 1)
        for namespace in ("/", "/sim_1", "/sim_1/arm")
    }
    assert len(names) == 12
    assert "host-7447-0.turn" in names
