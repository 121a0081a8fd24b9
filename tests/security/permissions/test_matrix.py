"""Who may do what: every REST operation, socket and RPC, asked by everybody, answers exactly as the table says."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from fastapi import APIRouter, Depends, FastAPI
from starlette.routing import Mount, Route
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Subprotocol

from gateway.api import ROUTERS
from gateway.api.authorization import PATH_PERMISSIONS, RPC_PERMISSIONS, permissions_of, require_permission, routes_of
from gateway.app import create_app
from gateway.domain.principal import Principal, Role
from gateway.identity.permissions import PERMISSIONS, permission
from gateway.main import Ready
from gateway.settings import Settings
from gateway.wiring.gateway import Gateway
from metaros._proto import alerts_pb2, events_pb2, fleet_pb2, link_pb2, telemetry_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import ScriptedAgent, bearer, client, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.gateways.plain_http import FREE, PlainHttp, plain_http

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.xdist_group("permission matrix")]

SIGNED = "/lambda/{path:path}"  # takes no credential but signatures: tests/security/permissions/test_lambda_matrix.py
OPERATIONS = [(method, path, rows[0].name) for method, path, rows in routes_of(ROUTERS) if rows and path != SIGNED]

# The table a second time, from the other side: what each of these gets. A role that changes has to change here too.
# + passes   s 401 sign_in   b 401 bad_credentials   f 403 forbidden
ASKERS = ("nobody", "anonymous", "viewer", "operator", "admin", "revoked", "robot")
EXPECTED = {
    "health.read": "+++++++",
    "api.read": "+++++++",
    "page.read": "+++++++",
    "sessions.open": "+++++++",
    "agent.enrol": "+++++++",
    "agent.link": "++fffb+",
    "sessions.close": "ss+++bf",
    "self.read": "s++++bf",
    "self.write": "ss+++bf",
    "keys.own": "ss+++bf",
    "tickets.make": "ss+++bf",
    "robots.read": "s++++bf",
    "telemetry.read": "s++++bf",
    "history.read": "s++++bf",
    "history.export": "s++++bf",
    "recordings.read": "s++++bf",
    "alerts.read": "s++++bf",
    "alerts.handle": "ssf++bf",
    "alerts.manage": "ssff+bf",
    "store.read": "s++++bf",
    "recordings.save": "ssf++bf",
    "recordings.delete": "ssf++bf",
    "robots.publish": "ssf++bf",
    "robots.call": "ssf++bf",
    "robots.drive": "ssf++bf",
    "robots.talk": "ssf++bf",
    "robots.configure": "ssf++bf",
    "keys.manage": "ssff+bf",
    "users.manage": "ssff+bf",
    "robots.enrol": "ssff+bf",
    "robots.revoke": "ssff+bf",
    "metrics.read": "s++++bf",
    "debug.read": "ssff+bf",
    "audit.read": "ssff+bf",
    "events.read": "s++++bf",
    "twin.read": "s++++bf",
    "twin.write": "ssf++bf",
    "templates.write": "ssff+bf",
    "nodes.read": "s++++bf",
    "nodes.control": "ssf++bf",
    "nodes.code": "ssff+bf",
    "commands.read": "s++++bf",
    "commands.send": "ssf++bf",
    "commands.cancel": "ssf++bf",
    "updates.read": "s++++bf",
    "updates.publish": "ssff+bf",
    "updates.fetch": "ssfffb+",
    "rollouts.manage": "ssff+bf",
    "functions.read": "s++++bf",
    "functions.invoke": "ssf++bf",
    "functions.write": "ssff+bf",
    "functions.fetch": "+++++++",
    "lambda.call": "s++++bf",
    "hooks.post": "+++++++",
    "rules.read": "s++++bf",
    "rules.write": "ssff+bf",
    "happenings.read": "s++++bf",
    "happenings.put": "ssf++bf",
    "dead_letters.read": "s++++bf",
    "dead_letters.write": "ssf++bf",
}
CODES = {"s": (401, "sign_in"), "b": (401, "bad_credentials"), "f": (403, "forbidden")}
GATE = {"sign_in", "bad_credentials", "forbidden", "csrf", "too_many_requests"}


@dataclass
class People:
    """One of each, with a key."""

    ring: KeyRing = field(default_factory=KeyRing)
    keys: dict[str, str] = field(default_factory=lambda: {"nobody": "", "anonymous": ""})

    def __post_init__(self) -> None:
        for name in ("viewer", "operator", "admin"):
            self.keys[name] = self.ring.add(role=Role.of(name), name=name)
        self.keys["other"] = self.ring.add(role=Role.ADMIN, robots=("other_*",), name="other")
        self.keys["revoked"] = self.ring.add(role=Role.ADMIN)
        self.ring.revoke(self.keys["revoked"])
        self.keys["robot"] = self.ring.add(role=Role.NONE)
        self.ring.put(self.keys["robot"], Principal(kind="robot", id="sim_1", robots=("sim_1",)))


@dataclass(frozen=True)
class World:
    """A gateway where nobody is a viewer, and one where nobody is nobody; robots sim_1 and other_1 on both."""

    people: People
    open: Ready
    closed: Ready


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def world(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[World]:
    people, gateways = People(), []
    async with AsyncExitStack() as stack:
        for anonymous in (True, False):
            folder = tmp_path_factory.mktemp("gateway")
            running = running_gateway(
                folder, authenticator=people.ring, anonymous=anonymous, allow_hosts=("fleet",), **FREE
            )
            ready = await stack.enter_async_context(running)
            for robot in ("sim_1", "other_1"):
                agent = ScriptedAgent(ready, robot, session=robot.encode().ljust(16))
                await stack.enter_async_context((await stack.enter_async_context(agent)).beating())
            gateways.append(ready)
        yield World(people, *gateways)


async def recording_of(ready: Ready, people: People, robot: str) -> str:
    """A new recording's id."""
    async with client(ready, key=people.keys["admin"]) as http:
        # A robot may have few unfinished ones: each is given up by the next.
        for item in (await http.get(f"/api/v1/recordings?robot={robot}")).json()["recordings"]:
            await http.request("DELETE", f"/api/v1/recordings/{item['id']}", json={})
        answer = await http.post(f"/api/v1/robots/{robot}/recordings", json={"last_s": 5})
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])


def concrete(path: str, *, robot: str = "sim_1", recording: str = "none") -> str:
    """A path with everything in it that is to be filled in."""
    path = path.replace("{robot_id}", robot).replace("{recording_id}", recording)
    path = re.sub(r"\{[^}]+\}", "none", path)
    return f"{path}?robot={robot}" if path.endswith("/export.mcap") else path


async def ask(http: PlainHttp, method: str, path: str, **headers: str) -> tuple[int, str]:
    """The status and the code of an answer; a mutation has an empty body, which every route refuses after its gate."""
    if method == "GET":
        return await http.ask(method, path, **headers)
    return await http.ask(method, path, b"{}", **{"Content-Type": "application/json", **headers})


async def attempt(ready: Ready, path: str, key: str) -> tuple[int, str]:
    """The same of a socket; (101, "") where it opened."""
    url = ready.url.replace("http", "ws", 1) + path
    link = path == "/api/v1/link"
    offered = "metaros.link.v1" if link else ("foxglove.sdk.v1" if path.startswith("/foxglove") else None)
    try:
        async with connect(
            url,
            origin=None if link else ready.url,
            subprotocols=[Subprotocol(offered)] if offered else None,
            additional_headers=bearer(key),
            proxy=None,
        ):
            return 101, ""
    except InvalidStatus as refused:
        answer = refused.response
        return answer.status_code, str(json.loads(answer.body or b"{}").get("code", ""))


async def test_every_row_of_the_table_is_expected_here() -> None:
    assert set(EXPECTED) == {row.name for row in PERMISSIONS}
    assert len(PERMISSIONS) == len(EXPECTED)
    assert all(len(marks) == len(ASKERS) for marks in EXPECTED.values())


async def test_every_route_and_socket_declares_one_permission() -> None:
    undeclared = [(method, path) for method, path, rows in routes_of(ROUTERS) if len(rows) != 1]
    assert undeclared == []
    assert len(OPERATIONS) >= 27


def undeclared(app: Any) -> list[str]:
    """What an application serves without one permission of the table, whatever way it came in."""
    found: list[str] = []
    for route in app.routes:
        inner = getattr(route, "original_router", None)  # how newer FastAPI keeps a router that was included
        if inner is not None:
            found += undeclared(inner)
        elif len(permissions_of(route)) != 1 and (getattr(route, "path", "") or "/") not in PATH_PERMISSIONS:
            found.append(str(getattr(route, "path", route)))
    return found


async def test_a_route_without_a_permission_fails_wherever_it_is_added(tmp_path: Path) -> None:
    gateway = Gateway(Settings(data_dir=tmp_path), clock=SystemClock())
    try:
        app: Any = create_app(gateway)
        while not hasattr(app, "routes"):
            app = app._app
        assert undeclared(app) == []
        assert len(app.routes) > 5
        assert sum(1 for route in app.routes if isinstance(route, Mount | Route)) >= len(PATH_PERMISSIONS)
        router = APIRouter(prefix="/api/v1")
        router.add_api_route("/open", lambda: None, dependencies=[Depends(lambda: None)])
        router.add_api_websocket_route("/open_socket", lambda socket: None)
        router.add_api_route(
            "/twice", lambda: None, dependencies=[require_permission("robots.read"), require_permission("api.read")]
        )
        app.include_router(router)
        app.add_api_route("/api/v1/beside", lambda: None)
        app.mount("/files", FastAPI())
        expected = ["/api/v1/open", "/api/v1/open_socket", "/api/v1/twice", "/api/v1/beside", "/files"]
        assert undeclared(app) == expected
    finally:
        await gateway.stop()


async def test_every_rpc_has_a_row() -> None:
    modules = (link_pb2, fleet_pb2, telemetry_pb2, events_pb2, alerts_pb2)
    files = [module.DESCRIPTOR for module in modules]
    services = [service for file in files for service in file.services_by_name.values()]
    methods = {f"/{service.full_name}/{method.name}" for service in services for method in service.methods}
    assert methods == {path for path in RPC_PERMISSIONS if path.startswith("/metaros.")}
    assert {permission(name).who for path, name in RPC_PERMISSIONS.items() if "/metaros.v1.Link/" in path} == {"robots"}


async def test_everybody_on_every_operation_and_socket(world: World) -> None:
    people, wrong, asked = world.people, [], 0
    for column, asker in enumerate(ASKERS):
        where, key = world.closed if asker == "nobody" else world.open, people.keys[asker]
        recording = ""
        async with plain_http(where.http_port, bearer(key)) as http:
            for method, path, name in OPERATIONS:
                if "{recording_id}" in path and not recording:
                    recording = await recording_of(where, people, "sim_1")
                place, mark = concrete(path, recording=recording), EXPECTED[name][column]
                got = await (attempt(where, place, key) if method == "SOCKET" else ask(http, method, place))
                recording = "" if method == "DELETE" else recording
                right = got == CODES[mark] if mark in CODES else got[1] not in GATE
                asked += 1
                if not right or (mark == "+" and got[1] in ("unknown_robot", "unknown_recording")):
                    wrong.append((asker, method, place, mark, got))
    assert wrong == []
    assert asked == len(OPERATIONS) * len(ASKERS)


async def test_a_robot_out_of_scope_does_not_exist(world: World) -> None:
    ready, people, key, wrong = world.open, world.people, world.people.keys["other"], []
    async with client(ready, key=key) as http, plain_http(ready.http_port, bearer(key)) as plain:
        mine, theirs = await recording_of(ready, people, "other_1"), await recording_of(ready, people, "sim_1")
        for method, path, _name in OPERATIONS:
            about = "{robot_id}" in path or "{recording_id}" in path or path.endswith("/export.mcap")
            if not about or path == "/api/v1/link":
                continue
            answers = []
            for robot, recording in (("sim_1", theirs), ("no_such", "01J" + "0" * 23)):
                place = concrete(path, robot=robot, recording=recording)
                answers.append(await (attempt(ready, place, key) if method == "SOCKET" else ask(plain, method, place)))
            hidden = "unknown_recording" if "{recording_id}" in path else "unknown_robot"
            if answers != [(404, hidden)] * 2:
                wrong.append((method, path, answers))
        assert wrong == []
        seen = (await http.get(f"/api/v1/recordings/{mine}")).json()
        assert seen["robot"] == "other_1"
        assert (await http.get("/api/v1/robots/other_1")).status_code == 200
        assert (await http.get("/api/v1/export.mcap?robot=other_1&robot=sim_1")).status_code == 404


async def test_lists_leave_out_what_is_out_of_scope(world: World) -> None:
    ready, people = world.open, world.people
    async with client(ready, key=people.keys["other"]) as http:
        for robot in ("sim_1", "other_1"):
            await recording_of(ready, people, robot)
        assert [robot["id"] for robot in (await http.get("/api/v1/robots")).json()["robots"]] == ["other_1"]
        for query, expected in (("", ["other_1"]), ("?robot=sim_1", []), ("?limit=1", ["other_1"])):
            listed = (await http.get(f"/api/v1/recordings{query}")).json()
            assert ([item["robot"] for item in listed["recordings"]], listed["next"]) == (expected, None)
        account = (await http.get("/api/v1/store")).json()
        assert {item["robot"] for item in account["robots"]} <= {"other_1"}
        words = [
            (await http.get(f"/api/v1/robots/{robot}")).json()["detail"].replace(robot, "R") for robot in ("sim_1", "x")
        ]
        assert words[0] == words[1], "the answer must not tell the hidden from the absent"


async def test_a_session_changes_things_only_with_its_token(world: World) -> None:
    ring = world.people.ring
    token, csrf = ring.sign_in(role=Role.ADMIN)
    guarded = [
        (method, concrete(path))
        for method, path, name in OPERATIONS
        if method not in ("GET", "SOCKET") and permission(name).who == "people"
    ]
    assert len(guarded) >= 5
    wrong = []
    async with plain_http(world.open.http_port, {"Cookie": f"metaros_session={token}"}) as http:
        for method, path in guarded:
            for headers in ({}, {"X-CSRF-Token": csrf[:-1]}):
                got = await ask(http, method, path, **headers)
                if got != (403, "csrf"):
                    wrong.append((method, path, headers, got))
        assert wrong == []
        assert await ask(http, "GET", "/api/v1/robots") == (200, "")
        publish = "/api/v1/robots/sim_1/publish"
        assert await ask(http, "POST", publish, **{"X-CSRF-Token": csrf}) == (400, "invalid_request")
        ring.revoke(token)
        assert await ask(http, "GET", "/api/v1/robots") == (401, "bad_credentials")
        assert await ask(http, "GET", "/healthz") == (200, "")


BAD_CREDENTIALS = (
    {"Authorization": "Basic YTpi"},
    {"Authorization": "Bearer"},
    {"Authorization": "Bearer mrk_local_" + "x" * 43},
    {"Authorization": "Bearer " + "x" * 5000},
    {"Authorization": "mrk_1_2"},
    {"Cookie": "metaros_session="},
    {"Cookie": "metaros_session=abc"},
    {"Cookie": "metaros_session=a; metaros_session=b"},
)


async def test_a_bad_credential_is_never_anonymous(world: World) -> None:
    async with client(world.open, key="") as http:
        assert (await http.get("/api/v1/robots")).status_code == 200
        for headers in BAD_CREDENTIALS:
            refused = await http.get("/api/v1/robots", headers=headers)
            assert (refused.status_code, refused.json()["code"]) == (401, "bad_credentials"), headers
            assert refused.headers["www-authenticate"] == "Bearer", headers


PROXIED = ({"X-Forwarded-For": "203.0.113.9"}, {"Forwarded": "for=203.0.113.9"}, {"X-Real-IP": "1.2.3.4"})


async def test_who_comes_through_a_proxy_is_nobody(world: World) -> None:
    async with plain_http(world.open.http_port) as http:
        for headers in (*PROXIED, {"Host": "fleet"}):
            assert await ask(http, "GET", "/api/v1/robots", **headers) == (401, "sign_in"), headers
            assert await ask(http, "GET", "/healthz", **headers) == (200, ""), headers


async def test_the_local_key_is_of_the_process_and_the_user(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        file = ready.data_dir / "local.key"
        assert file.stat().st_mode & 0o077 == 0
        key = file.read_text().strip()
        async with plain_http(ready.http_port, bearer(key)) as http:
            assert await ask(http, "GET", "/api/v1/robots") == (200, "")
    assert not file.exists()
    async with running_gateway(tmp_path) as again, plain_http(again.http_port, bearer(key)) as http:
        assert await ask(http, "GET", "/api/v1/robots") == (401, "bad_credentials")
