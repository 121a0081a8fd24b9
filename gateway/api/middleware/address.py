"""Where a request really comes from: its connection's other end, or what a trusted proxy says of it. Pure ASGI.

`Proxies` is the outermost part of the application. Behind it `scope["client"]` and `scope["scheme"]` are those of the
browser or program that asks, so nobody further in has to think of proxies; `scope[PROXIED_KEY]` says that one was
between. What an address that nobody trusts says in `X-Forwarded-…` changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from starlette.types import ASGIApp, Receive, Scope, Send

from gateway.api.problem import problem
from gateway.domain.networks import Network, is_within, read_address
from gateway.errors import ProxyOnlyError

__all__ = ["PROXIED_KEY", "Proxies", "client_address"]

PROXIED_KEY = "metaros.proxied"
PROBES = ("/healthz", "/readyz")  # asked by whoever looks after the machine, not by a proxy
MAX_HOPS = 32  # of X-Forwarded-For; a client may have written any number of them
REFUSED = 4403
_SCHEMES = {"http": ("http", "https"), "websocket": ("ws", "wss")}


def client_address(scope: Scope, trusted: Sequence[Network]) -> str:
    """Whom rates, the lock-out and the audit log count; "" where there is no address.

    That is the connection's other end, or, where that is a trusted proxy, the right-most entry of X-Forwarded-For
    that is no trusted proxy: all to the left of it anybody may have written.
    """
    client = scope.get("client")
    peer = read_address(client[0]) if client else None
    if peer is None:
        return client[0] if client else ""
    seen = peer
    if is_within(peer, trusted):
        for said in _hops(scope):
            hop = read_address(said)
            if hop is None:
                break  # nothing that a good proxy writes: who passed it on is all that is known
            seen = hop
            if not is_within(hop, trusted):
                break
    return str(seen)


class Proxies:
    """Puts the client's own address and scheme into the scope; with `only`, nobody but the proxies gets in."""

    def __init__(self, app: ASGIApp, trusted: Sequence[Network], *, only: bool = False) -> None:
        self._app = app
        self._trusted = trusted
        self._only = only

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Look at the connection, then pass on."""
        if scope["type"] not in _SCHEMES:
            await self._app(scope, receive, send)
            return
        client = scope.get("client")
        peer = read_address(client[0]) if client else None
        proxied = peer is not None and is_within(peer, self._trusted)
        if self._only and not proxied and not (scope["type"] == "http" and scope["path"] in PROBES):
            await _refuse(scope, receive, send, str(peer))
            return
        if proxied:
            scope = {**scope, PROXIED_KEY: True, "scheme": _scheme(scope)}
        if client and peer is not None:
            scope = {**scope, "client": (client_address(scope, self._trusted), client[1])}
        await self._app(scope, receive, send)


async def _refuse(scope: Scope, receive: Receive, send: Send, peer: str) -> None:
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": REFUSED, "reason": ProxyOnlyError.code})
        return
    error = ProxyOnlyError(f"this gateway has no TLS and takes requests of its proxies alone: {peer} is none of them")
    await problem(error)(scope, receive, send)


def _scheme(scope: Scope) -> str:
    """What the proxy's client spoke, by X-Forwarded-Proto; as it came where the proxy does not say."""
    plain, secure = _SCHEMES[scope["type"]]
    said = [value.split(b",")[-1].strip().lower() for key, value in scope["headers"] if key == b"x-forwarded-proto"]
    if said and said[-1] in (b"https", b"wss"):
        return secure
    return plain if said and said[-1] in (b"http", b"ws") else str(scope.get("scheme", plain))


def _hops(scope: Scope) -> Iterator[str]:
    """The entries of X-Forwarded-For, the nearest first."""
    lines = [value.decode("latin-1") for key, value in scope["headers"] if key == b"x-forwarded-for"]
    entries = ",".join(lines).rsplit(",", MAX_HOPS) if lines else []
    for entry in reversed(entries[-MAX_HOPS:]):
        yield entry.strip()
