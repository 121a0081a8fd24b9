"""No web page drives a robot: foreign Host and Origin headers are refused on every route, socket and mutation."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from starlette.routing import WebSocketRoute
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from gateway.api import ROUTERS as ALL_ROUTERS
from gateway.api.aws.routes import router as aws_router
from gateway.main import Ready
from tests.gateway.harness import OPERATOR_KEY, ScriptedAgent, bearer, client, open_socket, running_gateway
from tests.support.gateways.plain_http import FREE, plain_http

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.xdist_group("foreign pages")]

# Lambda's API says it in AWS's words, and takes no credential that a browser has: tests/gateway/api/aws/test_signed.py.
ROUTERS = [router for router in ALL_ROUTERS if router is not aws_router]
MUTATIONS = [
    (method, route.path)
    for router in ROUTERS
    for route in router.routes
    for method in sorted(getattr(route, "methods", None) or ())
    if method not in ("GET", "HEAD", "OPTIONS")
]
READS = [r.path for router in ROUTERS for r in router.routes if "GET" in (getattr(r, "methods", None) or ())]
SOCKETS = [
    r.path for router in ROUTERS for r in router.routes if isinstance(r, WebSocketRoute) or not hasattr(r, "methods")
]

# What a page of somebody else's can make a browser send: its own name by DNS rebinding, or its own origin.
FOREIGN = [
    ({"Host": "evil.example"}, "host_not_allowed"),
    ({"Host": "127.0.0.1.evil.example:8080"}, "host_not_allowed"),
    ({"Host": "localhost@evil.example"}, "host_not_allowed"),
    ({"Host": ""}, "host_not_allowed"),
    ({"Origin": "http://evil.example"}, "origin_not_allowed"),
    ({"Origin": "http://localhost:1"}, "origin_not_allowed"),
    ({"Origin": "null"}, "origin_not_allowed"),
    ({"Origin": "file://"}, "origin_not_allowed"),
]


JSON = {"Content-Type": "application/json"}
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def ready(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """A gateway as it is when nothing is said about hosts and origins."""
    async with running_gateway(tmp_path_factory.mktemp("gateway"), **FREE) as running:
        yield running


def concrete(path: str) -> str:
    """A route's path for a robot that exists."""
    return path.replace("{robot_id}", "sim_1")


async def test_the_walk_sees_the_routes() -> None:
    assert ("POST", "/api/v1/robots/{robot_id}/publish") in MUTATIONS
    assert ("POST", "/api/v1/robots/{robot_id}/services/call") in MUTATIONS
    assert {"/api/v1/stream", "/api/v1/robots/{robot_id}/teleop", "/api/v1/link"} < set(SOCKETS)
    assert {"/foxglove", "/foxglove/{robot_id}", "/rosbridge"} < set(SOCKETS)
    assert "/api/v1/robots" in READS


async def test_every_request_of_a_foreign_page_is_refused(ready: Ready) -> None:
    asked = [*MUTATIONS, *(("GET", path) for path in READS), ("GET", "/"), ("OPTIONS", "/x")]
    wrong = []
    async with plain_http(ready.http_port, bearer(OPERATOR_KEY) | JSON) as http, ScriptedAgent(ready) as agent:
        for headers, code in FOREIGN:
            for method, path in asked:
                got = await http.ask(method, concrete(path), b"{}", **headers)
                if got != (403, code):
                    wrong.append((method, path, headers, got))
        assert wrong == []
        while not agent.frames[1].empty():
            assert agent.frames[1].get_nowait().WhichOneof("frame") != "command"


async def test_every_socket_of_a_foreign_page_is_refused(ready: Ready) -> None:
    wrong = []
    async with ScriptedAgent(ready), plain_http(ready.http_port, bearer(OPERATOR_KEY) | UPGRADE) as http:
        for path in SOCKETS:
            for headers, code in FOREIGN:
                got = await http.ask("GET", concrete(path), **{"Origin": ready.url, **headers})
                if got != (403, code):
                    wrong.append((path, headers, got))
            if path == "/api/v1/link":  # of agents, which send no Origin: our own page has no business there either
                with pytest.raises(InvalidStatus):
                    await open_socket(ready, path)
                continue
            spoken = {"subprotocols": ["foxglove.sdk.v1"]} if path.startswith("/foxglove") else {}
            async with open_socket(ready, concrete(path), **spoken) as own:
                assert own.state.name == "OPEN", path
    assert wrong == []


async def test_a_second_host_does_not_hide_behind_the_first(ready: Ready) -> None:
    stream = ready.url.replace("http", "ws", 1) + "/api/v1/stream"
    for headers, _ in FOREIGN:
        if headers.get("Host"):
            with pytest.raises(InvalidStatus) as caught:  # the client writes Host from the URL
                await connect(stream, origin=ready.url, additional_headers=headers, proxy=None)
            assert caught.value.response.status_code in (400, 403), headers


FORM_TYPES = ["application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "text/plain", "application/jsonx"]


async def test_no_form_can_change_anything(ready: Ready) -> None:
    wrong = []
    async with plain_http(ready.http_port, bearer(OPERATOR_KEY)) as http:
        for method, path in MUTATIONS:
            for headers in [*({"Content-Type": form} for form in FORM_TYPES), {}]:
                got = await http.ask(method, concrete(path), b'{"topic": "/a"}', **headers)
                if got != (415, "unsupported_media_type"):
                    wrong.append((method, path, headers, got))
    assert wrong == []


async def test_bodies_are_bounded(ready: Ready) -> None:
    async def endless() -> object:
        for _ in range(64):
            yield b" " * 65536

    async with client(ready) as http:
        for content in (b" " * (1 << 20) + b"{}", endless()):
            answer = await http.post("/api/v1/robots/sim_1/publish", headers=JSON, content=content)
            assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")


async def test_own_names_and_allowed_ones_pass(tmp_path: Path) -> None:
    settings = {"allow_hosts": ("robots.lab",), "allow_origins": ("http://localhost:5173",)}
    async with running_gateway(tmp_path, **settings) as ready, client(ready) as http:
        port = ready.http_port
        for host in (f"localhost:{port}", f"127.0.0.1:{port}", "[::1]:9999", "LOCALHOST", "robots.lab"):
            assert (await http.get("/api/v1/robots", headers={"Host": host})).status_code == 200, host
        for origin in (f"http://127.0.0.1:{port}", "http://localhost:5173"):
            assert (await http.get("/api/v1/robots", headers={"Origin": origin})).status_code == 200, origin


async def test_answers_carry_the_security_headers(ready: Ready) -> None:
    async with client(ready) as http:
        for path in ("/", "/api/v1/robots", "/api/none", "/assets/none.js"):
            headers = (await http.get(path)).headers
            assert headers["x-content-type-options"] == "nosniff"
            policy = headers["content-security-policy"]
            assert "frame-ancestors 'none'" in policy
            assert "script-src 'self';" in policy
            assert f"ws://127.0.0.1:{ready.http_port}" in policy


async def test_delete_needs_no_body_and_takes_none_of_another_type(ready: Ready) -> None:
    async with client(ready) as http:
        path = "/api/v1/recordings/01J00000000000000000000000"
        assert (await http.delete(path)).json()["code"] == "unknown_recording"
        assert (await http.request("DELETE", path, content=b"{}")).status_code == 415
        form = {"Content-Type": "text/plain"}
        assert (await http.request("DELETE", path, content=b"{}", headers=form)).status_code == 415
        assert (await http.delete(path, headers={"Origin": "https://evil.example"})).status_code == 403
