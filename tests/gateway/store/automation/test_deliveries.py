"""Deliveries on both databases: acceptance, leases, their end, dead letters, and what is kept how long."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

from gateway.domain.automation.delivery import DEAD, DONE, WAITING, DeadFilter, Delivery, Policy, Put, Share
from gateway.domain.errors import QueueFullError
from gateway.store.automation.dead_letters import dead_page, drop_dead, redrive
from gateway.store.automation.deliveries import (
    AttemptResult,
    LeaseRequest,
    Ready,
    backlog,
    delivery,
    extend,
    hand_back,
    lease,
    lease_overdue,
    put,
    ready,
    reclaim,
    release,
    settle,
)
from gateway.store.automation.queue_purge import purge_queue
from gateway.store.automation.queue_totals import totals
from gateway.store.engine import StoreEngine
from gateway.store.schema import ROW_BYTES
from gateway.store.sqlite import SqliteEngine
from metaros.errors import TooLargeError
from metaros.limits import LIMITS

NOW = 1_700_000_000_000_000_000
S = 1_000_000_000
LEASE = 30 * S
A, B = "a/1", "b/1"  # holders: lives of gateways


def one(target: str = "t", payload: bytes = b"x", **more: object) -> Put:
    """Something to deliver."""
    return Put(kind="function", target=target, payload=payload, **more)  # type: ignore[arg-type]


def stored(engine: StoreEngine, *puts: Put, now_ns: int = NOW) -> list[str]:
    """Put them."""
    with engine.transaction(write=True):
        return put(engine, puts, gateway="a", now_ns=now_ns)


def leased(
    engine: StoreEngine, target: str = "t", most: int = 100, *, holder: str = A, now_ns: int = NOW + S, **more: int
) -> list[Delivery]:
    """Lease some of a target."""
    with engine.transaction(write=True):
        lease_requests = [LeaseRequest("function", target, most)]
        bytes_ = more.get("most_bytes", 1 << 30)
        return lease(engine, lease_requests, holder=holder, now_ns=now_ns, for_ns=LEASE, most_bytes=bytes_)


def ended(
    engine: StoreEngine, turns: Sequence[AttemptResult], *, holder: str = A, now_ns: int = NOW + 2 * S
) -> list[bool]:
    """Settle them."""
    with engine.transaction(write=True):
        return settle(engine, turns, holder=holder, gateway="a", now_ns=now_ns)


def asked(engine: StoreEngine, call: Callable[[], object]) -> object:
    """What a query says."""
    with engine.transaction(write=False):
        return call()


def dead(engine: StoreEngine, *puts: Put) -> list[str]:
    """Put them and let them die, one after the other."""
    ids = stored(engine, *puts)
    for target in dict.fromkeys(item.target for item in puts):
        for place, item in enumerate(leased(engine, target)):
            turn = AttemptResult(delivery=item, state=DEAD, attempts=3, code="broken", message="no")
            assert ended(engine, [turn], now_ns=NOW + (2 + place) * S) == [True]
    return ids


def test_what_is_put_is_leased_in_order_with_all_of_it(engine: StoreEngine) -> None:
    policy = Policy(most_attempts=7, most_age_s=60.0, backoff="lambda", first_s=2.0, most_s=9.0)
    first = one(payload=b"\x00\xff", event_id="e-1", robot="r", dedup="d", context={"a": [1]}, policy=policy)
    ids = stored(engine, first, one(payload=b"2"), one("other"))
    found = leased(engine)
    assert [item.id for item in found] == ids[:2]
    assert replace(found[0].put, due_ns=0) == first
    assert (found[0].tries, found[0].attempts, found[0].expires_ns) == (1, 0, NOW + 60 * S)
    assert leased(engine) == []


def test_the_same_target_and_dedup_is_put_once_also_after_it_is_done(engine: StoreEngine) -> None:
    ids = stored(engine, one(dedup="x"), one(dedup="x"), one("u", dedup="x"), one())
    assert ids[0] == ids[1] != ids[2]
    assert asked(engine, lambda: totals(engine).live.rows) == 3
    assert ended(engine, [AttemptResult(delivery=item, state=DONE) for item in leased(engine)]) == [True, True]
    assert stored(engine, one(dedup="x")) == ids[:1]
    assert leased(engine) == []
    assert asked(engine, lambda: totals(engine).done) == Share(1, 0)
    with engine.transaction(write=True):
        after_ns = NOW + 3 * S + round(LIMITS.dedup_s * 1e9)
        assert purge_queue(engine, gateway="a", now_ns=after_ns) == 1
    assert stored(engine, one(dedup="x")) != ids[:1]


def test_a_full_queue_takes_nothing_and_an_end_makes_room(engine: StoreEngine) -> None:
    limits = replace(LIMITS, queue_rows=2)
    with engine.transaction(write=True):
        put(engine, [one()], gateway="a", now_ns=NOW, limits=limits)
    with pytest.raises(QueueFullError, match="queue_rows"), engine.transaction(write=True):
        put(engine, [one(), one()], gateway="b", now_ns=NOW, limits=limits)
    (found,) = leased(engine)
    follow = AttemptResult(delivery=found, state=DONE, puts=[one("next"), one("next"), one("next")])
    with engine.transaction(write=True):
        assert settle(engine, [follow], holder=A, gateway="a", now_ns=NOW, limits=limits) == [True]
    assert len(leased(engine, "next")) == 3
    narrow = replace(LIMITS, queue_bytes=3 * (1 + ROW_BYTES) + 4)
    with pytest.raises(QueueFullError, match="queue_bytes"), engine.transaction(write=True):
        put(engine, [one()], gateway="b", now_ns=NOW, limits=narrow)
    with pytest.raises(TooLargeError, match="delivery_bytes"), engine.transaction(write=True):
        put(engine, [one(), one(payload=bytes(LIMITS.delivery_bytes))], gateway="b", now_ns=NOW)


def test_an_expired_lease_goes_to_another_and_its_holder_changes_nothing(engine: StoreEngine) -> None:
    stored(engine, one())
    (mine,) = leased(engine, holder=A)
    with engine.transaction(write=True):
        extend(engine, [mine.id], holder=A, until_ns=NOW + 60 * S)
        extend(engine, [mine.id], holder=B, until_ns=NOW + 900 * S)
        assert reclaim(engine, now_ns=NOW + 59 * S, limit=10) == []
        assert reclaim(engine, now_ns=NOW + 60 * S, limit=10) == [Ready("function", "t", NOW + 60 * S)]
    (theirs,) = leased(engine, holder=B, now_ns=NOW + 61 * S)
    assert (theirs.tries, theirs.losses) == (2, 1)
    assert ended(engine, [AttemptResult(delivery=mine, state=DONE, puts=[one("follow")])], holder=A) == [False]
    assert leased(engine, "follow") == []
    assert ended(engine, [AttemptResult(delivery=theirs, state=DONE)], holder=B) == [True]


def test_a_holder_that_lost_a_lease_and_has_it_again_cannot_end_the_first(engine: StoreEngine) -> None:
    stored(engine, one())
    (first,) = leased(engine)
    with engine.transaction(write=True):
        reclaim(engine, now_ns=NOW + 100 * S, limit=10)
    (second,) = leased(engine, now_ns=NOW + 101 * S)
    assert ended(engine, [AttemptResult(delivery=first, state=DEAD, code="late")]) == [False]
    assert ended(engine, [AttemptResult(delivery=second, state=DONE)]) == [True]
    assert asked(engine, lambda: totals(engine).dead.rows) == 0


def test_a_restart_frees_what_its_former_lives_had_and_nothing_else(engine: StoreEngine) -> None:
    stored(engine, *(one() for _ in range(3)))
    leased(engine, most=1, holder="a/1")
    leased(engine, most=1, holder="b/1")
    leased(engine, most=1, holder="a/2")
    with engine.transaction(write=True):
        assert release(engine, gateway="a", holder="a/2", now_ns=NOW) == [Ready("function", "t", NOW)]
    (again,) = leased(engine, holder="a/2")
    assert (again.tries, again.losses) == (2, 1)
    with engine.transaction(write=True):
        assert hand_back(engine, holder="a/2") == 2
    assert sorted(item.losses for item in leased(engine)) == [0, 1]


def test_what_keeps_killing_its_gateway_waits_longer_each_time(engine: StoreEngine) -> None:
    stored(engine, one())
    for _ in range(5):
        (found,) = leased(engine, now_ns=NOW + 1000 * S)
        with engine.transaction(write=True):
            release(engine, gateway="a", holder="a/9", now_ns=NOW)
    assert found.losses == 4
    due_ns = asked(engine, lambda: getattr(delivery(engine, found.id), "due_ns", None))
    assert due_ns == NOW + 4 * S


def test_a_retry_waits_until_it_is_due_and_tells_why(engine: StoreEngine) -> None:
    stored(engine, one())
    (found,) = leased(engine)
    ended(
        engine, [AttemptResult(delivery=found, state=WAITING, attempts=1, due_ns=NOW + 60 * S, code="c", message="m")]
    )
    assert leased(engine, now_ns=NOW + 59 * S) == []
    (again,) = leased(engine, now_ns=NOW + 60 * S)
    assert (again.attempts, again.tries, again.code, again.message) == (1, 2, "c", "m")


def test_what_is_too_old_is_only_taken_to_be_given_up(engine: StoreEngine) -> None:
    young, old = one(policy=Policy(most_age_s=100.0)), one(policy=Policy(most_age_s=10.0))
    ids = stored(engine, young, old)
    assert [item.id for item in leased(engine, now_ns=NOW + 10 * S)] == ids[:1]
    with engine.transaction(write=True):
        assert lease_overdue(engine, holder=A, now_ns=NOW + 9 * S, for_ns=LEASE, limit=9) == []
        (found,) = lease_overdue(engine, holder=A, now_ns=NOW + 10 * S, for_ns=LEASE, limit=9)
    assert found.id == ids[1]


def test_targets_come_page_by_page_with_what_is_due_first(engine: StoreEngine) -> None:
    stored(engine, one("b"), one("a", due_ns=NOW + 9 * S), one("a", due_ns=NOW + 5 * S), one("c"))
    stored(engine, Put(kind="webhook", target="z", payload=b""))
    with engine.transaction(write=False):
        assert [(row.target, row.due_ns) for row in ready(engine, "function", limit=2)] == [
            ("a", NOW + 5 * S),
            ("b", NOW - 4),
        ]
        assert [row.target for row in ready(engine, "function", after="b", limit=2)] == ["c"]
        assert ready(engine, "function", after="c", limit=2) == []
        assert [row.target for row in ready(engine, "webhook", limit=2)] == ["z"]


def test_a_lease_takes_no_more_bytes_than_there_is_room_for_but_at_least_one(engine: StoreEngine) -> None:
    stored(engine, *(one(payload=bytes(1000)) for _ in range(5)))
    assert len(leased(engine, most_bytes=2 * (1000 + ROW_BYTES + 2))) == 2
    assert len(leased(engine, most_bytes=1)) == 1
    assert len(leased(engine)) == 2


def test_dead_letters_are_shown_by_page_and_by_scope(engine: StoreEngine) -> None:
    ids = dead(engine, one(robot="r1"), one(robot="r2"), one(), one("u", robot="r1"))
    with engine.transaction(write=False):
        assert {item.id for item in dead_page(engine, DeadFilter(), limit=9)} == set(ids)
        first = dead_page(engine, DeadFilter(target="t"), limit=2)
        rest = dead_page(engine, DeadFilter(target="t"), before=(first[-1].ended_ns, first[-1].id), limit=2)
        assert [item.id for item in [*first, *rest]] == [ids[2], ids[1], ids[0]]
        assert (first[0].code, first[0].message, first[0].put.payload) == ("broken", "no", b"")
        scope = frozenset({"r1"})
        assert {item.id for item in dead_page(engine, DeadFilter(robots=scope), limit=9)} == {ids[0], ids[3]}
        assert dead_page(engine, DeadFilter(robots=frozenset()), limit=9) == []
        assert dead_page(engine, DeadFilter(code="other"), limit=9) == []


def test_a_redriven_letter_is_who_it_was_with_a_new_life_before_it(engine: StoreEngine) -> None:
    policy = Policy(most_age_s=100.0)
    ids = dead(engine, one(dedup="d", policy=policy, payload=b"kept"), one("u"))
    later = NOW + 5000 * S
    with engine.transaction(write=True):
        moved = redrive(engine, DeadFilter(ids=(ids[0],)), gateway="b", now_ns=later, limit=10)
    assert moved == [("function", "t")]
    (found,) = leased(engine, now_ns=later)
    assert (found.id, found.attempts, found.tries, found.redrives) == (ids[0], 0, 2, 1)
    assert (found.expires_ns, found.put.payload, found.born_ns) == (later + 100 * S, b"kept", NOW)
    assert stored(engine, one(dedup="d")) == ids[:1]
    held = asked(engine, lambda: totals(engine))
    assert (held.live.rows, held.dead.rows) == (1, 1)  # type: ignore[attr-defined]
    full = replace(LIMITS, queue_rows=1)
    with pytest.raises(QueueFullError), engine.transaction(write=True):
        redrive(engine, DeadFilter(), gateway="b", now_ns=later, limit=10, limits=full)
    with engine.transaction(write=True):
        assert drop_dead(engine, DeadFilter(), gateway="b", limit=10) == 1
        assert totals(engine).dead == Share(0, 0)


def test_dead_letters_beyond_their_bounds_go_the_oldest_first(engine: StoreEngine) -> None:
    ids = dead(engine, *(one(payload=bytes(100)) for _ in range(6)))

    def left(**bounds: float) -> list[str]:
        with engine.transaction(write=True):
            limits = replace(LIMITS, **bounds)  # type: ignore[arg-type]
            while purge_queue(engine, gateway="a", now_ns=NOW + 10 * S, limits=limits, limit=1):
                pass
            return [item.id for item in dead_page(engine, DeadFilter(), limit=9)][::-1]

    assert left() == ids
    assert left(dead_letters=4) == ids[2:]
    assert left(dead_letters_bytes=3 * (100 + 2 + ROW_BYTES)) == ids[3:]
    assert left(dead_letters_s=4.5) == ids[4:]
    assert asked(engine, lambda: totals(engine).dead) == Share(2, 2 * (100 + 2 + ROW_BYTES))


def test_a_backlog_is_counted_to_a_bound(engine: StoreEngine) -> None:
    stored(engine, *(one() for _ in range(5)))
    leased(engine, most=1)
    found = asked(engine, lambda: backlog(engine, "function", "t", most=3))
    assert (found.waiting, found.leased, found.dead, found.oldest_ns) == (3, 1, 0, NOW - 4)  # type: ignore[attr-defined]


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one writer
def test_two_connections_never_lease_the_same(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    ids = stored(here, *(one() for _ in range(4)))
    with here.transaction(write=True):
        mine = lease(
            here, [LeaseRequest("function", "t", 2)], holder=A, now_ns=NOW + S, for_ns=LEASE, most_bytes=1 << 30
        )
        theirs = leased(there, holder=B)  # while the other transaction is open
    assert [item.id for item in mine] == ids[:2]
    assert [item.id for item in theirs] == ids[2:]
    with here.transaction(write=True):
        first = put(here, [one(dedup="x")], gateway="a", now_ns=NOW)
    assert stored(there, one(dedup="x")) == first


def test_leasing_costs_as_much_with_a_long_backlog_as_with_a_short_one(engine: StoreEngine) -> None:
    """By the plans: every query of the dispatcher's is a search in an index, none looks through the table."""
    count = 1000 if isinstance(engine, SqliteEngine) else 20_000  # a file's plans are the same however long it is
    for start in range(0, count, 1000):
        stored(engine, *(one("big", dedup=str(number)) for number in range(start, start + 1000)))
    stored(engine, one("small"))
    asking = _Explaining(engine)
    with engine.transaction(write=True):
        ready(asking, "function", limit=8)
        lease(asking, [LeaseRequest("function", "big", 8)], holder=A, now_ns=NOW + S, for_ns=LEASE, most_bytes=1 << 30)
        lease_overdue(asking, holder=A, now_ns=NOW, for_ns=LEASE, limit=8)
        reclaim(asking, now_ns=NOW, limit=8)
        release(asking, gateway="a", holder=B, now_ns=NOW)
    assert asking.plans
    for sql, plan in asking.plans.items():
        for costly in ("Seq Scan on deliveries", "SCAN deliveries", "TEMP B-TREE", "Sort Key: due_ns"):
            assert costly not in plan, f"{sql}\n{plan}"


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)
def test_a_plan_from_when_the_table_was_small_is_not_kept(engine: StoreEngine) -> None:
    show = "SELECT current_setting('plan_cache_mode')"
    ids = stored(engine, one())
    with engine.transaction(write=True):
        found = lease(engine, [LeaseRequest("function", "t", 1)], holder=A, now_ns=NOW, for_ns=LEASE, most_bytes=1)
        assert [item.id for item in found] == ids
        assert engine.fetch(show)[0][0] == "force_custom_plan"
    with engine.transaction(write=True):
        assert engine.fetch(show)[0][0] == "auto"
        settle(engine, [AttemptResult(delivery=found[0], state=DONE)], holder=A, gateway="a", now_ns=NOW)
        assert engine.fetch(show)[0][0] == "force_custom_plan"


class _Explaining:
    """Asks what it would cost, and then asks."""

    def __init__(self, engine: StoreEngine) -> None:
        self._engine = engine
        self.plans: dict[str, str] = {}

    def fetch(self, sql: str, *values: object) -> object:
        if sql.startswith(("SELECT", "WITH")):
            how = "EXPLAIN" if self._engine.shared else "EXPLAIN QUERY PLAN"
            self.plans[sql] = "\n".join(str(row[-1]) for row in self._engine.fetch(f"{how} {sql}", *values))
        return self._engine.fetch(sql, *values)

    def __getattr__(self, name: str) -> object:
        return getattr(self._engine, name)
