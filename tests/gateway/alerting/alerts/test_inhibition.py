"""Silences over many alerts, and ticks in pieces."""

from __future__ import annotations

from gateway.alerts.book import Book
from gateway.alerts.hush import Hush
from gateway.domain.alert import Silence
from gateway.domain.finding import Edge
from metaros.limits import Limits
from tests.gateway.alerts.findings import NOW, finding

S = 10**9
ROBOTS = 40


def silence(**fields: object) -> Silence:
    values = {"id": "s1", "from_ns": NOW, "until_ns": NOW + 100 * S, "by": "ann", **fields}
    return Silence(**values)  # type: ignore[arg-type]


def book_of(robots: int, *, limits: Limits | None = None) -> Book:
    book = Book(gateway="here", limits=limits or Limits())
    book.apply([Edge("opened", finding(robot=f"r{n}"), NOW / S) for n in range(robots)], NOW)
    return book


def test_the_more_patterns_there_are_the_fewer_robots_are_held_against_them_at_once() -> None:
    hush = Hush(lambda robot, node: ())
    assert hush.robots_at_once >= ROBOTS
    hush.know([silence(id=f"s{n}", robots=tuple(f"*{n}{k}" for k in range(32))) for n in range(256)])
    assert hush.look(NOW)
    assert not hush.look(NOW)
    assert hush.robots_at_once == 1


def test_a_silence_of_many_patterns_reaches_all_robots_within_a_tick() -> None:
    book = book_of(ROBOTS)
    many = tuple(silence(id=f"s{n}", robots=tuple(f"x{n}.{k}*" for k in range(32))) for n in range(32))
    book.silence([*many, silence(id="s.all", robots=("r*",))], NOW)
    assert any(not alert.quiet for alert in book.all())
    book.tick(NOW)
    assert {alert.silence for alert in book.all()} == {"s.all"}


def test_a_book_may_change_between_the_pieces_of_a_tick() -> None:
    book = book_of(100, limits=Limits(alerts_unresolved=100))
    book.apply([Edge("opened", finding(robot=f"w{n}"), NOW / S) for n in range(100)], NOW)
    assert book.waiting == 100
    book.apply([Edge("cleared", finding(robot=f"r{n}"), NOW / S) for n in range(100)], NOW)
    pieces = book.ticking(NOW + 60 * S)
    next(pieces)
    book.apply([Edge("cleared", finding(robot="w99"), NOW / S)], NOW + 60 * S)  # it does not wait any more
    book.apply([Edge("opened", finding(robot="r0"), NOW / S)], NOW + 60 * S)
    for _ in pieces:
        pass
    assert sorted(alert.robot for alert in book.all() if alert.unresolved) == sorted(
        ["r0", *(f"w{n}" for n in range(99))]
    )
    assert book.waiting == 0
