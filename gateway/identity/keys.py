"""API keys: `mrk_<id>_<secret>`, both hexadecimal; the rules about who gives which rights away.

A key never reaches further than whoever made it: not in its role, not in its robots. It works as long as its user
does. Every function on an engine runs inside a transaction of the caller's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from gateway.domain.account import LAMBDA, SCOPES, ApiKey, User
from gateway.domain.principal import EVERY_ROBOT, Principal, Role
from gateway.errors import CredentialsError, ForbiddenError, InvalidRequestError, TooManyError
from gateway.identity.errors import UnknownKeyError
from gateway.identity.master import MasterKey
from gateway.identity.secret_text import new_id, new_secret, secret_hash
from gateway.store.accounts import api_keys
from gateway.store.accounts.users import find_user, get_user
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = [
    "KeyRequest",
    "Maker",
    "NewKey",
    "check_reach",
    "covers",
    "create_key",
    "drop_uncovered_keys",
    "key_principal",
    "key_secret",
    "key_text",
    "maker_of",
    "parse_key",
    "revoke_key",
]

LOCAL_ID = "local"  # of the key in the data directory, see local.py; it is no key of the store's
PURPOSE = "api-key"  # under which secrets of keys are sealed
SECOND_NS = 10**9
_TEXT = re.compile(r"mrk_([0-9a-f]{16})_([0-9a-f]{64})")


class NewKey(NamedTuple):
    """A key and its secret, which is told this once."""

    key: ApiKey
    secret: str

    @property
    def text(self) -> str:
        """What goes behind "Authorization: Bearer"."""
        return key_text(self.key.id, self.secret)


class KeyRequest(NamedTuple):
    """A key that somebody wants; `expires_s` None: it never expires."""

    name: str
    role: Role
    robots: tuple[str, ...] = EVERY_ROBOT
    scopes: frozenset[str] = frozenset()
    expires_s: float | None = None


class Maker(NamedTuple):
    """Whose a new key will be (None: nobody's), and until when it may live at the longest; 0: for ever."""

    user: User | None
    until_ns: int = 0


def maker_of(engine: StoreEngine, principal: Principal, *, now_ns: int) -> Maker:
    """Who makes a key, as of this very transaction; nobody takes rights from them until it is over.

    Raises:
        CredentialsError: they may not be here any more, or not do any more what the principal says.
    """
    if principal.kind == "user":
        known = get_user(engine, principal.id)
        user = find_user(engine, known.name) if known is not None else None  # locks the row
        if user is None or user.id != principal.id or user.disabled:
            raise CredentialsError("this user is gone")
        return Maker(user)
    found = api_keys.key_and_owner(engine, principal.id)
    if found is None and principal.id == LOCAL_ID:
        return Maker(None)
    key, owner = found if found is not None else (None, None)
    owner = find_user(engine, owner.name) if owner is not None else None
    now = key_principal(key, owner, now_ns=now_ns) if key is not None else None
    if key is None or now is None or now.role < principal.role:
        raise CredentialsError("this key is not good any more")
    return Maker(owner, key.expires_ns)


def key_text(key_id: str, secret: str) -> str:
    """A key as it is sent."""
    return f"mrk_{key_id}_{secret}"


def parse_key(text: str) -> tuple[str, str] | None:
    """A key's id and secret; None for text that is no key."""
    match = _TEXT.fullmatch(text)
    return (match[1], match[2]) if match is not None else None


def create_key(
    engine: StoreEngine,
    wanted: KeyRequest,
    *,
    owner: User | None,
    master: MasterKey | None,
    now_ns: int,
    until_ns: int = 0,
) -> NewKey:
    """Make a key for `owner`; None: for nobody, by whoever has the gateway's data. `master` is needed for "lambda".

    It ends at `until_ns` at the latest, unless that is 0.

    Raises:
        InvalidRequestError: the name, a scope or the life does not fit.
        ForbiddenError: the owner may not do all that the key should.
        TooManyError: the owner has too many keys.
    """
    _check(wanted)
    if owner is not None:
        if wanted.role > owner.role:
            raise ForbiddenError(
                f"a key of the role {wanted.role.word} is beyond {owner.name}, who is {owner.role.word}"
            )
        if not covers(owner.robots, wanted.robots):
            raise ForbiddenError(f"the key would see robots that {owner.name} does not see")
    owner_id = owner.id if owner is not None else None
    if api_keys.count_keys(engine, owner_id) >= LIMITS.keys_per_user:
        raise TooManyError(f"there are {LIMITS.keys_per_user} keys already: revoke one")
    secret, key_id = new_secret(), new_id()
    sealed = None
    if LAMBDA in wanted.scopes:
        if master is None:
            raise InvalidRequestError("a key with the scope lambda needs the gateway's master key")
        sealed = master.seal(PURPOSE, key_id, secret.encode())
    key = ApiKey(
        id=key_id,
        name=wanted.name,
        user_id=owner_id,
        role=wanted.role,
        robots=wanted.robots,
        scopes=wanted.scopes,
        secret_hash=secret_hash(secret),
        sealed=sealed,
        created_ns=now_ns,
        expires_ns=_end(wanted, now_ns=now_ns, until_ns=until_ns),
    )
    api_keys.add_key(engine, key)
    return NewKey(key, secret)


def revoke_key(engine: StoreEngine, key_id: str, *, user_id: str | None = None) -> ApiKey:
    """Delete a key; with `user_id`, one of that user's. UnknownKeyError where there is none."""
    found = api_keys.find_key(engine, key_id) if re.fullmatch(r"[0-9a-f]{16}", key_id) else None
    if found is None or (user_id is not None and found.user_id != user_id):
        raise UnknownKeyError("there is no such key")
    api_keys.remove_key(engine, key_id)
    return found


def key_secret(engine: StoreEngine, key_id: str, master: MasterKey, *, now_ns: int) -> tuple[Principal, str] | None:
    """Whose a key with the scope "lambda" is, and its secret, to check a signature with; None where there is none.

    Raises:
        DamagedError: the secret was sealed under another master key.
    """
    found = api_keys.key_and_owner(engine, key_id) if re.fullmatch(r"[0-9a-f]{16}", key_id) else None
    principal = key_principal(*found, now_ns=now_ns) if found is not None else None
    if found is None or principal is None or found[0].sealed is None:
        return None
    return principal, master.open(PURPOSE, key_id, found[0].sealed).decode()


def key_principal(key: ApiKey, owner: User | None, *, now_ns: int) -> Principal | None:
    """Who a key's requests come from; None when it has expired, or its user may not sign in any more."""
    expired = key.expires_ns != 0 and now_ns >= key.expires_ns
    orphan = key.user_id is not None and (owner is None or owner.disabled)
    if expired or orphan:
        return None
    role = key.role if owner is None else min(key.role, owner.role)
    return Principal(kind="key", id=key.id, name=key.name, role=role, robots=key.robots, scopes=key.scopes)


def covers(wide: Iterable[str], narrow: Iterable[str]) -> bool:
    """Whether whoever sees `wide` sees all of `narrow`, for certain.

    A pattern is covered by itself or by `*`; the id of one robot also by any pattern that it fits.
    """
    wider = tuple(wide)
    seeing = Principal(kind="user", robots=wider)
    return all("*" in wider or item in wider or ("*" not in item and seeing.sees(item)) for item in narrow)


def drop_uncovered_keys(engine: StoreEngine, user: User) -> list[str]:
    """Delete the user's keys that reach further than the user by now; their ids."""
    gone = []
    for key in api_keys.list_keys(engine, user_id=user.id, limit=LIMITS.keys_per_user):
        if key.role > user.role or not covers(user.robots, key.robots):
            api_keys.remove_key(engine, key.id)
            gone.append(key.id)
    return gone


def check_reach(role: Role, robots: Iterable[str]) -> None:
    """InvalidRequestError for an admin of some robots only: who manages users could make one who sees the others."""
    if role >= Role.ADMIN and "*" not in robots:
        raise InvalidRequestError("an admin sees every robot: leave the robots out, or choose another role")


def _end(wanted: KeyRequest, *, now_ns: int, until_ns: int) -> int:
    own_ns = 0 if wanted.expires_s is None else now_ns + round(wanted.expires_s * SECOND_NS)
    return min(own_ns, until_ns) if own_ns and until_ns else own_ns or until_ns


def _check(wanted: KeyRequest) -> None:
    check_reach(wanted.role, wanted.robots)
    if not 1 <= len(wanted.name) <= 64 or not wanted.name.isprintable():
        raise InvalidRequestError("a key's name has 1 to 64 printable characters")
    if unknown := wanted.scopes - set(SCOPES):
        raise InvalidRequestError(f"no scope {sorted(unknown)[0][:40]!r}: {', '.join(SCOPES)}")
    most_s = LIMITS.key_life_s
    if wanted.expires_s is not None and not 1.0 <= wanted.expires_s <= most_s:
        raise InvalidRequestError(f"a key lives for 1 s to {most_s / 86_400:.0f} days, or for ever")
