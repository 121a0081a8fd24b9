"""The registry under random edges, people, silences, other gateways, failing stores and restarts, on a small store."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections import Counter
from dataclasses import replace

import pytest

from gateway.alerting.alerts.change import Change
from gateway.alerting.alerts.registry import AlertRegistry
from gateway.domain.alert import Alert
from gateway.domain.finding import SEVERITIES, Edge, Finding
from metaros.limits import LIMITS
from tests.gateway.alerting.alerts.findings import NOW, S, finding, silence

ROBOTS = ("r1", "r2", "r3")
CAUSES = ("offline", "silence", "heat", "change", "battery")
SERIES = ("a", "b", "c")
PER_ROBOT = 3


class Table:
    """What the database promises: one unresolved alert of each robot and cause, saved over the revision it has."""

    def __init__(self) -> None:
        self.alerts: dict[str, Alert] = {}

    def save(self, alert: Alert) -> bool:
        stored = self.alerts.get(alert.id)
        if (stored.revision if stored else 0) != alert.revision:
            return False
        if alert.unresolved and any(other.id != alert.id for other in self.unresolved(alert)):
            return False
        self.alerts[alert.id] = replace(alert, revision=alert.revision + 1)
        return True

    def unresolved(self, like: Alert) -> list[Alert]:
        return [
            item
            for item in self.alerts.values()
            if item.unresolved and (item.robot, item.cause) == (like.robot, like.cause)
        ]

    def there_is(self, alert: Alert) -> Alert | None:
        stored = self.alerts.get(alert.id)
        if stored is None or stored.revision == alert.revision:
            stored = next(iter(self.unresolved(alert)), stored)
        return stored


class World:
    """An evaluator whose findings come and go, a registry that gets them, and a store."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.now_ns = NOW
        self.table = Table()
        self.active: dict[tuple[str, str, str], Finding] = {}
        self.told: Counter[str] = Counter()
        self.ids = 0
        self.registry = self.fresh()

    def fresh(self) -> AlertRegistry:
        return AlertRegistry(gateway="g1", limits=replace(LIMITS, alerts_per_robot=PER_ROBOT), new_id=self.new_id)

    def new_id(self, now_ns: int) -> str:
        self.ids += 1
        return f"{self.ids:026}"

    def judge(self) -> None:
        robot, cause, series = self.rng.choice(ROBOTS), self.rng.choice(CAUSES), self.rng.choice(SERIES)
        found = finding(robot, cause, series, severity=self.rng.choice(SEVERITIES), since_s=self.now_ns / S)
        change = self.rng.choice(("changed", "cleared", "cleared")) if found.key in self.active else "opened"
        if change == "cleared":
            del self.active[found.key]
        else:
            self.active[found.key] = found
        self.registry.apply([Edge(change, found, self.now_ns / S)], self.now_ns)

    def settle(self) -> None:
        while changes := self.registry.changes(self.now_ns, most=2, all_of_it=True):
            for change in changes:
                self.store(change)

    def store(self, change: Change) -> None:
        if self.rng.random() < 0.1:
            self.registry.failed(change)  # the database was away
        elif self.rng.random() < 0.05 and self.table.save(change.alert):
            self.registry.failed(change)  # it broke after the commit: nobody knows
        elif self.table.save(change.alert):
            self.registry.stored(change)
            self.told.update(change.news)
        else:
            self.registry.clashed(change, self.table.there_is(change.alert), self.now_ns)

    def person(self) -> None:
        ids = [item.id for item in self.table.alerts.values() if item.unresolved]
        if not ids:
            return
        alert = self.table.alerts[self.rng.choice(ids)]
        if self.rng.random() < 0.5:
            after = replace(alert, state="acknowledged", acknowledged_ns=self.now_ns, acknowledged_by="eve")
        else:
            after = replace(alert, state="resolved", resolved_ns=self.now_ns, resolved_by="eve")
        assert self.table.save(after)
        if self.rng.random() < 0.5:  # else at another gateway: the registry finds out when it saves
            self.registry.learn(self.table.alerts[alert.id], self.now_ns)

    def inhibitor(self) -> None:
        some = [silence(id=f"S{self.now_ns}", from_ns=self.now_ns, until_ns=self.now_ns + 60 * S, causes=("he*",))]
        self.registry.silence(some if self.rng.random() < 0.5 else [], self.now_ns)

    def refresh(self) -> None:
        known = self.registry.revisions()
        for alert in list(self.table.alerts.values()):
            if alert.revision != known.get(alert.id):
                self.registry.learn(alert, self.now_ns)

    def restart(self) -> None:
        if self.rng.random() < 0.7:
            self.settle()
        self.registry = self.fresh()
        live = [item for item in self.table.alerts.values() if item.unresolved or not item.clear_ns]
        for alert in sorted(live, key=lambda item: item.id):
            self.registry.learn(alert, self.now_ns)
        for robot in ROBOTS:
            self.registry.adopt(robot, self.now_ns)
        self.registry.apply([Edge("opened", item, self.now_ns / S) for item in self.active.values()], self.now_ns)

    def pass_time(self) -> None:
        self.now_ns += self.rng.choice((S // 10, S, 5 * S, 20 * S, 700 * S))
        self.registry.tick(self.now_ns)

    def check(self) -> None:
        """What always holds."""
        unresolved = [item for item in self.table.alerts.values() if item.unresolved]
        places = Counter((item.robot, item.cause) for item in unresolved)
        assert max(places.values(), default=1) == 1
        for robot in ROBOTS:
            mine = self.registry.of(robot)
            assert len({item.cause for item in mine}) == len(mine)
            assert len([item for item in mine if item.cause != "too_many"]) <= PER_ROBOT + 1
            for alert in mine:
                shown = {item.finding.key for item in alert.findings if item.active}
                assert bool(shown) == (not alert.clear_ns)
                explained = [item.id for item in mine if item.cause == "offline"]
                if explained and alert.cause not in ("offline", "too_many"):
                    assert alert.inhibited_by == explained[0]
        shown = {item.finding.key for alert in self.registry.all() for item in alert.findings if item.active}
        assert len(self.active.keys() - shown) == self.registry.waiting  # nothing that is wrong is forgotten
        assert self.registry.unresolved == sum(
            item.unresolved and item.cause != "too_many" for item in self.registry.all()
        )

    def end(self) -> None:
        """All findings end: then all alerts do, and the store says the same as the registry."""
        for found in list(self.active.values()):
            self.registry.apply([Edge("cleared", found, self.now_ns / S)], self.now_ns)
        self.active.clear()
        for _ in range(200):
            self.now_ns += 5 * S
            self.registry.tick(self.now_ns)
            self.settle()
        self.refresh()
        self.settle()
        assert [item for item in self.table.alerts.values() if item.unresolved] == []
        assert self.registry.unresolved == 0


@pytest.mark.parametrize("seed", range(6))
def test_what_always_holds_of_alerts(seed: int) -> None:
    world = World(seed)
    for _ in range(400):
        step = world.rng.choices(
            (world.judge, world.settle, world.person, world.inhibitor, world.refresh, world.restart, world.pass_time),
            weights=(50, 15, 5, 3, 5, 1, 15),
        )[0]
        step()
        world.check()
    world.end()
    assert 10 < world.told["opened"] < 300  # no storm: fewer than there were edges
