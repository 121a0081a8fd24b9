"""Users from an identity provider: created at the first sign-in, with the current role at each."""

from __future__ import annotations

import hashlib
import re

from gateway.domain.principal import EVERY_ROBOT, Role
from gateway.identity.errors import OidcRefusedError
from gateway.identity.oidc.client import Person
from gateway.identity.sessions import open_session, sweep
from gateway.identity.signin import SignedIn
from gateway.identity.users import change_user, create_user
from gateway.store.accounts import users
from gateway.store.engine import StoreEngine

__all__ = ["sign_in_person"]

_ODD = re.compile(r"[^a-z0-9._@+-]+")
NAME_CHARS = 48


def sign_in_person(
    engine: StoreEngine, person: Person, *, robots: tuple[str, ...], now_ns: int, address: str
) -> SignedIn:
    """Open a session for a person; inside a writing transaction of the caller's.

    A user that is there already under the same name keeps it: who has only a name in common gets another one, never
    somebody else's account.

    Raises:
        OidcRefusedError: the user is disabled here.
        LastAdminError: their groups take the role of the last admin away.
        TooManyError: there are too many users.
    """
    user = users.find_external(engine, person.external)
    policy = EVERY_ROBOT if person.role == Role.ADMIN else robots
    if user is None:
        user = create_user(
            engine,
            _free_name(engine, person),
            role=person.role,
            robots=policy,
            external=person.external,
            now_ns=now_ns,
        )
    elif user.disabled:
        raise OidcRefusedError("oidc_disabled", "this user is disabled here")
    elif user.role != person.role:
        user = change_user(engine, user.name, role=person.role, robots=policy)
    sweep(engine, now_ns=now_ns)
    users.change_user(engine, user.id, signed_in_ns=now_ns)
    return SignedIn(user, open_session(engine, user, now_ns=now_ns, address=address))


def _free_name(engine: StoreEngine, person: Person) -> str:
    """The person's name as ours are written; with a part of their subject's hash where somebody has it."""
    name = _ODD.sub("-", person.name.lower()).strip(".-_@+")[:NAME_CHARS] or "user"
    if users.find_user(engine, name) is None:
        return name
    return f"{name}.{hashlib.sha256(person.external.encode()).hexdigest()[:10]}"
