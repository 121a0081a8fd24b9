"""The straight way to a route: what it answers is what the whole way answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fastapi import APIRouter

from gateway.api.aws import routes as aws
from gateway.api.middleware.fast_path import FastPath
from gateway.api.rest.fleet import robots
from gateway.domain.principal import Role
from tests.gateway.harness import RING, ScriptedAgent, client, running_gateway

ROBOTS = "/api/v1/robots"
ASKED: list[tuple[str, str]] = [
    ("GET", ROBOTS),
    ("GET", f"{ROBOTS}?fields=id,state&limit=1"),
    ("GET", f"{ROBOTS}?limit=0"),
    ("GET", f"{ROBOTS}?selector=a=("),
    ("GET", f"{ROBOTS}?q=%00"),
    ("GET", f"{ROBOTS}/"),
    ("HEAD", ROBOTS),
    ("POST", ROBOTS),
    ("OPTIONS", ROBOTS),
]


async def answers(folder: Path) -> list[tuple[Any, ...]]:
    """To an operator, to one who sees another robot, to a bad key and to nobody."""
    keys = (RING.add(role=Role.OPERATOR), RING.add(role=Role.VIEWER, robots=("x",)), "mrk_no_key", "")
    found: list[tuple[Any, ...]] = []
    async with running_gateway(folder) as ready, ScriptedAgent(ready, "r0"):
        for key in keys:
            async with client(ready, key=key) as http:
                for method, path in ASKED:
                    answer = await http.request(method, path, json={} if method == "POST" else None)
                    kept = {
                        name: value
                        for name, value in answer.headers.items()
                        if name not in ("date", "x-request-id", "etag", "content-length", "content-security-policy")
                    }
                    same = answer.is_error or "fields" in path
                    found.append((method, path, answer.status_code, kept, answer.text if same else ""))
        async with client(ready) as http:
            text = (await http.get("/metrics")).text
        found.append(tuple(line for line in text.splitlines() if f'route="{ROBOTS}"' in line and "_count" in line))
    return found


async def test_what_is_posted_below_a_tree_goes_straight_there() -> None:
    (route,) = aws.CALLS.values()
    assert list(aws.CALLS) == ["/lambda/"]
    assert route.path == "/lambda/{path:path}"
    passed: list[str] = []

    async def rest(scope: Any, receive: Any, send: Any) -> None:
        passed.append(f"{scope['method']} {scope['path']}")

    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    fast = FastPath(rest, routes=(), trees=aws.CALLS)
    for method, path in (("POST", "/lambda/x"), ("GET", "/lambda/x"), ("POST", "/lambda"), ("POST", "/lambdas/x")):
        scope = {"type": "http", "method": method, "path": path, "headers": [], "query_string": b"", "state": {}}
        await fast(scope, None, send)  # type: ignore[arg-type]
    assert passed == ["GET /lambda/x", "POST /lambda", "POST /lambdas/x"]
    assert [message["status"] for message in sent if "status" in message] == [401]  # nobody has signed it


async def test_both_ways_answer_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [route.path for route in robots.FAST_PATHS] == [ROBOTS]
    straight = await answers(tmp_path / "straight")
    monkeypatch.setattr(robots, "FAST_PATHS", [])
    assert straight == await answers(tmp_path / "whole")
    assert {row[2] for row in straight[:-1]} >= {200, 400, 401, 404}
    assert straight[-1]  # it counts as the route that it is


async def test_what_fails_is_a_problem_as_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> object:
        raise RuntimeError("broken")

    monkeypatch.setattr(robots, "robot_rows_of", broken)
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        answer = await http.get(ROBOTS)
        assert (answer.status_code, answer.json()["code"]) == (500, "internal")


def test_a_route_without_its_one_permission_is_refused() -> None:
    router = APIRouter()

    @router.get("/bare")
    async def bare() -> None:
        """Nobody's."""

    with pytest.raises(ValueError, match="unpack"):
        FastPath(lambda *_: None, routes=router.routes)  # type: ignore[arg-type]
