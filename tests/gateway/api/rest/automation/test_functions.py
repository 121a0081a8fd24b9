"""Functions over REST: deployed, called, looked at, and kept from those who may not."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio

from gateway.domain.principal import Role
from tests.gateway.harness import RING, client, running_gateway
from tests.support.gateways.lambda_gateway import zipped
from tests.support.gateways.plain_http import TRUSTS_NOBODY

ADMIN = RING.add(role=Role.ADMIN, name="functions' admin")
VIEWER = RING.add(role=Role.VIEWER, name="functions' viewer")
SCOPED = RING.add(role=Role.OPERATOR, name="of one robot", robots=("sim_1",))
SCOPED_ADMIN = RING.add(role=Role.ADMIN, name="admin of one robot", robots=("sim_1",))
CODE = """
import helper
def handler(event, context):
    print("got", event)
    if isinstance(event, dict) and event.get("fail"):
        raise ValueError("no")
    return {"echo": event, "word": helper.WORD}
"""
ZIP = base64.b64encode(zipped(CODE, helper="WORD = 'yes'")).decode()


pytestmark = pytest.mark.asyncio(loop_scope="module")
FUNCTIONS = "/api/v1/functions"


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def http(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[httpx.AsyncClient]:
    """An admin's client of a gateway."""
    async with running_gateway(tmp_path_factory.mktemp("gateway")) as ready, client(ready, key=ADMIN) as found:
        yield found


@pytest_asyncio.fixture(loop_scope="module")
async def echo(http: httpx.AsyncClient, request: pytest.FixtureRequest) -> str:
    """The path of a function of this test."""
    path = f"{FUNCTIONS}/{request.node.name.removeprefix('test_')[:60]}"
    answer = await http.put(path, json={"zip": ZIP, "handler": "app.handler"})
    assert answer.status_code == 201, answer.text
    return path


async def until(condition: Callable[[], Awaitable[bool]]) -> None:
    """Ask until it is so."""
    async with asyncio.timeout(60):
        while not await condition():  # noqa: ASYNC110 - it asks over HTTP
            await asyncio.sleep(0.02)


def as_(http: httpx.AsyncClient, key: str) -> httpx.AsyncClient:
    """The same gateway, asked by another."""
    headers = {"Authorization": f"Bearer {key}"}
    return httpx.AsyncClient(base_url=http.base_url, headers=headers, trust_env=False, verify=TRUSTS_NOBODY, timeout=60)


async def invocations(http: httpx.AsyncClient, echo: str, count: int, **query: Any) -> list[dict[str, Any]]:
    """The records of calls, once there are so many."""
    found: list[dict[str, Any]] = []

    async def there() -> bool:
        answer = await http.get(f"{echo}/invocations", params=query)
        assert answer.status_code == 200, answer.text
        found[:] = answer.json()["invocations"]
        return len(found) >= count

    await until(there)
    return found


async def test_a_function_is_made_called_and_reported_of(http: httpx.AsyncClient, echo: str) -> None:
    called = (await http.post(f"{echo}/invoke", json={"a": 1})).json()
    assert called["status"] == "ok"
    assert called["payload"] == {"echo": {"a": 1}, "word": "yes"}
    assert "got {'a': 1}" in called["log"]
    assert called["init_ms"] > 0
    failed = (await http.post(f"{echo}/invoke", json={"fail": 1})).json()
    assert (failed["status"], failed["error_type"]) == ("error", "ValueError")
    dry = await http.post(f"{echo}/invoke?kind=dry", json={})  # is no call, see below
    assert dry.json() == {"request_id": "", "status": "dry", "version": "$LATEST"}
    kept = await invocations(http, echo, 2)
    assert [item["status"] for item in kept] == ["error", "ok"]
    assert kept[0]["error_message"] == "no"
    assert kept[1]["request_id"] == called["request_id"]
    listed = (await http.get(FUNCTIONS)).json()["functions"]
    (own,) = [item for item in listed if item["name"] == echo.removeprefix(f"{FUNCTIONS}/")]
    stats = own["stats"]
    assert (stats["invocations"], stats["errors"], stats["cold_starts"]) == (2, 1, 1)
    assert stats["p50_ms"] > 0
    assert sum(row["invocations"] for row in stats["series"]) == 2


async def test_an_event_is_called_later_and_kept_with_its_request(http: httpx.AsyncClient, echo: str) -> None:
    answer = await http.post(f"{echo}/invoke?kind=event", json={"later": True})
    assert answer.status_code == 202
    kept = await invocations(http, echo, 1, kind="event")
    assert kept[0]["request_id"] == answer.json()["request_id"]
    assert kept[0]["status"] == "ok"


async def test_logs_are_paged_and_followed(http: httpx.AsyncClient, echo: str) -> None:
    await http.post(f"{echo}/invoke", json="first")
    page = (await http.get(f"{echo}/logs?limit=2")).json()
    assert len(page["lines"]) == 2
    assert page["lines"][-1]["text"].startswith("REPORT")
    older = (await http.get(f"{echo}/logs?limit=50&before={page['next']}")).json()
    texts = [line["text"] for line in older["lines"]]
    assert "got first" in texts
    assert older["next"] is None
    head = {"Accept": "text/event-stream"}
    last = page["lines"][-1]["cursor"]
    async with http.stream("GET", f"{echo}/logs?after={last}", headers=head) as live:
        assert live.status_code == 200
        await http.post(f"{echo}/invoke", json="second")
        async for line in live.aiter_lines():
            if line.startswith("data: ") and json.loads(line[6:])["text"] == "got second":
                break


async def test_code_is_shown_and_replaced_by_a_zip_file(http: httpx.AsyncClient, echo: str) -> None:
    files = (await http.get(f"{echo}/code")).json()
    assert [item["path"] for item in files["files"]] == ["app.py", "helper.py"]
    text = (await http.get(f"{echo}/code/text", params={"path": "helper.py"})).json()
    assert text == {"path": "helper.py", "text": "WORD = 'yes'", "truncated": False}
    for path in ("../../gateway.sqlite", "/etc/passwd", "none.py"):
        gone = await http.get(f"{echo}/code/text", params={"path": path})
        assert gone.status_code == 404, path
    await http.post(f"{echo}/invoke", json=0)
    fresh = zipped("def handler(event, context): return 'new'")
    zipped_head = {"Content-Type": "application/zip"}
    put = await http.put(f"{echo}/code?publish=true&alias=live", content=fresh, headers=zipped_head)
    assert put.status_code == 200
    assert put.json()["versions"] == 1
    assert put.json()["aliases"][0] | {"canary": None} == {
        "name": "live",
        "version": "1",
        "description": "",
        "weights": {},
        "canary": None,
    }
    called = (await http.post(f"{echo}/invoke?qualifier=live", json=0)).json()
    assert (called["payload"], called["version"]) == ("new", "1")
    for path, said in (("live", "what all call"), ("other", "a new one"), ("live", "")):
        led = await http.put(f"{echo}/aliases/{path}", json={"version": "1", "description": said})
        assert led.json() == {"name": path, "version": "1", "description": said, "weights": {}, "canary": None}
    assert (await http.post(f"{echo}/invoke", json=0)).json()["payload"] == "new"


async def test_a_canary_that_fails_too_often_is_rolled_back(http: httpx.AsyncClient, echo: str) -> None:
    await http.put(echo, json={"alias": "live"})
    broken = base64.b64encode(zipped("def handler(event, context): raise RuntimeError('broken')")).decode()
    await http.put(echo, json={"zip": broken, "publish": True})
    path = f"{echo}/aliases/live"
    asked = {"version": "2", "weight": 0.5, "error_rate": 0.2, "least_invocations": 3, "for_s": 600.0}
    begun = await http.put(f"{path}/canary", json=asked)
    assert begun.status_code == 200
    assert begun.json()["state"] == "running"
    assert begun.json()["stable"] == "1"
    again = await http.put(f"{path}/canary", json=asked)
    assert again.status_code == 409

    async def over() -> bool:
        await http.post(f"{echo}/invoke?qualifier=live", json=0)
        alias = (await http.get(echo)).json()["aliases"][0]
        return bool(alias["canary"]["state"] == "rolled_back")

    await until(over)
    alias = (await http.get(echo)).json()["aliases"][0]
    assert alias["weights"] == {}
    assert alias["version"] == "1"
    assert "failed" in alias["canary"]["reason"]

    async def reported() -> bool:
        events = (await http.get("/api/v1/events", params={"kind": "function.canary"})).json()["events"]
        return [item["data"]["state"] for item in events] == ["rolled_back", "running"]

    await until(reported)


async def test_environment_is_for_who_may_change_functions(http: httpx.AsyncClient, echo: str) -> None:
    assert (await http.get(echo)).json()["disk_mb"] == 512
    await http.put(echo, json={"environment": {"SECRET": "s3"}, "reserved": 2, "disk_mb": 600})
    found = (await http.get(echo)).json()
    assert (found["environment"], found["disk_mb"]) == ({"SECRET": "s3"}, 600)
    async with as_(http, VIEWER) as viewer, as_(http, SCOPED_ADMIN) as scoped:
        for other in (viewer, scoped):
            seen = (await other.get(echo)).json()
            assert seen["environment"] == {"SECRET": ""}
            assert seen["concurrency"]["reserved"] == 2


async def test_how_events_are_tried_and_who_is_reported_can_be_set(http: httpx.AsyncClient, echo: str) -> None:
    own = f"arn:aws:lambda:local:000000000000:function:{echo.removeprefix(f'{FUNCTIONS}/')}"
    queue = "arn:aws:sqs:eu-central-1:123456789012:dead"
    wanted = {"most_retries": 0, "most_age_s": 60, "on_success": own, "on_failure": queue, "dead_letter": queue}
    put = await http.put(echo, json={"event_invoke": wanted})
    assert put.status_code == 200, put.text
    assert put.json()["event_invoke"] == wanted, put.text
    put = await http.put(echo, json={"event_invoke": {"on_success": "", "dead_letter": ""}})
    assert put.json()["event_invoke"] == {**wanted, "on_success": "", "dead_letter": ""}
    assert (await http.put(echo, json={"timeout_s": 7})).json()["event_invoke"]["on_failure"] == queue


async def test_who_may_what(http: httpx.AsyncClient, echo: str) -> None:
    async with as_(http, VIEWER) as viewer, as_(http, SCOPED) as scoped, as_(http, SCOPED_ADMIN) as admin:
        assert (await viewer.post(f"{echo}/invoke", json=0)).status_code == 403
        assert (await viewer.put(echo, json={"timeout_s": 5})).status_code == 403
        assert (await scoped.post(f"{echo}/invoke", json=0)).status_code == 200
        assert (await admin.put(echo, json={"timeout_s": 5})).status_code == 403
        assert (await admin.delete(echo)).status_code == 403
        assert (await scoped.get(f"{echo}/logs")).status_code == 403
        await invocations(http, echo, 1)
        hidden = (await scoped.get(f"{echo}/invocations")).json()
        assert hidden["invocations"] == []  # it is about no robot of theirs


REFUSED: tuple[tuple[str, str, Any, int, str | None], ...] = (  # of the test's function, or of another one
    ("PUT", f"{FUNCTIONS}/new", {"handler": "app.handler"}, 400, "function_invalid"),
    ("PUT", f"{FUNCTIONS}/new", {"zip": "!!!!", "handler": "a.b"}, 400, "invalid_request"),
    ("PUT", f"{FUNCTIONS}/new", {"zip": "AAAA", "handler": "a.b"}, 400, None),
    ("PUT", "", {"memory_mb": 1}, 400, "invalid_request"),
    ("PUT", "", {"runtime": "nodejs22.x"}, 400, None),
    ("PUT", "", {"surprise": 1}, 400, "invalid_request"),
    ("POST", f"{FUNCTIONS}/none/invoke", {}, 404, "unknown_function"),
    ("POST", f"{FUNCTIONS}/none/invoke?kind=dry", {}, 404, "unknown_function"),
    ("GET", f"{FUNCTIONS}/none", None, 404, "unknown_function"),
    ("GET", f"{FUNCTIONS}/none/logs", None, 404, "unknown_function"),
    ("DELETE", f"{FUNCTIONS}/none", None, 404, "unknown_function"),
    ("DELETE", "/aliases/none/canary", None, 404, "unknown_function"),
)


async def test_what_does_not_fit_is_refused(http: httpx.AsyncClient, echo: str) -> None:
    wrong = []
    for method, path, body, status, code in REFUSED:
        answer = await http.request(method, path if path.startswith(FUNCTIONS) else echo + path, json=body)
        if answer.status_code != status or code not in (None, answer.json()["code"]):
            wrong.append((method, path, body, answer.status_code, answer.text))
    assert wrong == []


async def test_the_runtime_says_how_functions_are_kept_apart(http: httpx.AsyncClient, echo: str) -> None:
    await http.post(f"{echo}/invoke", json=0)
    found = (await http.get("/api/v1/functions-runtime")).json()
    assert found["on"]
    assert found["started"]
    assert found["trouble"] == ""
    assert found["reasons"][found["level"]] == "ok"
    assert found["workers"] >= 1
    (own,) = [pool for pool in found["pools"] if pool["function"] == echo.removeprefix(f"{FUNCTIONS}/")]
    assert own["calls"] == 1


async def test_functions_that_are_off_run_nowhere(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, functions=False) as ready, client(ready, key=ADMIN) as http:
        await http.put(f"{FUNCTIONS}/echo", json={"zip": ZIP, "handler": "app.handler"})
        answer = await http.post(f"{FUNCTIONS}/echo/invoke", json=0)
        assert answer.status_code == 503
        assert answer.json()["code"] == "functions_off"
        assert not (await http.get("/api/v1/functions-runtime")).json()["on"]
