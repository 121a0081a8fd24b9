"""Who asks: the credential of every request and socket turned into a principal. Pure ASGI, inside Guard.

`Authorization: Bearer mrk_…`, else of a socket the subprotocol `metaros.key.<key>`, of a viewer's socket `?token=` (a
key or a ticket), else the cookie `metaros_session`, else nobody. A credential that is not good is remembered, not
answered: a page with an expired cookie must still load and be able to sign in, so `require_permission` refuses it
wherever more is asked than what is public.

Nobody is a viewer on this very machine, if the settings say so: the connection comes from a loopback address, by a
loopback name, and no proxy says that it passes on somebody else's.
"""

from __future__ import annotations

from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Literal

from starlette.types import ASGIApp, Receive, Scope, Send

from gateway.api.authorization import BY_COOKIE_KEY, CREDENTIAL_KEY, PRINCIPAL_KEY, REFUSAL_KEY
from gateway.api.middleware.address import PROXIED_KEY
from gateway.api.middleware.guard import LOOPBACK_NAMES
from gateway.api.middleware.rate import Rates, address_of
from gateway.api.viewer_endpoints import TOKEN_KEY, needs_principal
from gateway.api.webhook_path import is_webhook
from gateway.domain.networks import is_loopback_address
from gateway.domain.principal import NOBODY, Principal, anonymous_viewer
from gateway.errors import CredentialsError
from gateway.identity.authenticator import Authenticator
from gateway.identity.tickets import is_ticket
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["COOKIE", "PROTOCOL", "Authenticate", "Credential", "identify", "is_local", "plain_protocol"]

COOKIE = "metaros_session"
KEY_PROTOCOL = "metaros.key."  # a browser's WebSocket has no other place for a key than a subprotocol
PROTOCOL = (
    "metaros.v1"  # what the server chooses of the offered ones: browsers insist on one, and it must not be the key
)
_FORWARDED = (b"forwarded", b"via", b"x-forwarded-for", b"x-forwarded-host", b"x-forwarded-proto", b"x-real-ip")


@dataclass(frozen=True, slots=True)
class Credential:
    """What came with a request; kept as long as a socket is open, to ask again."""

    kind: Literal["key", "ticket", "session"]
    text: str

    def __repr__(self) -> str:
        return f"Credential({self.kind})"  # never the secret: this may end in a log


async def identify(authenticator: Authenticator, credential: Credential) -> Principal | None:
    """Whose it is now; None when it is not good, or not any more."""
    if not credential.text or len(credential.text) > LIMITS.credential_chars:
        return None
    if credential.kind == "session":
        return await authenticator.by_session(credential.text)
    if is_ticket(credential.text) and credential.kind != "ticket":
        return None  # a ticket opens viewers' sockets, nothing else
    return await authenticator.by_key(credential.text)


class Authenticate:
    """Puts the principal, or why there is none, into the scope."""

    def __init__(
        self,
        app: ASGIApp,
        authenticator: Authenticator,
        *,
        anonymous: bool,
        host: str = "127.0.0.1",
        rates: Rates | None = None,
    ) -> None:
        """`rates` bound how many credentials that are not good one address may try."""
        self._app = app
        self._rates = rates
        self._authenticator = authenticator
        self._anonymous = anonymous
        self._names = {*LOOPBACK_NAMES, f"[{host}]" if ":" in host else host.lower()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Find out, then pass on."""
        if scope["type"] in ("http", "websocket") and needs_principal(scope["path"]) and PRINCIPAL_KEY not in scope:
            scope.setdefault("state", {})
            scope[PRINCIPAL_KEY] = NOBODY
            try:
                scope[PRINCIPAL_KEY] = await self._who(scope)
            except MetarosError as error:  # not good, or the store cannot say now
                scope[REFUSAL_KEY] = error
        await self._app(scope, receive, send)

    async def _who(self, scope: Scope) -> Principal:
        credential, by_cookie = _credential(scope)
        if credential is None:
            return anonymous_viewer() if self._anonymous and self._local(scope) else NOBODY
        address = address_of(scope)
        if self._rates is not None:
            self._rates.check("refused", address)  # before the store is asked
        found = await identify(self._authenticator, credential)
        if found is None:
            if self._rates is not None:
                self._rates.count("refused", address)
            raise CredentialsError(f"this {credential.kind} is not good: wrong, expired or revoked")
        scope[CREDENTIAL_KEY], scope[BY_COOKIE_KEY] = credential, by_cookie
        return found

    def _local(self, scope: Scope) -> bool:
        if not is_local(scope):
            return False
        host = next((value.decode("latin-1").lower() for key, value in scope["headers"] if key == b"host"), "")
        name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
        return name in self._names


def is_local(scope: Scope) -> bool:
    """Whether a connection comes from this very machine, and no proxy says that it passes on somebody else's."""
    client = scope.get("client")
    if client is None or scope.get(PROXIED_KEY):
        return False
    return is_loopback_address(client[0]) and not any(key in _FORWARDED for key, _ in scope["headers"])


def plain_protocol(scope: Scope) -> str | None:
    """The subprotocol to accept a socket with: never the one that carries a key."""
    return PROTOCOL if PROTOCOL in scope.get("subprotocols", ()) else None


def _credential(scope: Scope) -> tuple[Credential | None, bool]:
    """The credential, and whether it is a cookie; CredentialsError for one that cannot be read."""
    said = [value.decode("latin-1") for key, value in scope["headers"] if key == b"authorization"]
    if said:
        scheme, _, text = said[0].partition(" ")
        if len(said) > 1 or scheme.lower() != "bearer" or TOKEN_KEY in scope:
            raise CredentialsError("Authorization is Bearer and a key, once")
        if is_webhook(scope):
            return None, False  # what it proves itself by is the hook's business
        return Credential("key", text.strip()), False
    offered = [name for name in scope.get("subprotocols", ()) if name.startswith(KEY_PROTOCOL)]
    tokens: list[str] = scope.get(TOKEN_KEY, [])
    if len(offered) + len(tokens) > 1:
        raise CredentialsError("one key at a time")
    if offered:
        return Credential("key", offered[0].removeprefix(KEY_PROTOCOL)), False
    if tokens:
        return Credential("ticket" if is_ticket(tokens[0]) else "key", tokens[0]), False
    token = _cookie(scope)
    return (None, False) if token is None else (Credential("session", token), True)


def _cookie(scope: Scope) -> str | None:
    """The session cookie's value; None where none was sent."""
    found: list[str] = []
    for key, value in scope["headers"]:
        if key != b"cookie" or COOKIE.encode() not in value:
            continue
        try:
            jar = SimpleCookie(value.decode("latin-1"))
        except CookieError as error:
            raise CredentialsError("the cookie cannot be read") from error
        if COOKIE in jar:
            found.append(jar[COOKIE].value)
    if len(set(found)) > 1:
        raise CredentialsError("one session at a time")
    return found[0] if found else None
