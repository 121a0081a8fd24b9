"""What happened, kept and read again on both databases."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gateway.domain.automation.event import Event
from gateway.domain.automation.gateway_event import GatewayEvent, Replay, Span
from gateway.store.automation.events import add_events
from gateway.store.automation.gateway_events import Cursor, add_gateway_events, find_gateway_event, read_gateway_events
from gateway.store.automation.queue_purge import purge_queue
from gateway.store.automation.queue_totals import totals
from gateway.store.automation.replays import add_replay, advance_replay, end_replay, read_replay, read_replays
from gateway.store.engine import StoreEngine
from metaros.errors import TooLargeError
from metaros.limits import LIMITS

S = 1_000_000_000
ALL = Span(from_ns=0, to_ns=1 << 62)


def one(name: str, at_s: int, **more: object) -> GatewayEvent:
    """An event from outside."""
    return GatewayEvent(id=name, type="shop.order", source="shop", at_ns=at_s * S, **more)  # type: ignore[arg-type]


def kept(engine: StoreEngine, *some: GatewayEvent, now_s: int = 100) -> list[GatewayEvent]:
    """Keep some; the new ones."""
    with engine.transaction(write=True):
        return add_gateway_events(engine, some, gateway="a", now_ns=now_s * S)


def journal(engine: StoreEngine, *times: tuple[int, str, str]) -> None:
    """Events of the journal: when, kind, robot."""
    events = [Event(seq=0, kind=kind, robot=robot, at_ns=at_s * S, gateway="a") for at_s, kind, robot in times]
    with engine.transaction(write=True):
        add_events(engine, events)


def read(engine: StoreEngine, span: Span = ALL, limit: int = 100) -> list[str]:
    """The ids of a span, in pages of two."""
    found: list[str] = []
    after: Cursor | None = None
    with engine.transaction(write=False):
        while page := read_gateway_events(engine, span, after=after, limit=2):
            after = page[-1][0]
            found += [item.id for _, item in page]
    return found[:limit]


def test_the_same_source_and_id_is_new_once(engine: StoreEngine) -> None:
    first = one("1", 5, robot="r", data={"n": [1, "ü"]})
    assert kept(engine, first, one("1", 6), one("2", 5)) == [first, one("2", 5)]
    assert kept(engine, one("2", 9), replace(one("1", 9), source="other")) == [replace(one("1", 9), source="other")]
    with engine.transaction(write=False):
        assert find_gateway_event(engine, "shop", "1") == first
        assert find_gateway_event(engine, "shop", "3") is None
        assert totals(engine).gateway_events.rows == 3


def test_the_journal_and_the_rest_are_read_together_in_order_of_time(engine: StoreEngine) -> None:
    journal(engine, (1, "robot.connected", "r1"), (3, "robot.offline", "r1"), (5, "alert.opened", ""))
    kept(engine, one("a", 2), one("b", 3, robot="r2"), one("c", 3), one("d", 9))
    assert read(engine) == ["e-1", "a", "e-2", "b", "c", "e-3", "d"]
    assert read(engine, Span(from_ns=3 * S, to_ns=5 * S)) == ["e-2", "b", "c"]
    assert read(engine, replace(ALL, types=("metaros.robot.offline", "shop.order"))) == ["a", "e-2", "b", "c", "d"]
    assert read(engine, replace(ALL, robots=frozenset({"r1", "r2"}))) == ["e-1", "e-2", "b"]
    assert read(engine, replace(ALL, robots=frozenset())) == []
    with engine.transaction(write=False):
        found = find_gateway_event(engine, "metaros", "e-2")
    assert found is not None
    assert (found.type, found.robot, found.at_ns) == ("metaros.robot.offline", "r1", 3 * S)


def test_data_over_its_limit_is_refused_and_nothing_is_kept(engine: StoreEngine) -> None:
    with pytest.raises(TooLargeError, match="happening_bytes"):
        kept(engine, one("a", 1), one("b", 1, data={"text": "x" * LIMITS.happening_bytes}))
    assert read(engine) == []


def test_events_go_by_age_and_by_number(engine: StoreEngine) -> None:
    for second in range(4):
        kept(engine, one(str(second), second), now_s=second)
    limits = replace(LIMITS, happenings_s=2.0)
    with engine.transaction(write=True):
        assert purge_queue(engine, gateway="b", now_ns=3 * S, limits=limits) == 1
        assert purge_queue(engine, gateway="b", now_ns=3 * S, limits=replace(LIMITS, happenings_kept=2)) == 1
    assert read(engine) == ["2", "3"]


def test_a_replay_is_begun_once_and_goes_on_where_it_was(engine: StoreEngine) -> None:
    span = Span(from_ns=1, to_ns=2, types=("a",), robots=frozenset({"r"}))
    asked = Replay(id="again", span=span, spec={"pattern": {"source": ["shop"]}})
    with engine.transaction(write=True):
        begun = add_replay(engine, asked, now_ns=7)
        assert begun == replace(asked, made_ns=7)
        assert advance_replay(engine, "again", Cursor(1, 1, 5), read=10, put=3)
        assert add_replay(engine, replace(asked, spec={}), now_ns=9) == replace(begun, read=10, put=3)
        assert read_replay(engine, "again") == (replace(begun, read=10, put=3), Cursor(1, 1, 5))
        assert end_replay(engine, "again", now_ns=8)
        assert not end_replay(engine, "again", now_ns=9, code="stopped")
        assert not advance_replay(engine, "again", Cursor(1, 1, 6), read=1, put=1)
        add_replay(engine, replace(asked, id="open"), now_ns=3)
        assert [item.id for item in read_replays(engine, limit=9)] == ["open", "again"]
        add_replay(engine, replace(asked, id="newer"), now_ns=8)
        end_replay(engine, "newer", now_ns=9)
        assert purge_queue(engine, gateway="a", now_ns=9, limits=replace(LIMITS, replays_kept=1)) == 1
        assert [item.id for item in read_replays(engine, limit=9)] == ["open", "newer"]
