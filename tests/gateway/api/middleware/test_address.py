"""Whose request it is: the connection's other end, or whom a trusted proxy names; nobody else can name anybody."""

from __future__ import annotations

from typing import Any

from gateway.api.middleware.address import PROXIED_KEY, Proxies, client_address
from gateway.api.middleware.authenticate import is_local
from gateway.domain.networks import parse_networks

TRUSTED = parse_networks(["10.0.0.0/8", "127.0.0.1", "fd00::/8"])


def request(peer: str, *headers: tuple[str, str], **scope: Any) -> dict[str, Any]:
    """A request's scope."""
    raw = [(name.encode(), value.encode("latin-1")) for name, value in headers]
    return {"type": "http", "path": "/api/v1/robots", "scheme": "http", "client": (peer, 4), "headers": raw, **scope}


def said(*entries: str) -> tuple[tuple[str, str], ...]:
    """X-Forwarded-For, a line an entry."""
    return tuple(("x-forwarded-for", entry) for entry in entries)


CHAINS: tuple[tuple[str, tuple[str, ...], str], ...] = (  # who connects, X-Forwarded-For by lines, who counts
    ("203.0.113.5", (), "203.0.113.5"),
    ("203.0.113.5", ("198.51.100.1",), "203.0.113.5"),  # nobody trusts it
    ("10.0.0.1", (), "10.0.0.1"),
    ("10.0.0.1", ("198.51.100.1",), "198.51.100.1"),
    ("10.0.0.1", ("6.6.6.6, 198.51.100.1",), "198.51.100.1"),  # the client wrote the first itself
    ("10.0.0.1", ("6.6.6.6, 198.51.100.1, 10.2.2.2",), "198.51.100.1"),  # two proxies
    ("10.0.0.1", ("6.6.6.6", "198.51.100.1", "10.2.2.2"), "198.51.100.1"),  # the same in lines
    ("10.0.0.1", ("10.3.3.3, 10.2.2.2",), "10.3.3.3"),  # inside all the way
    ("10.0.0.1", ("6.6.6.6, _hidden, 10.2.2.2",), "10.2.2.2"),
    ("10.0.0.1", ("198.51.100.1:4711",), "198.51.100.1"),
    ("fd00::1", ("[2001:db8::7]:443",), "2001:db8::7"),
    ("::ffff:10.0.0.1", ("198.51.100.1",), "198.51.100.1"),
    ("10.0.0.1", (",".join(["10.9.9.9"] * 1000),), "10.9.9.9"),
)


def test_the_nearest_that_is_no_proxy_counts() -> None:
    found = [(peer, lines, client_address(request(peer, *said(*lines)), TRUSTED)) for peer, lines, _ in CHAINS]
    assert found == list(CHAINS)


async def through(scope: dict[str, Any], *, only: bool = False) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """What the application gets, and what is answered instead."""
    got: dict[str, Any] = {}
    sent: list[dict[str, Any]] = []

    async def app(inner: Any, _receive: Any, _send: Any) -> None:
        got.update(inner)

    async def send(message: Any) -> None:
        sent.append(message)

    wrapped: Any = Proxies(app, TRUSTED, only=only)
    await wrapped(scope, None, send)
    return got, sent


async def test_behind_a_trusted_proxy_all_that_follows_sees_the_client() -> None:
    got, _ = await through(request("10.0.0.1", *said("198.51.100.1"), ("x-forwarded-proto", "https")))
    assert (got["client"][0], got["scheme"], got[PROXIED_KEY]) == ("198.51.100.1", "https", True)
    got, _ = await through(request("10.0.0.1", ("x-forwarded-proto", "https"), type="websocket", scheme="ws"))
    assert got["scheme"] == "wss"
    assert await client_again(got) == "10.0.0.1"


async def client_again(scope: dict[str, Any]) -> str:
    """Who asks once more gets the same answer."""
    return client_address(scope, TRUSTED)


async def test_what_a_stranger_says_of_itself_changes_nothing() -> None:
    got, _ = await through(request("203.0.113.5", *said("127.0.0.1"), ("x-forwarded-proto", "https")))
    assert (got["client"][0], got["scheme"]) == ("203.0.113.5", "http")
    assert PROXIED_KEY not in got


async def test_what_comes_by_a_trusted_proxy_never_comes_from_this_machine() -> None:
    for headers in ((), said("127.0.0.1"), said("198.51.100.1")):
        got, _ = await through(request("127.0.0.1", *headers))
        assert not is_local(got), headers


def test_a_proxy_that_nobody_named_gives_itself_away() -> None:
    assert is_local(request("127.0.0.1"))
    for name in ("forwarded", "via", "x-forwarded-for", "x-forwarded-proto", "x-real-ip"):
        assert not is_local(request("127.0.0.1", (name, "x"))), name


async def test_without_tls_only_the_proxies_get_in() -> None:
    got, sent = await through(request("203.0.113.5"), only=True)
    assert not got
    assert sent[0]["status"] == 403
    assert b'"proxy_only"' in sent[1]["body"]
    got, sent = await through(request("203.0.113.5", type="websocket", scheme="ws"), only=True)
    assert (got, sent[0]["type"], sent[0]["reason"]) == ({}, "websocket.close", "proxy_only")
    for path in ("/healthz", "/readyz"):
        assert (await through(request("203.0.113.5", path=path), only=True))[0]["path"] == path
    assert (await through(request("10.0.0.1"), only=True))[0]["client"][0] == "10.0.0.1"
