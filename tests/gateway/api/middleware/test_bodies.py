"""Bodies come after who asks is known, in time, and never more than fit."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gateway.api.middleware.bodies import Bodies, InFlight
from gateway.domain.principal import NOBODY, Principal
from gateway.errors import BodyTooLargeError, OverloadedError, RequestTimeoutError, TooManyRequestsError
from metaros.limits import LIMITS
from tests.gateway.harness import client, running_gateway

JSON = (b"content-type", b"application/json")
ADA = Principal(kind="user", id="u1", name="ada")


def asked(principal: Principal = ADA, *, address: str = "10.0.0.1") -> dict[str, Any]:
    """A scope."""
    return {
        "type": "http",
        "method": "POST",
        "path": "/x",
        "client": (address, 1),
        "headers": [JSON],
        "metaros.principal": principal,
    }


async def read(bodies: Bodies, pieces: list[bytes], scope: dict[str, Any] | None = None) -> bytes:
    """What a route gets of a body in pieces; after the last one nothing comes any more."""
    got: list[bytes] = []
    left = list(pieces)

    async def receive() -> dict[str, Any]:
        if not left:
            await asyncio.Event().wait()
        piece = left.pop(0)
        return {"type": "http.request", "body": piece, "more_body": piece != b""}

    async def send(_message: Any) -> None: ...

    bodies._app = lambda _scope, inner, _send: take(inner)

    async def take(inner: Any) -> None:
        got.append((await inner())["body"])

    await bodies(scope or asked(), receive, send)
    return got[0]


async def nothing(*_: Any) -> None:
    """An application that reads nothing."""


async def test_a_body_comes_in_one_piece_and_leaves_nothing_behind() -> None:
    bodies = Bodies(nothing)
    assert await read(bodies, [b"ab", b"", b"x"]) == b"ab"
    assert (bodies.in_flight.total, bodies.in_flight.by_address) == (0, {})


async def test_a_body_has_its_size_and_nobodys_is_small() -> None:
    bodies = Bodies(nothing)
    chunk = bytes(LIMITS.anonymous_body_bytes)
    assert len(await read(bodies, [chunk, chunk, b""])) == 2 * len(chunk)
    with pytest.raises(BodyTooLargeError):
        await read(bodies, [chunk, b"1", b""], asked(NOBODY))
    with pytest.raises(BodyTooLargeError):
        await read(bodies, [bytes(LIMITS.json_bytes), b"1", b""])
    assert bodies.in_flight.total == 0


@pytest.mark.parametrize("bounds", [{"body_idle_s": 0.01}, {"body_s": 0.01}])
async def test_a_body_that_does_not_come_is_given_up(bounds: dict[str, Any]) -> None:
    bodies = Bodies(nothing, limits=replace(LIMITS, **bounds))
    with pytest.raises(RequestTimeoutError):
        await read(bodies, [b"a"])
    assert bodies.in_flight.total == 0


def test_bodies_together_are_bounded_and_by_address() -> None:
    held = InFlight(replace(LIMITS, bodies_bytes=100, bodies_address_bytes=60))
    held.add("a", 60)
    with pytest.raises(TooManyRequestsError):
        held.add("a", 1)
    held.add("b", 40)
    with pytest.raises(OverloadedError):
        held.add("c", 1)
    held.remove("a", 60)
    held.add("c", 1)
    assert (held.total, held.by_address) == (41, {"b": 40, "c": 1})


async def test_who_may_not_ask_is_reported_so_without_their_body_being_read(tmp_path: Path) -> None:
    taken = 0

    async def endless() -> Any:
        nonlocal taken
        for _ in range(16):
            taken += 1
            yield b" " * 65536

    async with running_gateway(tmp_path) as ready, client(ready, key="") as http:
        headers = {"Content-Type": "application/json"}
        answer = await http.post("/api/v1/robots/sim_1/publish", headers=headers, content=endless())
        assert (answer.status_code, answer.json()["code"]) == (401, "sign_in")


async def test_answers_of_the_api_are_not_kept_and_permissions_are_few(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        answer = await http.get("/api/v1/robots")
        assert answer.headers["cache-control"] == "no-store"
        assert "camera=()" in answer.headers["permissions-policy"]
        assert answer.headers["x-frame-options"] == "DENY"
        assert "no-store" not in (await http.get("/")).headers.get("cache-control", "")
