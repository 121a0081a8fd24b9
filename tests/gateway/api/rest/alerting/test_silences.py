"""Silences, checks, routes of notices and what is watched, over HTTP."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx

from gateway.api.models import alerts, watch
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import DATA, RING, ScriptedAgent, client, running_gateway
from tests.support.gateways.alerting_gateway import alerting_gateway

SILENCES, CHECKS, ROUTES = "/api/v1/silences", "/api/v1/alert-checks", "/api/v1/alert-routes"
ADMIN = RING.add(role=Role.ADMIN, name="chief")
NARROW = RING.add(role=Role.ADMIN, robots=("lab_*",), name="lab chief")
SCOPED = RING.add(role=Role.OPERATOR, robots=("lab_*",), name="lab operator")
VIEWER = RING.add(role=Role.VIEWER, robots=("lab_*",), name="lab guest")
SERIES = "motors.left_motor.temperature"


def refusal(answer: httpx.Response) -> tuple[int, str]:
    """The status and the code of a problem."""
    return answer.status_code, answer.json()["code"]


async def shows(http: httpx.AsyncClient, alert: str, **wanted: Any) -> None:
    """Wait until an alert is as a silence makes it, which is stored behind the silence itself."""
    async with asyncio.timeout(60):
        while True:
            shown = (await http.get(f"/api/v1/alerts/{alert}")).json()
            if all(shown[name] == value for name, value in wanted.items()):
                return
            await asyncio.sleep(0.02)


async def test_a_silence_keeps_an_alert_quiet_until_it_ends(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("lab_1")
        made = await http.post(f"/api/v1/alerts/{alert.id}/silence", json={"for_s": 60.0, "reason": "on the lift"})
        silence = alerts.Silence.model_validate_json(made.content)
        assert (made.status_code, silence.robots, silence.causes) == (201, ["lab_1"], ["heat"])
        assert (silence.by, silence.reason, silence.up_to) == ("test operator", "on the lift", "error")
        await shows(http, alert.id, silence=silence.id, quiet=True)
        listed = alerts.SilenceList.model_validate_json((await http.get(SILENCES)).content)
        assert [one.id for one in listed.silences] == [silence.id]
        ended = await http.delete(f"{SILENCES}/{silence.id}")
        assert (ended.status_code, ended.json()["id"]) == (200, silence.id)
        assert (await http.get(SILENCES)).json()["silences"] == []
        await shows(http, alert.id, silence="", quiet=False)


async def test_a_silence_reaches_no_further_than_its_maker(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        keys = (ADMIN, SCOPED, VIEWER, NARROW)
        chief, http, guest, narrow = [await stack.enter_async_context(client(ready, key=key)) for key in keys]
        fleet = (await chief.post(SILENCES, json={"robots": [], "causes": ["battery"], "up_to": "warning"})).json()
        hall = (await chief.post(SILENCES, json={"robots": ["hall_1"]})).json()
        lab = await http.post(SILENCES, json={"robots": ["lab_1"], "for_s": 5})
        assert lab.status_code == 201, lab.text
        for robots in (["hall_1"], ["lab_1", "hall_1"], ["*"], [], ["lab_?"]):
            assert refusal(await http.post(SILENCES, json={"robots": robots})) == (403, "forbidden"), robots
        assert refusal(await narrow.post(SILENCES, json={"robots": []})) == (403, "forbidden")
        assert refusal(await guest.post(SILENCES, json={"robots": ["lab_1"]})) == (403, "forbidden")
        for who, wanted in ((chief, {fleet["id"], hall["id"], lab.json()["id"]}), (http, {lab.json()["id"]})):
            assert {one["id"] for one in (await who.get(SILENCES)).json()["silences"]} == wanted
        for hidden in (fleet["id"], hall["id"], "01J" + "0" * 23, "none"):
            assert refusal(await http.delete(f"{SILENCES}/{hidden}")) == (404, "unknown_silence")
        operator = await stack.enter_async_context(client(ready))
        assert refusal(await operator.delete(f"{SILENCES}/{fleet['id']}")) == (403, "forbidden")
        assert (await operator.delete(f"{SILENCES}/{hall['id']}")).status_code == 200


NO_SILENCES: tuple[dict[str, Any], ...] = (
    {"robots": None},
    {"robots": [""]},
    {"robots": ["x" * 129]},
    {"robots": ["x"] * 33},
    {"causes": [5]},
    {"up_to": "all"},
    {"for_s": 0.5},
    {"for_s": 4e7},
    {"reason": "x" * 501},
    {"reason": "a\0b"},
    {"causes": ["a\0b"]},
    {"until": "now"},
)


async def test_what_is_no_silence_is_named_and_one_is_made_once_under_its_key(tmp_path: Path) -> None:
    key = {"Idempotency-Key": "mine"}
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        for body in NO_SILENCES:
            refused = await http.post(SILENCES, json={"robots": ["r1"], **body})
            assert refusal(refused) == (400, "invalid_request"), body
            assert next(iter(body)) in refused.json()["detail"], body
        asked = {"robots": ["r1"], "for_s": 60.0}
        first, again = [await http.post(SILENCES, json=asked, headers=key) for _ in range(2)]
        assert (first.status_code, again.status_code, again.json()) == (201, 201, first.json())
        assert len((await http.get(SILENCES)).json()["silences"]) == 1
        other = await http.post(SILENCES, json={**asked, "for_s": 61.0}, headers=key)
        assert refusal(other) == (409, "idempotency_conflict")


async def test_a_check_is_changed_for_the_whole_fleet_and_put_back(tmp_path: Path) -> None:
    path = f"{CHECKS}/motor_overheats"
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        keys = (ADMIN, SCOPED, NARROW)
        chief, http, narrow = [await stack.enter_async_context(client(ready, key=key)) for key in keys]
        table = watch.AlertCheckList.model_validate_json((await http.get(CHECKS)).content).checks
        before = next(row for row in table if row.id == "motor_overheats")
        assert (before.high, before.changed, before.changed_by, before.changed_at) == (95.0, [], "", None)
        answer = await chief.put(path, json={"high": 90.0, "enabled": None})
        changed = watch.AlertCheck.model_validate_json(answer.content)
        assert (answer.status_code, changed.high, changed.changed, changed.changed_by) == (200, 90.0, ["high"], "chief")
        assert changed.for_s == before.for_s
        unbound = (await chief.put(path, json={"high": None, "severity": "warning"})).json()
        assert (unbound["high"], unbound["changed"]) == (None, ["high", "severity"])
        await chief.put(path, json={"high": 90.0})
        page = (await http.get(CHECKS, params={"fields": "id,high", "limit": 1})).json()
        assert (len(page["checks"]), page["next"]) == (1, table[0].id)
        for body in (
            {},
            {"enabled": None},
            {"high": "hot"},
            {"low": 95.0},
            {"for_s": -1},
            {"severity": "bad"},
            {"colour": 1},
        ):
            assert refusal(await chief.put(path, json=body)) == (400, "invalid_request"), body
        assert refusal(await http.put(path, json={"high": 1.0})) == (403, "forbidden")
        assert refusal(await narrow.put(path, json={"high": 1.0})) == (403, "forbidden")
        assert refusal(await chief.put(f"{CHECKS}/none", json={"high": 1.0})) == (404, "unknown_check")
        assert refusal(await chief.delete(f"{CHECKS}/none")) == (404, "unknown_check")
        back = watch.AlertCheck.model_validate_json((await chief.delete(path)).content)
        assert (back.high, back.changed) == (95.0, [])
        rows = (await chief.get("/api/v1/audit", params={"action": "alerts.manage"})).json()["rows"]
        assert {"motor_overheats: high 90.0", "motor_overheats: as it comes"} <= {row["detail"] for row in rows}


async def test_routes_of_notices_are_shown_and_tried(tmp_path: Path) -> None:
    notify = tmp_path / "notify.toml"
    url = "http://127.0.0.1:9/hook"  # nobody is there
    lines = ["[[webhook]]", 'name = "{}"', f'url = "{url}"', "private = true"]
    text = "\n".join(lines)
    notify.write_text(f'{text.format("all")}\n{text.format("hall")}\nrobots = ["hall_*"]\n')
    async with running_gateway(tmp_path, notify=notify) as ready, AsyncExitStack() as stack:
        chief, http = [await stack.enter_async_context(client(ready, key=key)) for key in (ADMIN, SCOPED)]
        listed = watch.AlertRouteList.model_validate_json((await chief.get(ROUTES)).content)
        assert [(one.name, one.kind, one.sent) for one in listed.routes] == [
            ("all", "webhook", 0),
            ("hall", "webhook", 0),
        ]
        assert [one["name"] for one in (await http.get(ROUTES)).json()["routes"]] == ["all"]
        done = await chief.post(f"{ROUTES}/all/test", json={})
        reported = watch.AlertRouteTest.model_validate_json(done.content)
        assert (done.status_code, reported.ok, reported.status) == (200, False, 0)
        assert reported.error
        assert refusal(await chief.post(f"{ROUTES}/none/test", json={})) == (404, "unknown_route")
        assert refusal(await http.post(f"{ROUTES}/all/test", json={})) == (403, "forbidden")


async def test_what_is_watched_of_a_robot(tmp_path: Path) -> None:
    base, now_ns = "/api/v1/robots/lab_1/watch", SystemClock().wall_ns()
    series = [link_pb2.Series(series_id=1, name=SERIES, topic="/lab_1/motors", field="left_motor.temperature")]
    async with running_gateway(tmp_path) as ready, client(ready, key=VIEWER) as http:
        async with ScriptedAgent(ready, "hall_1"), ScriptedAgent(ready, "lab_1", session=b"l" * 16) as agent:
            await agent.announce(series=series)
            await agent.rows(1, [(1, now_ns - (9 - n) * 10**9, 40.0 + n % 2) for n in range(10)])
            await agent.next("ack", DATA)
            shown: list[watch.SeriesWatch] = []
            while not shown:
                answer = await http.get(base)
                assert answer.status_code == 200, answer.text
                shown = watch.Watch.model_validate_json(answer.content).series
            assert (shown[0].series, shown[0].score) == (SERIES, 0.0)
            assert shown[0].seen < shown[0].of
            band = await http.get(f"{base}/band", params={"series": SERIES, "from": "-1m"})
            reported = watch.Band.model_validate_json(band.content)
            assert (reported.robot, reported.series) == ("lab_1", SERIES)
            assert [point[0] for point in reported.points] == sorted(point[0] for point in reported.points)
            for path in ("/api/v1/robots/hall_1/watch", "/api/v1/robots/hall_1/watch/band?series=x"):
                assert refusal(await http.get(path)) == (404, "unknown_robot")
            for query in ("", "series=", "series=a&from=now&to=-1h", "series=a&from=soon"):
                assert refusal(await http.get(f"{base}/band?{query}")) == (400, "invalid_request"), query
