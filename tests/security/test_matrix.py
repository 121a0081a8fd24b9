"""Who may do what: every REST operation, socket and RPC, asked by everybody, answers exactly as the table says."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import APIRouter, Depends, FastAPI
from starlette.routing import Mount, Route
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Subprotocol

from gateway.api import ROUTERS
from gateway.api.allow import BARE, RPCS, allow, declared, routes_of
from gateway.app import Gateway
from gateway.domain.principal import Principal, Role
from gateway.identity.permissions import PERMISSIONS, permission
from gateway.main import Ready
from gateway.settings import Settings
from metaros._proto import alerts_pb2, events_pb2, fleet_pb2, link_pb2, telemetry_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import ScriptedAgent, bearer, client, running_gateway
from tests.support.key_ring import KeyRing

ROOT = Path(__file__).resolve().parents[2]
SIGNED = "/lambda/{path:path}"  # takes no credential but signatures: tests/security/test_lambda_matrix.py
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
GATE = {"sign_in", "bad_credentials", "forbidden", "csrf"}


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


@asynccontextmanager
async def world(folder: Path, people: People) -> AsyncIterator[tuple[Ready, Ready]]:
    """A gateway where nobody is a viewer, and one where nobody is nobody; robots sim_1 and other_1 on both."""
    async with AsyncExitStack() as stack:
        gateways = []
        for number, anonymous in enumerate((True, False)):
            running = running_gateway(folder / str(number), door=people.ring, anonymous=anonymous)
            ready = await stack.enter_async_context(running)
            for robot in ("sim_1", "other_1"):
                await stack.enter_async_context(ScriptedAgent(ready, robot, session=robot.encode().ljust(16)))
            gateways.append(ready)
        yield gateways[0], gateways[1]


async def recording_of(ready: Ready, people: People, robot: str) -> str:
    """A new recording's id."""
    async with client(ready, key=people.keys["admin"]) as http:
        answer = await http.post(f"/api/v1/robots/{robot}/recordings", json={"last_s": 5})
        assert answer.status_code == 202, answer.text
        asked = answer.json()
        # A robot may have few unfinished ones: each is given up by the next.
        for item in (await http.get(f"/api/v1/recordings?robot={robot}")).json()["recordings"]:
            if item["id"] != asked["id"]:
                await http.request("DELETE", f"/api/v1/recordings/{item['id']}", json={})
        return str(asked["id"])


def concrete(path: str, *, robot: str = "sim_1", recording: str = "none") -> str:
    """A path with everything in it that is to be filled in."""
    path = path.replace("{robot_id}", robot).replace("{recording_id}", recording)
    path = re.sub(r"\{[^}]+\}", "none", path)
    return f"{path}?robot={robot}" if path.endswith("/export.mcap") else path


async def ask(http: httpx.AsyncClient, method: str, path: str, **headers: str) -> tuple[int, str]:
    """The status and the code of an answer; a mutation has an empty body, which every route refuses after its gate."""
    body = None if method == "GET" else b"{}"
    kind = {} if body is None else {"Content-Type": "application/json"}
    answer = await http.request(method, path, content=body, headers={**kind, **headers})
    try:
        document = answer.json()
    except ValueError:
        return answer.status_code, ""
    return answer.status_code, str(document.get("code", "")) if isinstance(document, dict) else ""


async def knock(ready: Ready, path: str, key: str) -> tuple[int, str]:
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


def test_every_row_of_the_table_is_expected_here() -> None:
    assert set(EXPECTED) == {row.name for row in PERMISSIONS}
    assert len(PERMISSIONS) == len(EXPECTED)
    assert all(len(marks) == len(ASKERS) for marks in EXPECTED.values())


def test_every_route_and_socket_declares_one_permission() -> None:
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
        elif len(declared(route)) != 1 and (getattr(route, "path", "") or "/") not in BARE:
            found.append(str(getattr(route, "path", route)))
    return found


async def test_a_route_without_a_permission_fails_wherever_it_is_added(tmp_path: Path) -> None:
    gateway = Gateway(Settings(data_dir=tmp_path), clock=SystemClock())
    try:
        app: Any = gateway.api
        while not hasattr(app, "routes"):
            app = app._app
        assert undeclared(app) == []
        assert len(app.routes) > 5
        assert sum(1 for route in app.routes if isinstance(route, Mount | Route)) >= len(BARE)
        router = APIRouter(prefix="/api/v1")
        router.add_api_route("/open", lambda: None, dependencies=[Depends(lambda: None)])
        router.add_api_websocket_route("/open_socket", lambda socket: None)
        router.add_api_route("/twice", lambda: None, dependencies=[allow("robots.read"), allow("api.read")])
        app.include_router(router)
        app.add_api_route("/api/v1/beside", lambda: None)
        app.mount("/files", FastAPI())
        expected = ["/api/v1/open", "/api/v1/open_socket", "/api/v1/twice", "/api/v1/beside", "/files"]
        assert undeclared(app) == expected
    finally:
        await gateway.stop()


def test_every_rpc_has_a_row() -> None:
    modules = (link_pb2, fleet_pb2, telemetry_pb2, events_pb2, alerts_pb2)
    files = [module.DESCRIPTOR for module in modules]
    services = [service for file in files for service in file.services_by_name.values()]
    methods = {f"/{service.full_name}/{method.name}" for service in services for method in service.methods}
    assert methods == {path for path in RPCS if path.startswith("/metaros.")}
    assert {permission(name).who for path, name in RPCS.items() if "/metaros.v1.Link/" in path} == {"robots"}


def test_the_page_of_permissions_is_up_to_date() -> None:
    subprocess.run([sys.executable, str(ROOT / "tools/gen_permissions.py"), "--check"], check=True, timeout=120)


async def test_everybody_on_every_operation_and_socket(tmp_path: Path) -> None:
    people, wrong, asked = People(), [], 0
    async with world(tmp_path, people) as (ready, closed):
        for column, asker in enumerate(ASKERS):
            where, key = closed if asker == "nobody" else ready, people.keys[asker]
            async with client(where, key=key) as http:
                for method, path, name in OPERATIONS:
                    recording = await recording_of(where, people, "sim_1") if "{recording_id}" in path else "none"
                    place, mark = concrete(path, recording=recording), EXPECTED[name][column]
                    got = await (knock(where, place, key) if method == "SOCKET" else ask(http, method, place))
                    right = got == CODES[mark] if mark in CODES else got[1] not in GATE
                    asked += 1
                    if not right or (mark == "+" and got[1] in ("unknown_robot", "unknown_recording")):
                        wrong.append((asker, method, place, mark, got))
    assert wrong == []
    assert asked == len(OPERATIONS) * len(ASKERS)


async def test_a_robot_out_of_scope_does_not_exist(tmp_path: Path) -> None:
    people, wrong = People(), []
    async with world(tmp_path, people) as (ready, _), client(ready, key=people.keys["other"]) as http:
        mine, theirs = await recording_of(ready, people, "other_1"), await recording_of(ready, people, "sim_1")
        for method, path, _name in OPERATIONS:
            about = "{robot_id}" in path or "{recording_id}" in path or path.endswith("/export.mcap")
            if not about or path == "/api/v1/link":
                continue
            answers = []
            for robot, recording in (("sim_1", theirs), ("no_such", "01J" + "0" * 23)):
                place = concrete(path, robot=robot, recording=recording)
                key = people.keys["other"]
                answers.append(await (knock(ready, place, key) if method == "SOCKET" else ask(http, method, place)))
            hidden = "unknown_recording" if "{recording_id}" in path else "unknown_robot"
            if answers != [(404, hidden)] * 2:
                wrong.append((method, path, answers))
        assert wrong == []
        seen = (await http.get(f"/api/v1/recordings/{mine}")).json()
        assert seen["robot"] == "other_1"
        assert (await http.get("/api/v1/robots/other_1")).status_code == 200
        assert (await http.get("/api/v1/export.mcap?robot=other_1&robot=sim_1")).status_code == 404


async def test_lists_leave_out_what_is_out_of_scope(tmp_path: Path) -> None:
    people = People()
    async with world(tmp_path, people) as (ready, _), client(ready, key=people.keys["other"]) as http:
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


async def test_a_session_changes_things_only_with_its_token(tmp_path: Path) -> None:
    people = People()
    token, csrf = people.ring.sign_in(role=Role.ADMIN)
    cookie = {"Cookie": f"metaros_session={token}"}
    async with running_gateway(tmp_path, door=people.ring) as ready, client(ready, key="") as http:
        async with ScriptedAgent(ready):
            guarded = [
                (method, concrete(path))
                for method, path, name in OPERATIONS
                if method not in ("GET", "SOCKET") and permission(name).who == "people"
            ]
            assert len(guarded) >= 5
            for method, path in guarded:
                assert await ask(http, method, path, **cookie) == (403, "csrf"), path
                assert await ask(http, method, path, **cookie, **{"X-CSRF-Token": csrf[:-1]}) == (403, "csrf"), path
            assert await ask(http, "GET", "/api/v1/robots", **cookie) == (200, "")
            publish = "/api/v1/robots/sim_1/publish"
            assert await ask(http, "POST", publish, **cookie, **{"X-CSRF-Token": csrf}) == (400, "invalid_request")
            people.ring.revoke(token)
            assert await ask(http, "GET", "/api/v1/robots", **cookie) == (401, "bad_credentials")
            assert await ask(http, "GET", "/healthz", **cookie) == (200, "")


@pytest.mark.parametrize(
    "headers",
    [
        {"Authorization": "Basic YTpi"},
        {"Authorization": "Bearer"},
        {"Authorization": "Bearer mrk_local_" + "x" * 43},
        {"Authorization": "Bearer " + "x" * 5000},
        {"Authorization": "mrk_1_2"},
        {"Cookie": "metaros_session="},
        {"Cookie": "metaros_session=abc"},
        {"Cookie": "metaros_session=a; metaros_session=b"},
    ],
    ids=lambda headers: str(headers)[:40],
)
async def test_a_bad_credential_is_never_anonymous(tmp_path: Path, headers: dict[str, str]) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key="") as http:
        assert await ask(http, "GET", "/api/v1/robots") == (200, "")
        assert await ask(http, "GET", "/api/v1/robots", **headers) == (401, "bad_credentials")
        refused = await http.get("/api/v1/robots", headers=headers)
        assert refused.headers["www-authenticate"] == "Bearer"


@pytest.mark.parametrize(
    "headers",
    [{"X-Forwarded-For": "203.0.113.9"}, {"Forwarded": "for=203.0.113.9"}, {"X-Real-IP": "1.2.3.4"}, {"Host": "fleet"}],
    ids=lambda headers: next(iter(headers)),
)
async def test_who_comes_through_a_proxy_is_nobody(tmp_path: Path, headers: dict[str, str]) -> None:
    async with running_gateway(tmp_path, allow_hosts=("fleet",)) as ready, client(ready, key="") as http:
        assert await ask(http, "GET", "/api/v1/robots", **headers) == (401, "sign_in")
        assert await ask(http, "GET", "/healthz", **headers) == (200, "")


async def test_the_local_key_is_of_the_process_and_the_user(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        file = ready.data_dir / "local.key"
        assert file.stat().st_mode & 0o077 == 0
        key = file.read_text().strip()
        async with client(ready, key=key) as http:
            assert await ask(http, "GET", "/api/v1/robots") == (200, "")
    assert not file.exists()
    async with running_gateway(tmp_path) as again, client(again, key=key) as http:
        assert await ask(http, "GET", "/api/v1/robots") == (401, "bad_credentials")
