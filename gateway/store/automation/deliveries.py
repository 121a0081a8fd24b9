"""Deliveries in the database, from their acceptance to their end. Every function runs inside a transaction of the
caller's.

A lease is known by its holder and by how often the delivery was leased (`tries`): whoever comes back after its lease
ran out, and somebody else has it, changes nothing. What leasing costs depends on the targets that have something
waiting, not on how much of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.domain.automation.delivery import DEAD, DONE, WAITING, Backlog, Delivery, Put, Share
from gateway.store.automation.delivery_rows import COLUMNS, INSERT, delivery_of, new_row, plan_anew, skip_locked
from gateway.store.automation.queue_totals import DEAD_ROWS, DONE_ROWS, LIVE, check_room, count, totals
from gateway.store.engine import Row, StoreEngine, placeholders, slices
from metaros.limits import LIMITS, Limits

__all__ = [
    "AttemptResult",
    "LeaseRequest",
    "Ready",
    "backlog",
    "delivery",
    "due_of",
    "extend",
    "hand_back",
    "lease",
    "lease_overdue",
    "needs_tending",
    "put",
    "ready",
    "reclaim",
    "release",
    "settle",
]

QUICK_LOSSES = 3  # after which what was lost waits before it is tried again: it may be what kills its gateways
LONGEST_S = 300.0
_LEASED = "SELECT delivery, kind, target, losses FROM deliveries WHERE state = 'leased'"


@dataclass(frozen=True, slots=True)
class Ready:
    """A target that has something waiting, and when the first of it is due."""

    kind: str
    target: str
    due_ns: int


@dataclass(frozen=True, slots=True)
class LeaseRequest:
    """How many deliveries of a target there is room for."""

    kind: str
    target: str
    most: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptResult:
    """What became of a lease: `state` is WAITING (then `due_ns` says until when), DONE or DEAD."""

    delivery: Delivery
    state: str
    attempts: int = 0
    due_ns: int = 0
    code: str = ""
    message: str = ""
    puts: Sequence[Put] = ()


def put(
    engine: StoreEngine,
    puts: Sequence[Put],
    *,
    gateway: str,
    now_ns: int,
    limits: Limits = LIMITS,
    bounded: bool = True,
) -> list[str]:
    """Accept deliveries: their ids, in order. Of what is known by its target and `dedup` it is the first one's id.

    What follows from a delivery's end takes its place, and is not `bounded` by what waits.

    Raises:
        QueueFullError: there is no room for all of them; nothing was accepted.
        TooLargeError: one of them is over its limit; nothing was accepted.
    """
    if not puts:
        return []
    rows = [new_row(one, place, now_ns=now_ns, limits=limits) for place, one in enumerate(puts, -len(puts))]
    if bounded:
        check_room(totals(engine).live, Share(len(rows), sum(row[14] for row in rows)), limits)
    # Gateways that put the same at once wait for each other, in one order.
    engine.many(INSERT, sorted(rows, key=lambda row: (row[1], row[2], row[17], row[4])))
    stored = _known(engine, [(row[1], row[2], row[17]) for row in rows if row[17]])
    ids = [stored.get((row[1], row[2], row[17]), row[0]) if row[17] else row[0] for row in rows]
    new = [row for row, found in zip(rows, ids, strict=True) if row[0] == found]
    count(engine, gateway, LIVE, len(new), sum(row[14] for row in new))
    return ids


def ready(engine: StoreEngine, kind: str, *, after: str = "", limit: int) -> list[Ready]:
    """The next targets of a kind that have something waiting, by name: one look-up in an index for each."""
    first = "SELECT target FROM deliveries WHERE state = 'waiting' AND kind = ? AND target > {} ORDER BY target LIMIT 1"
    sql = (
        f"WITH RECURSIVE found (target) AS (SELECT * FROM ({first.format('?')}) AS one UNION ALL"
        f" SELECT ({first.format('found.target')}) FROM found WHERE found.target IS NOT NULL)"
        " SELECT target, (SELECT min(due_ns) FROM deliveries d WHERE d.state = 'waiting' AND d.kind = ?"
        " AND d.target = found.target) FROM found WHERE target IS NOT NULL LIMIT ?"
    )
    plan_anew(engine)
    rows = engine.fetch(sql, kind, after, kind, kind, limit)
    return [Ready(kind, row[0], int(row[1])) for row in rows if row[1] is not None]


def due_of(engine: StoreEngine, targets: Sequence[tuple[str, str]]) -> list[Ready]:
    """When the first of each of these kinds and targets is due, where something waits."""
    sql = "SELECT min(due_ns) FROM deliveries WHERE state = 'waiting' AND kind = ? AND target = ?"
    found = [(kind, target, engine.fetch(sql, kind, target)[0][0]) for kind, target in targets]
    return [Ready(kind, target, int(due_ns)) for kind, target, due_ns in found if due_ns is not None]


def lease(
    engine: StoreEngine,
    lease_requests: Sequence[LeaseRequest],
    *,
    holder: str,
    now_ns: int,
    for_ns: int,
    most_bytes: int,
) -> list[Delivery]:
    """Take what is due of these targets, the longest due first, until there is no room: leased for `for_ns`."""
    sql = (
        "SELECT delivery, size_bytes FROM deliveries WHERE state = 'waiting' AND kind = ? AND target = ?"
        f" AND due_ns <= ? AND expires_ns + 0 > ? ORDER BY due_ns LIMIT ?{skip_locked(engine)}"
    )
    plan_anew(engine)
    ids: list[str] = []
    left_bytes = most_bytes
    for request in lease_requests:
        for found, size_bytes in engine.fetch(sql, request.kind, request.target, now_ns, now_ns, request.most):
            if ids and size_bytes > left_bytes:
                break
            ids.append(found)
            left_bytes -= size_bytes
    return _take(engine, ids, holder, now_ns + for_ns)


def lease_overdue(engine: StoreEngine, *, holder: str, now_ns: int, for_ns: int, limit: int) -> list[Delivery]:
    """Take what is too old, whether or not anybody has room for it: it is only to be given up."""
    sql = (
        "SELECT delivery FROM deliveries WHERE state = 'waiting' AND expires_ns <= ?"
        f" ORDER BY expires_ns LIMIT ?{skip_locked(engine)}"
    )
    return _take(engine, [row[0] for row in engine.fetch(sql, now_ns, limit)], holder, now_ns + for_ns)


def extend(engine: StoreEngine, ids: Sequence[str], *, holder: str, until_ns: int) -> None:
    """Keep these leases longer; those that are not the holder's any more are none."""
    for some in slices(ids):
        sql = f"UPDATE deliveries SET until_ns = ? WHERE holder = ? AND delivery IN ({placeholders(len(some))})"
        engine.execute(sql, until_ns, holder, *some)


def settle(
    engine: StoreEngine,
    outcomes: Sequence[AttemptResult],
    *,
    holder: str,
    gateway: str,
    now_ns: int,
    limits: Limits = LIMITS,
) -> list[bool]:
    """End leases, and put what follows from that; whether each was still the holder's (else nothing of it happened)."""
    plan_anew(engine)
    sizes = _held(engine, outcomes, holder)
    ours = [outcome for outcome in outcomes if outcome.delivery.id in sizes]
    back = [outcome for outcome in ours if outcome.state == WAITING]
    dead = [outcome for outcome in ours if outcome.state == DEAD]
    done = [outcome for outcome in ours if outcome.state == DONE]
    engine.many(
        "UPDATE deliveries SET state = 'waiting', holder = '', until_ns = 0, due_ns = ?, attempts = ?, code = ?,"
        " message = ? WHERE delivery = ?",
        [(outcome.due_ns, outcome.attempts, outcome.code, outcome.message, outcome.delivery.id) for outcome in back],
    )
    engine.many(
        "UPDATE deliveries SET state = 'dead', holder = '', until_ns = 0, ended_ns = ?, attempts = ?, code = ?,"
        " message = ? WHERE delivery = ?",
        [(now_ns, outcome.attempts, outcome.code, outcome.message, outcome.delivery.id) for outcome in dead],
    )
    _finish(engine, [outcome for outcome in done if outcome.delivery.put.dedup], now_ns)
    forgotten = [(outcome.delivery.id,) for outcome in done if not outcome.delivery.put.dedup]
    engine.many("DELETE FROM deliveries WHERE delivery = ?", forgotten)
    ended = [*dead, *done]
    count(engine, gateway, LIVE, -len(ended), -sum(sizes[outcome.delivery.id] for outcome in ended))
    count(engine, gateway, DEAD_ROWS, len(dead), sum(sizes[outcome.delivery.id] for outcome in dead))
    count(engine, gateway, DONE_ROWS, len(done) - len(forgotten), 0)
    follows = [one for outcome in ours for one in outcome.puts]
    put(engine, follows, gateway=gateway, now_ns=now_ns, limits=limits, bounded=False)
    return [outcome.delivery.id in sizes for outcome in outcomes]


def reclaim(engine: StoreEngine, *, now_ns: int, limit: int) -> list[Ready]:
    """Let go of leases that ran out, since their gateways died or hang; what waits again."""
    sql = f"{_LEASED} AND until_ns <= ? LIMIT ?{skip_locked(engine)}"
    return _lose(engine, engine.fetch(sql, now_ns, limit), now_ns)


def needs_tending(engine: StoreEngine, *, now_ns: int) -> bool:
    """Whether a lease ran out, or something is too old."""
    sql = "SELECT 1 FROM deliveries WHERE {} LIMIT 1"
    return bool(
        engine.fetch(sql.format("state = 'leased' AND until_ns <= ?"), now_ns)
        or engine.fetch(sql.format("state = 'waiting' AND expires_ns <= ?"), now_ns)
    )


def release(engine: StoreEngine, *, gateway: str, holder: str, now_ns: int) -> list[Ready]:
    """Let go at once of what former lives of a gateway had leased; `holder` is its present one. What waits again."""
    life = f"{gateway}/"
    sql = f"{_LEASED} AND until_ns >= 0 AND holder <> ? AND substr(holder, 1, ?) = ?{skip_locked(engine)}"
    return _lose(engine, engine.fetch(sql, holder, len(life), life), now_ns)


def hand_back(engine: StoreEngine, *, holder: str) -> int:
    """Let go of everything that a holder has, which ends in good order: that is no loss. How many."""
    return engine.execute(
        "UPDATE deliveries SET state = 'waiting', holder = '', until_ns = 0"
        " WHERE state = 'leased' AND until_ns >= 0 AND holder = ?",
        holder,
    )


def delivery(engine: StoreEngine, delivery_id: str) -> Delivery | None:
    """One delivery, in whatever state; of one that is done the payload is not kept."""
    rows = engine.fetch(f"SELECT {COLUMNS} FROM deliveries WHERE delivery = ?", delivery_id)
    return delivery_of(rows[0]) if rows else None


def backlog(engine: StoreEngine, kind: str, target: str, *, most: int = 10_000) -> Backlog:
    """What a target has, counted up to `most` of each."""
    of = "FROM deliveries WHERE kind = ? AND target = ? AND state ="
    counts = [
        int(
            engine.fetch(f"SELECT count(*) FROM (SELECT 1 {of} '{state}'{more} LIMIT ?) AS n", kind, target, most)[0][0]
        )
        for state, more in (("waiting", ""), ("leased", " AND until_ns >= 0"), ("dead", " AND ended_ns >= 0"))
    ]
    oldest = engine.fetch(f"SELECT min(due_ns) {of} 'waiting'", kind, target)[0][0]
    return Backlog(waiting=counts[0], leased=counts[1], dead=counts[2], oldest_ns=int(oldest or 0))


def _known(engine: StoreEngine, keys: Sequence[tuple[str, str, str]]) -> dict[tuple[str, str, str], str]:
    """The deliveries of these kinds, targets and dedups."""
    known: dict[tuple[str, str, str], str] = {}
    if keys:
        plan_anew(engine)
    for some in slices(list(dict.fromkeys(keys))):
        values = ", ".join(["(CAST(? AS TEXT), CAST(? AS TEXT), CAST(? AS TEXT))"] * len(some))
        sql = (
            f"SELECT d.kind, d.target, d.dedup, d.delivery FROM (VALUES {values}) AS k JOIN deliveries d"
            " ON d.kind = k.column1 AND d.target = k.column2 AND d.dedup = k.column3 AND d.dedup <> ''"
        )
        for kind, target, dedup, found in engine.fetch(sql, *(text for key in some for text in key)):
            known[kind, target, dedup] = found
    return known


def _take(engine: StoreEngine, ids: Sequence[str], holder: str, until_ns: int) -> list[Delivery]:
    taken: list[Delivery] = []
    for some in slices(ids):
        sql = (
            "UPDATE deliveries SET state = 'leased', holder = ?, until_ns = ?, tries = tries + 1"
            f" WHERE delivery IN ({placeholders(len(some))}) RETURNING {COLUMNS}"
        )
        taken.extend(delivery_of(row) for row in engine.fetch(sql, holder, until_ns, *some))
    place = {found: index for index, found in enumerate(ids)}
    return sorted(taken, key=lambda one: place[one.id])


def _held(engine: StoreEngine, outcomes: Sequence[AttemptResult], holder: str) -> dict[str, int]:
    """The sizes of those that are the holder's still, and of the same lease."""
    tries = {outcome.delivery.id: outcome.delivery.tries for outcome in outcomes}
    sizes: dict[str, int] = {}
    for some in slices(sorted(tries)):
        sql = (
            "SELECT delivery, tries, size_bytes FROM deliveries WHERE state = 'leased' AND holder = ?"
            f" AND delivery IN ({placeholders(len(some))}){engine.for_update}"
        )
        sizes.update((row[0], row[2]) for row in engine.fetch(sql, holder, *some) if row[1] == tries[row[0]])
    return sizes


def _finish(engine: StoreEngine, outcomes: Sequence[AttemptResult], now_ns: int) -> None:
    """Remember that they are done, and nothing else of them."""
    engine.many(
        "UPDATE deliveries SET state = 'done', holder = '', until_ns = 0, ended_ns = ?, attempts = ?, code = '',"
        " message = ?, size_bytes = 0, context = '{}', payload = ? WHERE delivery = ?",
        [(now_ns, outcome.attempts, outcome.message, b"", outcome.delivery.id) for outcome in outcomes],
    )


def _lose(engine: StoreEngine, rows: Sequence[Row], now_ns: int) -> list[Ready]:
    due = [now_ns + _after_losses_ns(row[3] + 1) for row in rows]
    engine.many(
        "UPDATE deliveries SET state = 'waiting', holder = '', until_ns = 0, losses = losses + 1, due_ns = ?"
        " WHERE delivery = ?",
        [(due_ns, row[0]) for row, due_ns in zip(rows, due, strict=True)],
    )
    return [Ready(row[1], row[2], due_ns) for row, due_ns in zip(rows, due, strict=True)]


def _after_losses_ns(losses: int) -> int:
    return round(min(2.0 ** min(losses - QUICK_LOSSES, 10), LONGEST_S) * 1e9) if losses > QUICK_LOSSES else 0
