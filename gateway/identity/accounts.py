"""Accounts for the API: each call is one transaction, and a change is known to the authenticator at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from gateway.domain.account import ApiKey, User
from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.idempotency import IdempotentRequest
from gateway.domain.principal import Principal, Role
from gateway.errors import CredentialsError, ForbiddenError, InvalidRequestError, SignInError
from gateway.identity import keys, users
from gateway.identity.keys import KeyRequest, NewKey
from gateway.identity.master import MasterKey
from gateway.identity.oidc.client import Person
from gateway.identity.oidc.users import sign_in_person
from gateway.identity.passwords import Passwords, check_password
from gateway.identity.signin import (
    Link,
    SignedIn,
    begin_password,
    check_unchanged,
    end_password,
    follow_link,
    forget_failures,
    make_link,
)
from gateway.identity.store_authenticator import REMEMBERED_S, StoreAuthenticator
from gateway.store import Store
from gateway.store.accounts import api_keys
from gateway.store.accounts import users as accounts
from gateway.store.accounts.sessions import end_session
from gateway.store.engine import StoreEngine
from gateway.store.fleet.idempotency import made_before, remember_made
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Accounts"]

Result = TypeVar("Result")


class Accounts:
    """Users, sessions and keys of a running gateway."""

    def __init__(
        self,
        store: Store,
        authenticator: StoreAuthenticator,
        master: MasterKey,
        *,
        clock: Clock,
        passwords: Passwords | None = None,
    ) -> None:
        self.passwords = passwords or Passwords()
        self._store = store
        self._authenticator = authenticator
        self._master = master
        self._clock = clock
        self._secrets: dict[str, tuple[tuple[Principal, str], float]] = {}  # by the key's id, and until when

    async def sign_in(self, name: str, password: str, *, address: str) -> SignedIn:
        """Open a session for a name and its password.

        Raises:
            CredentialsError: one of them is wrong, or the user is disabled: which is not told, not even by the time.
            TooManyRequestsError: too many attempts failed, or too many passwords are being compared.
        """
        self.passwords.check_room()
        now_ns = self._clock.wall_ns()
        user = await self._store.run(lambda engine: begin_password(engine, name, address=address, now_ns=now_ns))
        good = await self.passwords.verify(user.password if user is not None else "", password)
        if user is None or not good:
            raise CredentialsError("the name or the password is wrong")
        new_hash = await self.passwords.hash(password) if self.passwords.outdated(user.password) else ""
        return await self._store.run(
            lambda engine: end_password(engine, user, name=name, address=address, now_ns=now_ns, new_hash=new_hash)
        )

    async def follow_link(self, token: str, *, address: str) -> SignedIn:
        """Open a session by a one-time link; CredentialsError when it is not good."""
        now_ns = self._clock.wall_ns()
        return await self._store.run(lambda engine: follow_link(engine, token, now_ns=now_ns, address=address))

    async def sign_in_person(self, person: Person, *, robots: tuple[str, ...], address: str) -> SignedIn:
        """Open a session for whom an identity provider has signed in, see `gateway.identity.oidc.users`."""
        now_ns = self._clock.wall_ns()
        return await self._change(
            lambda engine: sign_in_person(engine, person, robots=robots, now_ns=now_ns, address=address)
        )

    async def make_link(self, name: str = "") -> tuple[User, Link]:
        """A sign-in link for a user; without a name for the first admin, who is made where there is none."""

        def job(engine: StoreEngine) -> tuple[User, Link]:
            now_ns = self._clock.wall_ns()
            user = users.user_named(engine, name) if name else users.first_admin(engine, now_ns=now_ns)
            if user.disabled:
                raise InvalidRequestError(f"{user.name} is disabled")
            return user, make_link(engine, user, now_ns=now_ns)

        return await self._store.run(job)

    async def sign_out(self, principal: Principal) -> None:
        """End the session that asks."""
        await self._change(lambda engine: end_session(engine, principal.session_id))

    async def change_own_password(self, principal: Principal, old: str, new: str, *, address: str) -> None:
        """Set one's own password, and end one's other sessions. Who has none yet need not know it.

        Raises:
            CredentialsError: the old password is wrong.
            ForbiddenError: a key asks, or somebody who signs in elsewhere and would come in past that.
        """
        if principal.kind == "anonymous":
            raise SignInError("only who has signed in changes their password")
        if principal.kind != "user":
            raise ForbiddenError("a key has no password")
        self.passwords.check_room()
        now_ns = self._clock.wall_ns()
        check_password(new, name=principal.name)
        user = await self._store.run(
            lambda engine: begin_password(engine, principal.name, address=address, now_ns=now_ns)
        )
        if user is None or user.id != principal.id:
            raise CredentialsError("this user is gone")
        if user.external is not None and not user.password:
            raise ForbiddenError("who signs in elsewhere has no password here, unless an admin gives them one")
        if user.password and not await self.passwords.verify(user.password, old):
            raise CredentialsError("the old password is wrong")
        hashed = await self.passwords.hash(new)

        def job(engine: StoreEngine) -> None:
            check_unchanged(engine, user)  # an admin may have reset it meanwhile: that stays
            forget_failures(engine, principal.name, address=address)
            users.change_user(engine, principal.name, password_hash=hashed, but_session=principal.session_id)

        await self._change(job)

    async def has_password(self, principal: Principal) -> bool:
        """Whether who asks can sign in by a password; never so for keys, robots and nobody."""
        if principal.kind != "user":
            return False
        user = await self._read(lambda engine: accounts.get_user(engine, principal.id))
        return user is not None and bool(user.password)

    async def list_users(self) -> list[User]:
        """Everybody, by name."""
        return await self._read(lambda engine: accounts.list_users(engine, limit=LIMITS.users))

    async def create_user(
        self, name: str, *, role: Role, robots: tuple[str, ...], password: str, once: IdempotentRequest | None = None
    ) -> User:
        """Make a user, with a password or without; the same request under `once` is answered with who they are now."""
        hashed = await self._hashed(name, password) if password else ""
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> User:
            if before := made_before(engine, once):
                return users.user_of_id(engine, before)
            user = users.create_user(engine, name, role=role, robots=robots, password_hash=hashed, now_ns=now_ns)
            remember_made(engine, once, user.id, now_ns=now_ns)
            return user

        user = await self._change(job)
        if password and user.password != hashed and not await self.passwords.verify(user.password, password):
            raise IdempotencyConflictError("this Idempotency-Key was used with another password: take a new one")
        return user

    async def change_user(
        self,
        name: str,
        *,
        role: Role | None,
        robots: tuple[str, ...] | None,
        disabled: bool | None,
        password: str | None,
        check: Callable[[User], None] | None = None,
    ) -> User:
        """Change what is given, unless `check` of who they are now raises."""
        hashed = await self._hashed(name, password) if password is not None else None

        def job(engine: StoreEngine) -> User:
            if check is not None:
                check(users.user_named(engine, name))
            return users.change_user(engine, name, role=role, robots=robots, disabled=disabled, password_hash=hashed)

        return await self._change(job)

    async def get_user(self, name: str) -> User:
        """One user; UnknownUserError."""
        return await self._read(lambda engine: users.user_named(engine, name, lock=False))

    async def delete_user(self, name: str, *, check: Callable[[User], None] | None = None) -> User:
        """Delete a user with their sessions and keys, unless `check` of who they are now raises."""

        def job(engine: StoreEngine) -> User:
            if check is not None:
                check(users.user_named(engine, name))
            return users.delete_user(engine, name)

        return await self._change(job)

    async def list_keys(self, principal: Principal) -> list[tuple[ApiKey, str]]:
        """Keys with their users' names: one's own, or everybody's for an admin."""

        def job(engine: StoreEngine) -> list[tuple[ApiKey, str]]:
            everybody = principal.role >= Role.ADMIN
            found = api_keys.list_keys(engine, user_id=None if everybody else principal.id, limit=LIMITS.keys_listed)
            names = {user.id: user.name for user in accounts.list_users(engine, limit=LIMITS.users)}
            return [(key, names.get(key.user_id or "", "")) for key in found]

        return await self._read(job)

    async def create_key(self, principal: Principal, wanted: KeyRequest) -> NewKey:
        """Make a key for who asks. A key makes keys only as an admin: its user's, and none that outlives it.

        Raises:
            ForbiddenError: it would reach further than who asks.
            CredentialsError: who asks may not be here any more.
        """
        if principal.kind == "anonymous":
            raise SignInError("keys are made by who has signed in")
        if principal.kind != "user" and principal.role < Role.ADMIN:
            raise ForbiddenError("a key does not make keys: sign in")
        if principal.kind != "user" and not keys.covers(principal.robots, wanted.robots):
            raise ForbiddenError("the key would see robots that you do not see")
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> NewKey:
            maker = keys.maker_of(engine, principal, now_ns=now_ns)
            return keys.create_key(
                engine, wanted, owner=maker.user, master=self._master, now_ns=now_ns, until_ns=maker.until_ns
            )

        return await self._store.run(job)

    async def revoke_key(self, principal: Principal, key_id: str) -> ApiKey:
        """Delete one's own key, or for an admin anybody's; UnknownKeyError where there is none to delete."""
        only = None if principal.role >= Role.ADMIN else principal.id
        return await self._change(lambda engine: keys.revoke_key(engine, key_id, user_id=only))

    async def lambda_secret(self, key_id: str) -> tuple[Principal, str] | None:
        """Whose a key with the scope "lambda" is, and its secret, to check a signature with; None: there is none.

        Cached for a short time, as the authenticator does with good credentials.
        """
        known, until_s = self._secrets.get(key_id, (None, 0.0))
        if known is not None and self._clock.monotonic_s() < until_s:
            return known
        now_ns = self._clock.wall_ns()
        found = await self._read(lambda engine: keys.key_secret(engine, key_id, self._master, now_ns=now_ns))
        self._secrets.pop(key_id, None)
        if found is not None:
            while len(self._secrets) >= LIMITS.principals_remembered:
                self._secrets.pop(next(iter(self._secrets)))
            self._secrets[key_id] = found, self._clock.monotonic_s() + REMEMBERED_S
        return found

    def close(self) -> None:
        """Let the threads go."""
        self.passwords.close()

    async def _hashed(self, name: str, password: str) -> str:
        check_password(password, name=name)
        return await self.passwords.hash(password)

    async def _change(self, job: Callable[[StoreEngine], Result]) -> Result:
        try:
            return await self._store.run(job)
        finally:
            self._authenticator.forget()
            self._secrets.clear()

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._store.read(read)
