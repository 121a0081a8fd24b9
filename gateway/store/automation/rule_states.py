"""What rules remember between events, in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from gateway.domain.automation.rule import NextFire, RuleState
from gateway.store.engine import Row, StoreEngine, slices

__all__ = [
    "all_states",
    "count_states",
    "due_states",
    "forget_rule",
    "forget_states",
    "groups_of",
    "keep_states",
    "next_fires",
    "read_states",
    "write_fires",
]

_COLUMNS = "s.rule, s.grp, s.token, s.state, s.last, s.due_ns, s.revision"
_KEEP = """
    INSERT INTO rule_states AS s VALUES (?, ?, ?, ?, ?, ?, 1)
    ON CONFLICT (rule, grp) DO UPDATE SET token = excluded.token, state = excluded.state, last = excluded.last,
        due_ns = excluded.due_ns, revision = s.revision + 1 WHERE s.revision = ?
"""
_PUT_FIRE = """
    INSERT INTO rule_fires VALUES (?, ?, ?, ?)
    ON CONFLICT (rule) DO UPDATE SET token = excluded.token, next_ns = excluded.next_ns, last_ns = excluded.last_ns
"""


def read_states(engine: StoreEngine, keys: Sequence[tuple[str, str]]) -> dict[tuple[str, str], RuleState]:
    """What is remembered under (rule, group); nobody else changes it until the transaction is over."""
    found: dict[tuple[str, str], RuleState] = {}
    for some in slices(sorted(keys)):
        values = ", ".join(["(CAST(? AS TEXT), CAST(? AS TEXT))"] * len(some))
        rows = engine.fetch(
            f"SELECT {_COLUMNS} FROM (VALUES {values}) AS k JOIN rule_states s"
            f" ON s.rule = k.column1 AND s.grp = k.column2 ORDER BY s.rule, s.grp{_locked(engine)}",
            *(text for key in some for text in key),
        )
        found.update(((row[0], row[1]), _state(row)) for row in rows)
    return found


def all_states(engine: StoreEngine, *, limit: int) -> list[RuleState]:
    """Everything that is remembered; at most `limit` rows."""
    return [_state(row) for row in engine.fetch(f"SELECT {_COLUMNS} FROM rule_states s LIMIT ?", limit)]


def keep_states(engine: StoreEngine, states: Iterable[RuleState]) -> list[RuleState]:
    """Keep what is at the revision that it was read at; those that somebody else changed meanwhile are returned."""
    lost = []
    for item in sorted(states, key=lambda one: (one.rule, one.group)):
        row = (item.rule, item.group, item.token, item.state, item.last, item.due_ns, item.revision)
        if not engine.execute(_KEEP, *row):
            lost.append(item)
    return lost


def forget_states(engine: StoreEngine, keys: Collection[tuple[str, str]]) -> None:
    """Let go of what is at rest."""
    engine.many("DELETE FROM rule_states WHERE rule = ? AND grp = ?", sorted(keys))


def forget_rule(engine: StoreEngine, rule: str) -> None:
    """Let go of everything that a rule remembers."""
    engine.execute("DELETE FROM rule_states WHERE rule = ?", rule)


def due_states(engine: StoreEngine, *, now_ns: int, limit: int) -> list[RuleState]:
    """Those whose timer has run out, the longest first; nobody else changes them until the transaction is over."""
    rows = engine.fetch(
        f"SELECT {_COLUMNS} FROM rule_states s WHERE s.due_ns > 0 AND s.due_ns <= ?"
        f" ORDER BY s.due_ns LIMIT ?{_locked(engine)}",
        now_ns,
        limit,
    )
    return [_state(row) for row in rows]


def count_states(engine: StoreEngine) -> dict[str, int]:
    """How many groups each rule remembers something of."""
    return {row[0]: int(row[1]) for row in engine.fetch("SELECT rule, count(*) FROM rule_states GROUP BY rule")}


def groups_of(engine: StoreEngine, rule: str) -> int:
    """Of how many groups a rule remembers something."""
    return int(engine.fetch("SELECT count(*) FROM rule_states WHERE rule = ?", rule)[0][0])


def next_fires(engine: StoreEngine, *, until_ns: int | None = None, limit: int = 1 << 30) -> list[NextFire]:
    """When schedules fire; with `until_ns` those that are due by then, the longest first."""
    if until_ns is None:
        rows = engine.fetch("SELECT rule, token, next_ns, last_ns FROM rule_fires ORDER BY rule")
    else:
        sql = "SELECT rule, token, next_ns, last_ns FROM rule_fires WHERE next_ns > 0 AND next_ns <= ? ORDER BY next_ns"
        rows = engine.fetch(f"{sql} LIMIT ?{engine.for_update}", until_ns, limit)
    return [NextFire(rule=row[0], token=row[1], next_ns=row[2], last_ns=row[3]) for row in rows]


def write_fires(engine: StoreEngine, fires: Iterable[NextFire]) -> None:
    """Keep when schedules fire next."""
    engine.many(_PUT_FIRE, [(one.rule, one.token, one.next_ns, one.last_ns) for one in fires])


def _locked(engine: StoreEngine) -> str:
    return f"{engine.for_update} OF s" if engine.for_update else ""


def _state(row: Row) -> RuleState:
    return RuleState(rule=row[0], group=row[1], token=row[2], state=row[3], last=row[4], due_ns=row[5], revision=row[6])
