"""The rules about users: their names, and that somebody can always look after the gateway.

Every function runs inside a transaction of the caller's, in the gateway or on a data directory beside it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from gateway.domain.account import User
from gateway.domain.principal import EVERY_ROBOT, Role, check_robots
from gateway.errors import InvalidRequestError, TooManyError
from gateway.identity.errors import LastAdminError, UnknownUserError, UserExistsError
from gateway.identity.keys import check_reach, drop_uncovered_keys
from gateway.identity.secret_text import new_id
from gateway.store.accounts import users as accounts
from gateway.store.accounts.sessions import end_sessions
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = [
    "FIRST_ADMIN",
    "change_user",
    "checked_robots",
    "create_user",
    "delete_user",
    "first_admin",
    "is_user_name",
    "user_named",
]

FIRST_ADMIN = "admin"
_NAME = re.compile(r"[a-z0-9][a-z0-9._@+-]{0,63}")


def is_user_name(text: str) -> bool:
    """Whether a user may be called so: lower-case letters, digits and . _ @ + -, at most 64."""
    return _NAME.fullmatch(text) is not None


def create_user(
    engine: StoreEngine,
    name: str,
    *,
    role: Role,
    robots: Iterable[str] = EVERY_ROBOT,
    password_hash: str = "",
    external: str | None = None,
    now_ns: int,
) -> User:
    """Make a user; without a password they sign in by a link.

    Raises:
        InvalidRequestError: the name or a pattern of robots does not fit.
        UserExistsError: the name is taken.
        TooManyError: there are too many users.
    """
    if not is_user_name(name):
        raise InvalidRequestError("a user's name has 1 to 64 lower-case letters, digits or . _ @ + -")
    check_reach(role, robots := checked_robots(robots))
    user = User(
        id=new_id(),
        name=name,
        role=role,
        robots=robots,
        password=password_hash,
        external=external,
        created_ns=now_ns,
    )
    if len(accounts.list_users(engine, limit=LIMITS.users)) >= LIMITS.users:
        raise TooManyError(f"there are {LIMITS.users} users already")
    if not accounts.add_user(engine, user):
        raise UserExistsError(f"there is a user {name!r} already")
    return user


def user_named(engine: StoreEngine, name: str, *, lock: bool = True) -> User:
    """The user, whom nobody else changes meanwhile unless `lock` is False; UnknownUserError where there is none."""
    found = accounts.find_user(engine, name, lock=lock) if is_user_name(name) else None
    if found is None:
        raise UnknownUserError(f"there is no user {name[:64]!r}")
    return found


def user_of_id(engine: StoreEngine, user_id: str) -> User:
    """The user; UnknownUserError where they are gone."""
    found = accounts.get_user(engine, user_id)
    if found is None:
        raise UnknownUserError("this user was made, and is gone")
    return found


def change_user(
    engine: StoreEngine,
    name: str,
    *,
    role: Role | None = None,
    robots: Iterable[str] | None = None,
    disabled: bool | None = None,
    password_hash: str | None = None,
    but_session: str = "",
) -> User:
    """Change what is given.

    A new password or a disabled user ends their sessions (except `but_session`); keys that reach further than their
    user may from now on are deleted.

    Raises:
        UnknownUserError: there is no such user.
        LastAdminError: nobody could look after the gateway any more.
    """
    loses = (role is not None and role < Role.ADMIN) or disabled is True
    user = _not_the_last(engine, name) if loses else user_named(engine, name)
    kept = checked_robots(robots) if robots is not None else None
    check_reach(user.role if role is None else role, user.robots if kept is None else kept)
    values: dict[str, Any] = {
        "role": role,
        "robots": kept,
        "disabled": disabled,
        "password": password_hash,
    }
    accounts.change_user(engine, user.id, **{key: value for key, value in values.items() if value is not None})
    if password_hash is not None or disabled:
        end_sessions(engine, user.id, but=but_session)
    changed = user_named(engine, name)
    drop_uncovered_keys(engine, changed)
    return changed


def delete_user(engine: StoreEngine, name: str) -> User:
    """Delete a user with their sessions and keys; who it was. Raises like `change_user`."""
    user = _not_the_last(engine, name)
    accounts.remove_user(engine, user.id)
    return user


def first_admin(engine: StoreEngine, *, now_ns: int) -> User:
    """An admin who may sign in: the one there is, or one made now, without a password."""
    users = accounts.list_users(engine, limit=LIMITS.users)
    admins = [user for user in users if user.role == Role.ADMIN and not user.disabled]
    named = [user for user in admins if user.name == FIRST_ADMIN]
    if admins:
        return (named or admins)[0]
    taken = {user.name for user in users}
    free = next(name for number in range(len(taken) + 1) if (name := f"{FIRST_ADMIN}{number or ''}") not in taken)
    return create_user(engine, free, role=Role.ADMIN, now_ns=now_ns)


def checked_robots(robots: Iterable[str]) -> tuple[str, ...]:
    """Patterns as they are stored; InvalidRequestError for one that is none."""
    try:
        kept = check_robots(robots)
    except ValueError as error:
        raise InvalidRequestError(str(error)) from error
    if len(kept) > LIMITS.robot_patterns or any(len(item) > LIMITS.ros_name_chars for item in kept):
        raise InvalidRequestError(
            f"at most {LIMITS.robot_patterns} patterns of robots, each of at most {LIMITS.ros_name_chars} characters"
        )
    return kept


def _not_the_last(engine: StoreEngine, name: str) -> User:
    """The user; LastAdminError when no other admin may sign in. All admins are locked first, in one order."""
    admins = accounts.count_admins(engine)
    user = user_named(engine, name)
    if user.role == Role.ADMIN and not user.disabled and admins == 1:
        raise LastAdminError(f"{user.name} is the last admin: make another one first")
    return user
