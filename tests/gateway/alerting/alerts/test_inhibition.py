"""Silences over many alerts, and ticks in pieces."""

from __future__ import annotations

from gateway.alerting.alerts.inhibition import Inhibitor
from gateway.alerting.alerts.registry import AlertRegistry
from gateway.domain.alert import Silence
from gateway.domain.finding import Edge
from metaros.limits import Limits
from tests.gateway.alerting.alerts.findings import NOW, finding

S = 10**9
ROBOTS = 40


def silence(**fields: object) -> Silence:
    values = {"id": "s1", "from_ns": NOW, "until_ns": NOW + 100 * S, "by": "ann", **fields}
    return Silence(**values)  # type: ignore[arg-type]


def registry_of(robots: int, *, limits: Limits | None = None) -> AlertRegistry:
    registry = AlertRegistry(gateway="here", limits=limits or Limits())
    registry.apply([Edge("opened", finding(robot=f"r{n}"), NOW / S) for n in range(robots)], NOW)
    return registry


def test_the_more_patterns_there_are_the_fewer_robots_are_held_against_them_at_once() -> None:
    inhibitor = Inhibitor(lambda robot, node: ())
    assert inhibitor.robots_at_once >= ROBOTS
    inhibitor.set_silences([silence(id=f"s{n}", robots=tuple(f"*{n}{k}" for k in range(32))) for n in range(256)])
    assert inhibitor.refresh(NOW)
    assert not inhibitor.refresh(NOW)
    assert inhibitor.robots_at_once == 1


def test_a_silence_of_many_patterns_reaches_all_robots_within_a_tick() -> None:
    registry = registry_of(ROBOTS)
    many = tuple(silence(id=f"s{n}", robots=tuple(f"x{n}.{k}*" for k in range(32))) for n in range(32))
    registry.silence([*many, silence(id="s.all", robots=("r*",))], NOW)
    assert any(not alert.quiet for alert in registry.all())
    registry.tick(NOW)
    assert {alert.silence for alert in registry.all()} == {"s.all"}


def test_a_registry_may_change_between_the_pieces_of_a_tick() -> None:
    registry = registry_of(100, limits=Limits(alerts_unresolved=100))
    registry.apply([Edge("opened", finding(robot=f"w{n}"), NOW / S) for n in range(100)], NOW)
    assert registry.waiting == 100
    registry.apply([Edge("cleared", finding(robot=f"r{n}"), NOW / S) for n in range(100)], NOW)
    pieces = registry.ticking(NOW + 60 * S)
    next(pieces)
    registry.apply([Edge("cleared", finding(robot="w99"), NOW / S)], NOW + 60 * S)  # it does not wait any more
    registry.apply([Edge("opened", finding(robot="r0"), NOW / S)], NOW + 60 * S)
    for _ in pieces:
        pass
    assert sorted(alert.robot for alert in registry.all() if alert.unresolved) == sorted(
        ["r0", *(f"w{n}" for n in range(99))]
    )
    assert registry.waiting == 0
