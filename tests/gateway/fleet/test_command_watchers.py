"""Many who wait for commands cost one look at the store together, and none of them misses a change."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import cast

from gateway.fleet.command_rows import CommandRows
from gateway.fleet.command_watchers import CommandWatchers


@dataclass
class Rows:
    """The states that another gateway writes, and how often one asked for them."""

    now: dict[str, str] = field(default_factory=dict)
    looks: int = 0

    async def states(self, command_ids: list[str]) -> dict[str, str]:
        self.looks += 1
        return {name: self.now[name] for name in command_ids if name in self.now}


async def follow(watchers: CommandWatchers, rows: Rows, name: str, seen: list[str], *, last: str) -> None:
    """As CommandManager.watch: look, then wait for the next change."""
    with watchers.watching(name) as watched:
        while True:
            event, state = watched.event, rows.now.get(name, "gone")
            watched.saw(state)
            seen.append(state)
            if state == last:
                return
            await event.wait()


async def test_a_thousand_cost_one_look_and_all_hear_of_it() -> None:
    rows = Rows({f"c{number}": "issued" for number in range(10)})
    watchers = CommandWatchers(cast(CommandRows, rows))
    await watchers.look()
    assert rows.looks == 0, "nobody waits"
    seen: list[list[str]] = [[] for _ in range(1000)]
    tasks = [
        asyncio.create_task(follow(watchers, rows, f"c{number % 10}", mine, last="done"))
        for number, mine in enumerate(seen)
    ]
    await asyncio.sleep(0)
    for _ in range(3):
        await watchers.look()
        await asyncio.sleep(0)
    assert (rows.looks, {len(mine) for mine in seen}) == (3, {1}), "nothing changed: nobody looks"
    rows.now = dict.fromkeys(rows.now, "done")
    await watchers.look()
    await asyncio.gather(*tasks)
    assert rows.looks == 4
    assert {mine[-1] for mine in seen} == {"done"}
    await watchers.look()
    assert rows.looks == 4, "nobody waits any more"


async def test_who_comes_later_wakes_who_has_waited() -> None:
    """The one who comes sees the new state before the next look does, which then finds nothing new."""
    rows = Rows({"c": "issued"})
    watchers = CommandWatchers(cast(CommandRows, rows))
    first: list[str] = []
    waiting = asyncio.create_task(follow(watchers, rows, "c", first, last="done"))
    await asyncio.sleep(0)
    rows.now["c"] = "done"
    await follow(watchers, rows, "c", [], last="done")
    await asyncio.wait_for(waiting, 60)
    assert first == ["issued", "done"]


async def test_a_command_that_was_deleted_wakes_who_waits() -> None:
    rows = Rows({"c": "issued"})
    watchers = CommandWatchers(cast(CommandRows, rows))
    seen: list[str] = []
    waiting = asyncio.create_task(follow(watchers, rows, "c", seen, last="gone"))
    await asyncio.sleep(0)
    del rows.now["c"]
    await watchers.look()
    await asyncio.wait_for(waiting, 60)
    assert seen == ["issued", "gone"]
