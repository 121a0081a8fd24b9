"""Searches for robots: remembered for whoever may see the same, never for longer than they are right."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.api import robot_search as module
from gateway.api.robot_search import RobotQuery, RobotSearch
from gateway.domain.fleet.selector import Selector
from gateway.domain.robot import Robot
from gateway.ingest.registry import Registry, RobotRecord

BERLIN = RobotQuery(selector=Selector.parse("site=berlin"))


class Fleet:
    """Robots a, b and c in Berlin, d nowhere; and how many were looked at."""

    def __init__(self) -> None:
        self.registry = Registry()
        for name in ("a", "b", "c", "d"):
            said = {"site": "berlin"} if name != "d" else {}
            self.registry.add(RobotRecord(Robot(name, labels=said), seen_ns=1))
        self.given: dict[str, dict[str, str]] = {}
        self.changes = 0
        self.looked = 0
        self.search = RobotSearch(self.registry, self._labels, lambda: self.changes)

    def _labels(self, robot: str) -> dict[str, str]:
        self.looked += 1
        return {**self.registry.get(robot).robot.labels, **self.given.get(robot, {})}

    def give(self, robot: str, **labels: str) -> None:
        """People label a robot."""
        self.given[robot], self.changes = labels, self.changes + 1

    async def ids(self, query: RobotQuery = BERLIN, after: str = "", most: int = 9) -> str:
        """Of the robots found."""
        return "".join([record.robot.id for record in await self.search.behind(query, after, most)])


async def test_who_asks_again_is_not_searched_for_again() -> None:
    fleet = Fleet()
    assert [await fleet.ids() for _ in range(3)] == ["abc"] * 3
    assert fleet.looked == 4
    assert (await fleet.ids(after="a"), await fleet.ids(most=1)) == ("bc", "a")


async def test_other_labels_are_another_search() -> None:
    fleet = Fleet()
    assert await fleet.ids() == "abc"
    fleet.give("a", site="paris")
    assert await fleet.ids() == "bc"
    record = fleet.registry.get("d")
    record.begin(Robot("d", labels={"site": "berlin"}), session_id=b"1", session_number=1)
    assert await fleet.ids() == "bcd"
    fleet.registry.add(RobotRecord(Robot("e", labels={"site": "berlin"}), seen_ns=1))
    assert await fleet.ids() == "bcde"
    looked = fleet.looked
    record.begin(Robot("d", labels={"site": "berlin"}), session_id=b"2", session_number=2)  # it says what it said
    assert (await fleet.ids(), fleet.looked) == ("bcde", looked)


async def test_a_host_that_has_another_name_is_found_by_it() -> None:
    fleet, named = Fleet(), RobotQuery(text="cart")
    assert await fleet.ids(named) == ""
    fleet.registry.get("b").begin(Robot("b", hostname="Cart-7"), session_id=b"1", session_number=1)
    assert await fleet.ids(named) == "b"


async def test_who_is_online_is_looked_at_each_time() -> None:
    fleet, living = Fleet(), RobotQuery(online=True, selector=BERLIN.selector)
    assert await fleet.ids(living) == ""
    fleet.registry.get("b").set_online(True, wall_ns=2)
    assert await fleet.ids(living) == "b"
    fleet.registry.get("b").set_online(False, wall_ns=3)
    assert await fleet.ids(living) == ""


@pytest.mark.parametrize("online", [None, False])
async def test_what_one_scope_found_no_other_is_shown(online: bool | None) -> None:
    fleet = Fleet()

    async def seen(*scope: str, **query: Any) -> str:
        return await fleet.ids(RobotQuery(scope=scope, online=online, **query))

    for _ in range(2):
        for query in ({}, {"selector": BERLIN.selector}, {"text": "berlin"}):
            whole = "abcd" if not query else "abc"
            assert await seen("*", **query) == whole
            assert await seen("a", "b*", **query) == "ab"
            assert await seen("c", **query) == "c"
            assert await seen(**query) == ""


async def test_a_change_during_a_search_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LOOKED_AT_ONCE", 2)
    fleet = Fleet()
    searching = asyncio.create_task(fleet.ids())
    await asyncio.sleep(0)
    assert fleet.looked == 2  # a and b; it lets others do something
    fleet.give("a", site="paris")
    assert await fleet.ids(RobotQuery(text="paris")) == "a"
    await searching
    assert await fleet.ids() == "bc"


async def test_only_so_many_are_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "REMEMBERED", 2 * (3 + module.PAGE))
    fleet = Fleet()
    for most in (9, 8, 9, 7, 9):  # 8 was asked for the longest ago
        await fleet.ids(most=most)
    assert fleet.looked == 3 * 4
    await fleet.ids(most=8)
    assert fleet.looked == 4 * 4


async def test_a_search_looks_at_every_robot() -> None:
    fleet = Fleet()
    for number in range(1200):
        robot = Robot(f"n{number:04}", hostname="x" if number % 600 else "Needle")
        fleet.registry.add(RobotRecord(robot, seen_ns=1))
    query = RobotQuery(text="needle", selector=Selector.parse(""), scope=("n0001", "n06*"))
    assert await fleet.ids(query) == "n0600"
