"""Dead letters and replays over REST."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import httpx

from gateway.domain.principal import Role
from tests.gateway.api.rest.automation.test_functions import as_, until
from tests.gateway.harness import RING, client, running_gateway
from tests.support.gateways.lambda_gateway import zipped

ADMIN = RING.add(role=Role.ADMIN, name="letters' admin")
SCOPED = RING.add(role=Role.OPERATOR, name="letters of one robot", robots=("sim_1",))
CODE = """
def handler(event, context):
    if event.get("bad"):
        raise ValueError("no")
"""
LETTERS = "/api/v1/dead-letters"


async def make(http: httpx.AsyncClient) -> None:
    """A function that is not tried again."""
    code = base64.b64encode(zipped(CODE)).decode()
    body = {"zip": code, "handler": "app.handler", "event_invoke": {"most_retries": 0}}
    answer = await http.put("/api/v1/functions/f", json=body)
    assert answer.status_code == 201, answer.text


async def letters(http: httpx.AsyncClient, count: int, **wanted: Any) -> list[dict[str, Any]]:
    """Those that there are, once there are so many as wanted."""
    found: list[dict[str, Any]] = []

    async def there() -> bool:
        answer = await http.get(LETTERS)
        found[:] = answer.json()["dead_letters"]
        return len(found) == count and all(item[name] == value for item in found for name, value in wanted.items())

    await until(there)
    return found


async def test_a_dead_letter_is_seen_driven_again_and_dropped(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        await make(http)
        for number in range(3):
            await http.post("/api/v1/functions/f/invoke?kind=event", json={"bad": number + 1})
        found = await letters(http, 3, code="function_error", message="ValueError: no", target="f", payload=None)
        page = (await http.get(LETTERS, params={"limit": 2})).json()
        assert (len(page["dead_letters"]), page["total"]) == (2, 3)
        rest = (await http.get(LETTERS, params={"before": page["next"]})).json()
        assert [item["id"] for item in page["dead_letters"] + rest["dead_letters"]] == [item["id"] for item in found]
        one = (await http.get(f"{LETTERS}/{found[0]['id']}")).json()
        assert one["payload"].startswith('{"bad"')
        assert (await http.post(f"{LETTERS}/redrive", json={})).status_code == 400
        redriven = await http.post(f"{LETTERS}/redrive", json={"ids": [found[0]["id"]]})
        assert redriven.json() == {"redriven": 1}
        await letters(http, 3)
        assert (await http.get(f"{LETTERS}/{found[0]['id']}")).json()["redrives"] == 1
        async with as_(http, SCOPED) as scoped:
            assert (await scoped.get(LETTERS)).json() == {"dead_letters": [], "total": 0, "next": None}
            assert (await scoped.get(f"{LETTERS}/{found[0]['id']}")).status_code == 404
            assert (await scoped.delete(LETTERS, params={"all": True})).json() == {"dropped": 0}
        assert (await http.delete(LETTERS, params={"id": found[1]["id"]})).json() == {"dropped": 1}
        assert (await http.delete(LETTERS, params={"kind": "function", "target": "f"})).json() == {"dropped": 2}
        assert (await http.get(LETTERS)).json()["dead_letters"] == []


async def test_what_happened_is_replayed_into_a_function(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        await make(http)
        entries = [
            {"type": f"shop.{kind}", "source": "shop", "detail": {"n": 1}} for kind in ("sold", "sold", "returned")
        ]
        assert (await http.post("/api/v1/happenings", json={"entries": entries})).status_code == 202
        body = {"from": "-1h", "pattern": {"detail-type": ["shop.sold"]}}
        begun = await http.post("/api/v1/functions/f/replay", json=body)
        assert begun.status_code == 202, begun.text
        replay = f"/api/v1/replays/{begun.json()['id']}"

        async def over() -> bool:
            return bool((await http.get(replay)).json()["state"] == "done")

        await until(over)
        assert (await http.get(replay)).json()["put"] == 2
        assert [item["id"] for item in (await http.get("/api/v1/replays")).json()["replays"]] == [begun.json()["id"]]

        async def called() -> bool:
            found = (await http.get("/api/v1/functions/f/invocations")).json()["invocations"]
            return [item["status"] for item in found] == ["ok", "ok"]

        await until(called)
        assert (await http.get("/api/v1/replays/none")).json()["code"] == "unknown_replay"
        bad = await http.post("/api/v1/functions/f/replay", json={"from": "-1h", "pattern": {"a": 1}})
        assert bad.status_code == 400
        late = await http.post("/api/v1/functions/f/replay", json={"from": "now", "until": "-1h"})
        assert late.status_code == 400
