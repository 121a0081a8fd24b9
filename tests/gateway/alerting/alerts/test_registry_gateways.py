"""Two books on one store: robots move between gateways, and both know the same alerts in the end."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections import Counter

import pytest

from gateway.alerting.alerts.registry import AlertRegistry
from gateway.domain.finding import SEVERITIES, Edge, Finding
from tests.gateway.alerting.alerts.findings import NOW, S, finding
from tests.gateway.alerting.alerts.test_registry_simulation import Table

ROBOTS = ("r1", "r2")
CAUSES = ("offline", "heat", "change")
SERIES = ("a", "b")


class World:
    """Each robot is judged by one gateway at a time, which tells its own book."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.now_ns = NOW
        self.table = Table()
        self.ids = 0
        self.registries = [AlertRegistry(gateway=f"g{number}", new_id=self.new_id) for number in range(2)]
        self.owner = dict.fromkeys(ROBOTS, 0)
        self.active: dict[tuple[str, str, str], Finding] = {}
        self.told: Counter[tuple[str, str]] = Counter()

    def new_id(self, now_ns: int) -> str:
        self.ids += 1
        return f"{self.ids:026}"

    def judge(self) -> None:
        robot, cause, series = self.rng.choice(ROBOTS), self.rng.choice(CAUSES), self.rng.choice(SERIES)
        found = finding(robot, cause, series, severity=self.rng.choice(SEVERITIES))
        change = self.rng.choice(("changed", "cleared")) if found.key in self.active else "opened"
        if change == "cleared":
            del self.active[found.key]
        else:
            self.active[found.key] = found
        self.registries[self.owner[robot]].apply([Edge(change, found, 0.0)], self.now_ns)

    def move(self) -> None:
        robot = self.rng.choice(ROBOTS)
        self.registries[self.owner[robot]].release(robot)
        self.owner[robot] = 1 - self.owner[robot]
        registry = self.registries[self.owner[robot]]
        registry.adopt(robot, self.now_ns)
        known = [item for item in self.active.values() if item.robot == robot]
        registry.apply([Edge("opened", item, 0.0) for item in known], self.now_ns)

    def settle(self) -> None:
        registry = self.rng.choice(self.registries)
        while changes := registry.changes(self.now_ns, most=2, all_of_it=True):
            for change in changes:
                if self.table.save(change.alert):
                    registry.stored(change)
                    self.told.update((change.alert.id, what) for what in change.news)
                else:
                    registry.clashed(change, self.table.there_is(change.alert), self.now_ns)

    def refresh(self) -> None:
        registry = self.rng.choice(self.registries)
        known = registry.revisions()
        live = {item.id: item for item in self.table.alerts.values() if item.unresolved or not item.clear_ns}
        for key in sorted(known.keys() | live.keys()):
            if key not in live or live[key].revision != known.get(key):
                registry.learn(self.table.alerts[key], self.now_ns)

    def pass_time(self) -> None:
        self.now_ns += self.rng.choice((S // 10, S, 10 * S, 200 * S))
        for registry in self.registries:
            registry.tick(self.now_ns)

    def check(self) -> None:
        """What always holds, in the store and in both books."""
        places = Counter((item.robot, item.cause) for item in self.table.alerts.values() if item.unresolved)
        assert max(places.values(), default=1) == 1
        for registry in self.registries:
            assert registry.unresolved == sum(item.unresolved for item in registry.all())
            for robot in ROBOTS:
                causes = [item.cause for item in registry.of(robot)]
                assert len(set(causes)) == len(causes)

    def end(self) -> None:
        """All findings end, and both gateways look and store for a while."""
        for found in list(self.active.values()):
            self.registries[self.owner[found.robot]].apply([Edge("cleared", found, 0.0)], self.now_ns)
        self.active.clear()
        for _ in range(150):
            self.now_ns += 2 * S
            for registry in self.registries:
                registry.tick(self.now_ns)
            self.refresh()
            self.settle()
        assert [item for item in self.table.alerts.values() if item.unresolved] == []
        assert [registry.unresolved for registry in self.registries] == [0, 0]


@pytest.mark.parametrize("seed", range(10))
def test_what_always_holds_of_two_gateways(seed: int) -> None:
    world = World(seed)
    steps = (world.judge, world.settle, world.refresh, world.move, world.pass_time)
    for _ in range(300):
        world.rng.choices(steps, weights=(40, 25, 25, 2, 12))[0]()
        world.check()
    world.end()
    for (alert, what), count in world.told.items():
        if what == "resolved":  # once for each time that it was open; a robot that moves just then may cost another
            assert count <= world.table.alerts[alert].times + 1
