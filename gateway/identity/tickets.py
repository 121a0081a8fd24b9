"""Tickets: bearer tokens for about an hour with at most their maker's rights, for a viewer's URL.

A ticket reads `mrt_PAYLOAD.MAC`: whose it is, the role and robots it has at most, and when it ends, under an HMAC whose
key lies in the store's `meta`, so that it is good at every gateway of the store and nothing of it is stored. It opens
viewers' sockets and nothing else. Whenever it is asked for, its maker is looked up: it may do no more than they still
may, and it ends with them.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
from collections.abc import Iterable
from dataclasses import dataclass, field

import orjson

from gateway.domain.account import User
from gateway.domain.principal import EVERY_ROBOT, Principal, Role
from gateway.errors import ForbiddenError, InvalidRequestError
from gateway.identity.errors import UnknownUserError
from gateway.identity.keys import LOCAL_ID, covers, key_principal
from gateway.identity.users import checked_robots
from gateway.store import Store
from gateway.store.accounts.api_keys import key_and_owner
from gateway.store.accounts.users import get_user
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import fetch_secret
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Ticket", "Tickets", "is_ticket"]

_PREFIX = "mrt_"
_CONTEXT = b"metaros viewer ticket 1|"
_SECOND_NS = 10**9
_KINDS = ("user", "key")


def is_ticket(text: str) -> bool:
    """Whether a credential looks like a ticket, good or not."""
    return text.startswith(_PREFIX)


@dataclass(frozen=True, slots=True)
class Ticket:
    """A new ticket and when it ends, in nanoseconds since 1970."""

    text: str = field(repr=False)
    expires_ns: int


@dataclass(frozen=True, slots=True)
class _Claims:
    """What a ticket says."""

    kind: str
    maker: str
    role: Role
    robots: tuple[str, ...]
    ends_s: int


class Tickets:
    """Makes tickets, and authenticates them; `load` before either."""

    def __init__(self, store: Store, *, clock: Clock) -> None:
        self._store = store
        self._clock = clock
        self._secret = b""

    async def load(self) -> None:
        """Learn the store's secret, or make it."""
        fresh = secrets.token_hex(32)
        self._secret = bytes.fromhex(await self._store.run(lambda engine: fetch_secret(engine, fresh)))

    async def make(self, maker: Principal, *, role: Role, robots: Iterable[str] | None, ttl_s: float) -> Ticket:
        """A ticket of the maker's rights or fewer; `robots` None: all that the maker sees.

        Raises:
            InvalidRequestError: a pattern is none, the life is too long, or the patterns are too many for a URL.
            ForbiddenError: the maker may not do all that, or may make none.
            UnknownUserError: the maker is gone.
        """
        if maker.kind not in _KINDS:
            raise ForbiddenError("a ticket is made by somebody with a user or a key")
        if not 1.0 <= ttl_s <= LIMITS.ticket_s:
            raise InvalidRequestError(f"ttl_s is 1 to {LIMITS.ticket_s:g}")
        wanted = maker.robots if robots is None else checked_robots(robots)
        if not wanted:
            raise InvalidRequestError("robots has one pattern at least")
        if role > maker.role:
            raise ForbiddenError(f"a ticket of the role {role.word} is beyond {maker.name}, who is {maker.role.word}")
        if not covers(maker.robots, wanted):
            raise ForbiddenError(f"the ticket would see robots that {maker.name} does not see")
        if await self._maker(maker.kind, maker.id) is None:
            raise UnknownUserError("whoever makes a ticket has to be a user, or have a key, of the store")
        ends_s = self._clock.wall_ns() // _SECOND_NS + round(ttl_s)
        text = self._text(_Claims(maker.kind, maker.id, role, wanted, ends_s))
        if len(text) > LIMITS.credential_chars:
            raise InvalidRequestError("robots has too many patterns for a ticket: it has to fit into a URL")
        return Ticket(text, ends_s * _SECOND_NS)

    async def by_key(self, text: str) -> Principal | None:
        """Who comes with a ticket; None where it is none, or not good any more."""
        claims = self._claims(text) if self._secret and is_ticket(text) else None
        if claims is None or claims.ends_s <= self._clock.wall_ns() // _SECOND_NS:
            return None
        maker = await self._maker(claims.kind, claims.maker)
        if maker is None or not covers(maker.robots, claims.robots):
            return None
        role = min(claims.role, maker.role)
        return Principal(kind=maker.kind, id=maker.id, name=f"{maker.name} (ticket)", role=role, robots=claims.robots)

    async def by_session(self, token: str) -> Principal | None:
        """A ticket is no session."""
        return None

    async def _maker(self, kind: str, maker_id: str) -> Principal | None:
        """Who made it, as of now."""
        now_ns = self._clock.wall_ns()

        def read(engine: StoreEngine) -> Principal | None:
            with engine.transaction(write=False):
                if kind == "user":
                    user = get_user(engine, maker_id)
                    return _person(user) if user is not None and not user.disabled else None
                found = key_and_owner(engine, maker_id)
                return key_principal(*found, now_ns=now_ns) if found is not None else None

        if kind == "key" and maker_id == LOCAL_ID:  # of who reads the gateway's own files, and could make any ticket
            return Principal(kind="key", id=LOCAL_ID, name=LOCAL_ID, role=Role.ADMIN, robots=EVERY_ROBOT)
        return await self._store.read(read)

    def _text(self, claims: _Claims) -> str:
        said = [claims.kind, claims.maker, int(claims.role), claims.robots, claims.ends_s]
        payload = base64.urlsafe_b64encode(orjson.dumps(said)).rstrip(b"=").decode()
        return f"{_PREFIX}{payload}.{self._mac(payload)}"

    def _claims(self, text: str) -> _Claims | None:
        """What a ticket with a good MAC says; nothing that anybody else wrote is taken apart."""
        payload, _, mac = text.removeprefix(_PREFIX).partition(".")
        if not text.isascii() or not hmac.compare_digest(mac, self._mac(payload)):
            return None
        kind, maker, role, robots, ends_s = orjson.loads(base64.urlsafe_b64decode(payload + "=" * (-len(payload) % 4)))
        return _Claims(kind, maker, Role(role), tuple(robots), ends_s)

    def _mac(self, payload: str) -> str:
        mac = hmac.new(self._secret, _CONTEXT + payload.encode(), hashlib.sha256).digest()
        return base64.urlsafe_b64encode(mac[:24]).decode()


def _person(user: User) -> Principal:
    return Principal(kind="user", id=user.id, name=user.name, role=user.role, robots=user.robots)
