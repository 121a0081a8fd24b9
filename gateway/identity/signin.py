"""Signing in: by name and password behind the lock-out, or by a link that works once."""

from __future__ import annotations

from typing import NamedTuple

from gateway.domain.account import User
from gateway.errors import CredentialsError
from gateway.identity.lockout import LOCKOUT, LockOut, address_group
from gateway.identity.secret_text import new_secret, secret_hash
from gateway.identity.sessions import NewSession, open_session, sweep
from gateway.identity.users import is_user_name
from gateway.store.accounts import users
from gateway.store.accounts.sessions import add_link, clear_failures, read_failures, take_link, write_failures
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = [
    "Link",
    "SignedIn",
    "begin_password",
    "check_unchanged",
    "end_password",
    "follow_link",
    "forget_failures",
    "make_link",
]

SECOND_NS = 10**9


class SignedIn(NamedTuple):
    """Who signed in, and the session."""

    user: User
    session: NewSession


class Link(NamedTuple):
    """A sign-in link's secret and until when it works."""

    token: str
    expires_ns: int


def begin_password(
    engine: StoreEngine, name: str, *, address: str, now_ns: int, lockout: LockOut = LOCKOUT
) -> User | None:
    """Count an attempt as failed, and find whose password is to be compared; None: nobody's, compare all the same.

    Raises:
        TooManyRequestsError: too many attempts failed under this name from this address.
    """
    sweep(engine, now_ns=now_ns)  # here, so that a flood of wrong names fills no disk
    who, where = secret_hash(name), address_group(address)
    write_failures(engine, who, where, lockout.attempt(read_failures(engine, who, where), now_ns=now_ns))
    return users.find_user(engine, name) if is_user_name(name) else None


def end_password(
    engine: StoreEngine, user: User, *, name: str, address: str, now_ns: int, new_hash: str = ""
) -> SignedIn:
    """The password was right: forget the failures and open a session; `new_hash` replaces the stored one.

    Raises:
        CredentialsError: the user was disabled, removed, or given another password meanwhile.
    """
    now = check_unchanged(engine, user)
    forget_failures(engine, name, address=address)
    if new_hash:
        users.change_user(engine, user.id, password=new_hash)
    return _signed_in(engine, now, now_ns=now_ns, address=address)


def check_unchanged(engine: StoreEngine, user: User) -> User:
    """The user as stored now; CredentialsError when disabled, removed, or given another password meanwhile."""
    now = users.find_user(engine, user.name)
    if now is None or now.id != user.id or now.disabled or now.password != user.password:
        raise CredentialsError("the name or the password is wrong")
    return now


def forget_failures(engine: StoreEngine, name: str, *, address: str) -> None:
    """Somebody knew the password."""
    clear_failures(engine, secret_hash(name), address_group(address))


def make_link(engine: StoreEngine, user: User, *, now_ns: int) -> Link:
    """A link that signs its user in once, within `sign_in_link_s`; only its hash is kept."""
    token = new_secret()
    expires_ns = now_ns + round(LIMITS.sign_in_link_s * SECOND_NS)
    add_link(engine, secret_hash(token), user.id, expires_ns=expires_ns)
    return Link(token, expires_ns)


def follow_link(engine: StoreEngine, token: str, *, now_ns: int, address: str) -> SignedIn:
    """Use a link up.

    Raises:
        CredentialsError: it is unknown, used or too old, or its user is disabled: which of them is not told.
    """
    user = take_link(engine, secret_hash(token), now_ns=now_ns)
    if user is None or user.disabled:
        raise CredentialsError("the sign-in link is not good any more\nmake another one with: metaros signin")
    return _signed_in(engine, user, now_ns=now_ns, address=address)


def _signed_in(engine: StoreEngine, user: User, *, now_ns: int, address: str) -> SignedIn:
    users.change_user(engine, user.id, signed_in_ns=now_ns)
    return SignedIn(user, open_session(engine, user, now_ns=now_ns, address=address))
