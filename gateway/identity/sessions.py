"""Sessions: a browser holds a token of 256 bits in a cookie, the database its hash.

The CSRF token is computed from the session's, so that it needs no room, and nobody who reads the database has it.
"""

from __future__ import annotations

from typing import NamedTuple

from gateway.domain.account import Session, User
from gateway.domain.principal import Principal
from gateway.identity.lockout import LOCKOUT, address_group
from gateway.identity.secret_text import new_secret, secret_hash
from gateway.store.accounts.sessions import add_session, sweep_sign_ins
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = ["NewSession", "csrf_of", "live", "open_session", "session_principal", "sweep"]

SECOND_NS = 10**9


class NewSession(NamedTuple):
    """A new session: what goes into the cookie, and what the page sends with every mutation."""

    token: str
    csrf: str


def open_session(engine: StoreEngine, user: User, *, now_ns: int, address: str = "") -> NewSession:
    """Sign a user in; the oldest of too many sessions ends."""
    token = new_secret()
    session = Session(
        id=secret_hash(token),
        user_id=user.id,
        created_ns=now_ns,
        seen_ns=now_ns,
        expires_ns=now_ns + round(LIMITS.session_s * SECOND_NS),
        address=address_group(address),
    )
    add_session(engine, session, keep=LIMITS.sessions_per_user)
    return NewSession(token, csrf_of(token))


def csrf_of(token: str) -> str:
    """The CSRF token that belongs to a session's token."""
    return secret_hash(f"csrf|{token}")


def live(session: Session, user: User, *, now_ns: int) -> bool:
    """Whether the session is still valid."""
    idle_ns = round(LIMITS.session_idle_s * SECOND_NS)
    return not user.disabled and now_ns < session.expires_ns and now_ns < session.seen_ns + idle_ns


def session_principal(session: Session, user: User, token: str) -> Principal:
    """Who a session's requests come from."""
    return Principal(
        kind="user",
        id=user.id,
        name=user.name,
        role=user.role,
        robots=user.robots,
        session_id=session.id,
        csrf=csrf_of(token),
    )


def sweep(engine: StoreEngine, *, now_ns: int) -> None:
    """Delete sessions, links and failures that count no more."""
    sweep_sign_ins(
        engine,
        now_ns=now_ns,
        idle_ns=round(LIMITS.session_idle_s * SECOND_NS),
        forget_ns=round(LOCKOUT.forget_s * SECOND_NS),
        keep=LIMITS.login_failures,
    )
