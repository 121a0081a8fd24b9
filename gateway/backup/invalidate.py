"""Invalidates what a restored, older store must not continue: sessions, tokens, running rollouts, version counters.

Rights and promises that had an end may have been used or taken back since, counters that others have seen must never
go back, and what was under way is not any more. What this cannot know is listed for whoever restores: see
docs/howto/back_up.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import orjson

from gateway.store.accounts.audit import AuditEvent, append
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import raise_versions

__all__ = ["RESTORED", "Invalidated", "invalidate"]

RESTORED = "restored"  # the key in `meta`
ONLINE_ROLES = ("snapshot", "timestamp")  # what the gateway signs itself, see gateway/fleet/updates/roles.py

_ENDED = (
    "DELETE FROM meta WHERE key LIKE 'hold/%'",  # the backup's own
    "DELETE FROM sign_in_links",
    "DELETE FROM gateways",
    "UPDATE presence SET online = 0",
    "UPDATE duties SET holder = '', until_ns = 0",
    "UPDATE deliveries SET until_ns = 0 WHERE state = 'leased'",
)
_OPEN_TOKENS = "UPDATE enrolment_tokens SET expires_ns = ? WHERE used_ns = 0 AND expires_ns > ?"
_RUNNING = (
    "UPDATE rollouts SET state = 'paused', reason = ?, changed_ns = ?, revision = revision + 1 WHERE state = 'running'"
)
# Seconds since the epoch are above any count of moves, and above those of a restore before this one.
_FENCES = "UPDATE node_leases SET epoch = ? WHERE epoch < ?"


@dataclass(frozen=True, slots=True, kw_only=True)
class Invalidated:
    """What was invalidated, and how many credentials are valid again as of the backup's time."""

    sessions: int
    tokens: int
    rollouts: int
    users: int
    keys: int
    robots: int


def invalidate(engine: StoreEngine, *, taken_ns: int, now_ns: int, taken: str, who: str) -> Invalidated:
    """Bring a restored store to today; inside a writing transaction. `taken`: the backup's time, for people; `who`
    restored it.
    """
    for statement in _ENDED:
        engine.execute(statement)
    sessions = engine.execute("DELETE FROM sessions")
    tokens = engine.execute(_OPEN_TOKENS, now_ns, now_ns)
    reason = f"the store was restored from a backup of {taken}: look at what the robots run, then resume"
    rollouts = engine.execute(_RUNNING, reason, now_ns)
    floor = now_ns // 10**9
    engine.execute(_FENCES, floor, floor)
    raise_versions(engine, ONLINE_ROLES, floor=floor, now_ns=now_ns)
    put = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"
    engine.execute(put, RESTORED, orjson.dumps({"taken_ns": taken_ns, "restored_ns": now_ns}).decode())
    append(engine, [_audited(now_ns, taken, who)])
    return Invalidated(
        sessions=sessions,
        tokens=tokens,
        rollouts=rollouts,
        users=_count(engine, "users WHERE disabled = 0"),
        keys=_count(engine, "api_keys"),
        robots=_count(engine, "robot_identities WHERE revoked_ns = 0"),
    )


def _count(engine: StoreEngine, what: str) -> int:
    return int(engine.fetch(f"SELECT count(*) FROM {what}")[0][0])


def _audited(now_ns: int, taken: str, who: str) -> AuditEvent:
    return AuditEvent(
        at_ns=now_ns,
        kind="local",
        actor="local",
        name=who,
        role="admin",
        action="store.restore",
        method="CLI",
        target=taken,
        status=200,
        detail="what was changed after this moment is not in the store any more",
    )
