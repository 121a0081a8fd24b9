"""Sessions, sign-in links and failed sign-ins in the database, all found by hashes of what people hold.

Every function runs inside a transaction of the caller's.
"""

from __future__ import annotations

from typing import NamedTuple

from gateway.domain.account import Session, User
from gateway.store.accounts.users import USER_COLUMNS, user_of
from gateway.store.engine import StoreEngine, placeholders

__all__ = [
    "Failures",
    "add_link",
    "add_session",
    "clear_failures",
    "end_session",
    "end_sessions",
    "find_session",
    "read_failures",
    "sweep_sign_ins",
    "take_link",
    "touch_session",
    "write_failures",
]

LINKS_PER_USER = 16


class Failures(NamedTuple):
    """Failed sign-ins under one name from one address: how many, when the last was, and until when it is locked."""

    failures: int
    last_ns: int
    until_ns: int


def add_session(engine: StoreEngine, session: Session, *, keep: int) -> None:
    """Store a session; of the user's others the newest `keep` - 1 stay."""
    sql = "SELECT id FROM sessions WHERE user_id = ? ORDER BY created_ns DESC, id"
    for row in engine.fetch(sql, session.user_id)[keep - 1 :]:
        end_session(engine, row[0])
    engine.execute(
        f"INSERT INTO sessions (id, user_id, created_ns, seen_ns, expires_ns, address) VALUES ({placeholders(6)})",
        session.id,
        session.user_id,
        session.created_ns,
        session.seen_ns,
        session.expires_ns,
        session.address,
    )


def find_session(engine: StoreEngine, session_id: str) -> tuple[Session, User] | None:
    """A session and whose it is, expired or not."""
    rows = engine.fetch(
        "SELECT sessions.id, sessions.user_id, sessions.created_ns, sessions.seen_ns, sessions.expires_ns,"
        f" sessions.address, {USER_COLUMNS} FROM sessions JOIN users ON users.id = sessions.user_id"
        " WHERE sessions.id = ?",
        session_id,
    )
    if not rows:
        return None
    found, user = rows[0][:6], user_of(rows[0][6:])
    names = ("id", "user_id", "created_ns", "seen_ns", "expires_ns", "address")
    return Session(**dict(zip(names, found, strict=True))), user


def touch_session(engine: StoreEngine, session_id: str, *, now_ns: int) -> None:
    """It was used."""
    engine.execute("UPDATE sessions SET seen_ns = ? WHERE id = ?", now_ns, session_id)


def end_session(engine: StoreEngine, session_id: str) -> bool:
    """Sign out; False when there was no such session."""
    return bool(engine.execute("DELETE FROM sessions WHERE id = ?", session_id))


def end_sessions(engine: StoreEngine, user_id: str, *, but: str = "") -> int:
    """End all of a user's sessions except `but`, and take their sign-in links back; how many sessions ended."""
    engine.execute("DELETE FROM sign_in_links WHERE user_id = ?", user_id)
    return engine.execute("DELETE FROM sessions WHERE user_id = ? AND id <> ?", user_id, but)


def add_link(engine: StoreEngine, link_id: str, user_id: str, *, expires_ns: int) -> None:
    """Store a sign-in link; a user has at most LINKS_PER_USER."""
    sql = "SELECT id FROM sign_in_links WHERE user_id = ? ORDER BY expires_ns DESC, id"
    for row in engine.fetch(sql, user_id)[LINKS_PER_USER - 1 :]:
        engine.execute("DELETE FROM sign_in_links WHERE id = ?", row[0])
    sql = "INSERT INTO sign_in_links (id, user_id, expires_ns) VALUES (?, ?, ?)"
    engine.execute(sql, link_id, user_id, expires_ns)


def take_link(engine: StoreEngine, link_id: str, *, now_ns: int) -> User | None:
    """Use a link up: of many who try at once one gets its user, all others None."""
    rows = engine.fetch(
        f"SELECT {USER_COLUMNS} FROM sign_in_links JOIN users ON users.id = sign_in_links.user_id"
        " WHERE sign_in_links.id = ? AND expires_ns > ?",
        link_id,
        now_ns,
    )
    taken = engine.execute("DELETE FROM sign_in_links WHERE id = ?", link_id)
    return user_of(rows[0]) if rows and taken else None


def read_failures(engine: StoreEngine, who: str, address: str) -> Failures | None:
    """What failed under that name from that address."""
    sql = f"SELECT failures, last_ns, until_ns FROM login_failures WHERE who = ? AND address = ?{engine.for_update}"
    rows = engine.fetch(sql, who, address)
    return Failures(*rows[0]) if rows else None


def write_failures(engine: StoreEngine, who: str, address: str, state: Failures) -> None:
    """Remember it."""
    engine.execute(
        f"INSERT INTO login_failures (who, address, failures, last_ns, until_ns) VALUES ({placeholders(5)})"
        " ON CONFLICT (who, address) DO UPDATE SET failures = excluded.failures, last_ns = excluded.last_ns,"
        " until_ns = excluded.until_ns",
        who,
        address,
        *state,
    )


def clear_failures(engine: StoreEngine, who: str, address: str) -> None:
    """Somebody signed in."""
    engine.execute("DELETE FROM login_failures WHERE who = ? AND address = ?", who, address)


def sweep_sign_ins(engine: StoreEngine, *, now_ns: int, idle_ns: int, forget_ns: int, keep: int) -> None:
    """Delete what has expired; of failures at most the newest `keep` stay."""
    engine.execute("DELETE FROM sessions WHERE expires_ns <= ? OR seen_ns <= ?", now_ns, now_ns - idle_ns)
    engine.execute("DELETE FROM sign_in_links WHERE expires_ns <= ?", now_ns)
    engine.execute("DELETE FROM login_failures WHERE last_ns <= ?", now_ns - forget_ns)
    sql = "SELECT last_ns FROM login_failures ORDER BY last_ns DESC LIMIT 1 OFFSET ?"
    if rows := engine.fetch(sql, keep):
        engine.execute("DELETE FROM login_failures WHERE last_ns <= ?", rows[0][0])
