"""Alerts over HTTP: lists, what people do about one, who sees it, and what a robot shows of its own."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx

from gateway.api.models import alerts, common
from gateway.domain.principal import Role
from gateway.errors import TooManyError
from tests.gateway.harness import RING, ScriptedAgent, client, hear, open_socket, say
from tests.support.gateways.alerting_gateway import alerting_gateway

ALERTS = "/api/v1/alerts"
ADMIN = RING.add(role=Role.ADMIN, name="chief")
SCOPED = RING.add(role=Role.OPERATOR, robots=("lab_*",), name="lab operator")
VIEWER = RING.add(role=Role.VIEWER, name="guest")
ACTIONS: dict[str, dict[str, Any]] = {
    "acknowledge": {},
    "unacknowledge": {},
    "resolve": {},
    "comments": {"text": "x"},
    "assign": {"assignee": "ada"},
    "normal": {},
    "silence": {},
    "clip": {},
}


async def said(http: httpx.AsyncClient, alert: str, action: str, **body: Any) -> httpx.Response:
    """Do something about an alert."""
    return await http.post(f"{ALERTS}/{alert}/{action}", json=body)


async def ids(http: httpx.AsyncClient, **query: Any) -> list[str]:
    """Of the alerts in a list."""
    answer = await http.get(ALERTS, params=query)
    assert answer.status_code == 200, answer.text
    return [one["id"] for one in alerts.AlertList.model_validate_json(answer.content).model_dump()["alerts"]]


async def test_a_list_is_filtered_and_comes_in_pages(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        hot = await some.open("sim_1")
        slow = await some.open("sim_1", cause="rate:/scan", kind="rate_low", severity="warning", reason="4 Hz")
        low = await some.open("sim_2", cause="battery", kind="battery_low", severity="warning")
        await said(http, low.id, "resolve")
        for query, wanted in [
            ({}, [low, slow, hot]),
            ({"state": "open"}, [slow, hot]),
            ({"state": ["open", "resolved"]}, [low, slow, hot]),
            ({"severity": "error"}, [hot]),
            ({"robot": "sim_2"}, [low]),
            ({"robot": ["sim_1", "none"]}, [slow, hot]),
            ({"cause": "rate:*"}, [slow]),
            ({"q": "BATTERY"}, [low]),
            ({"quiet": "true"}, []),
            ({"quiet": "false", "state": "open"}, [slow, hot]),
            ({"until": "-1h"}, []),
            ({"from": "-1h", "until": "now"}, [low, slow, hot]),
            ({"limit": 2}, [low, slow]),
            ({"limit": 2, "before": slow.id}, [hot]),
        ]:
            assert await ids(http, **query) == [one.id for one in wanted], query
        page = (await http.get(ALERTS, params={"limit": 2, "fields": "id"})).json()
        assert page == {"alerts": [{"id": low.id}, {"id": slow.id}], "next": slow.id}
        for bad in ({"state": "shut"}, {"from": "soon"}, {"limit": 0}, {"quiet": "perhaps"}, {"severity": ""}):
            answer = await http.get(ALERTS, params=bad)
            assert (answer.status_code, answer.json()["code"]) == (400, "invalid_request"), bad
        counts = (await http.get(f"{ALERTS}/counts")).json()
        assert counts == {"open": 2, "acknowledged": 0, "error": 1, "warning": 1, "info": 0, "quiet": 0}


async def test_the_life_of_one_alert(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("sim 1/ü", since_s=1_777_896_000.0)
        answer = await http.get(f"{ALERTS}/{alert.id}")
        alerts.AlertDetail.model_validate_json(answer.content)
        shown = answer.json()
        assert (shown["state"], shown["value"], shown["low"], shown["high"]) == ("open", 97.5, None, 95.0)
        assert shown["first"] == "2026-05-04T12:00:00.000Z"
        assert shown["path"] == "/robots/sim%201%2F%C3%BC?t=2026-05-04T12:00:00.000Z&span=15m"
        assert [(item["detector"], item["active"]) for item in shown["findings"]] == [("motor_overheats", True)]
        seen = (await said(http, alert.id, "acknowledge", text="on my way")).json()
        assert (seen["state"], seen["acknowledged_by"]) == ("acknowledged", "test operator")
        counts = (await http.get(f"{ALERTS}/counts")).json()
        assert (counts["open"], counts["acknowledged"]) == (1, 1)
        assert (await said(http, alert.id, "unacknowledge")).json()["state"] == "open"
        assert (await said(http, alert.id, "assign", assignee="ada")).json()["assignee"] == "ada"
        comment = await said(http, alert.id, "comments", text="the brake drags")
        assert comment.status_code == 201
        ended = (await said(http, alert.id, "resolve", text="oiled")).json()
        assert (ended["state"], ended["resolved_by"], ended["clearing"]) == ("resolved", "test operator", None)
        for action in ("acknowledge", "assign", "unacknowledge"):
            refused = await said(http, alert.id, action, **ACTIONS[action])
            assert (refused.status_code, refused.json()["code"]) == (409, "alert_state"), action
        assert (await said(http, alert.id, "comments", text="and greased")).status_code == 201
        remarks = (await http.get(f"{ALERTS}/{alert.id}")).json()["remarks"]
        assert [(one["number"], one["kind"], one["text"]) for one in remarks] == [
            (1, "acknowledged", "on my way"),
            (2, "unacknowledged", ""),
            (3, "assigned", "ada"),
            (4, "comment", "the brake drags"),
            (5, "resolved", "oiled"),
            (6, "comment", "and greased"),
        ]
        assert {one["by"] for one in remarks} == {"test operator"}
        async with client(some.ready, key=ADMIN) as chief:
            rows = (await chief.get("/api/v1/audit", params={"action": "alerts.handle"})).json()["rows"]
        assert f"{alert.id} sim 1/ü heat" in [row["detail"] for row in rows]


UNFIT: tuple[tuple[str, dict[str, Any]], ...] = (
    ("acknowledge", {"text": "x" * 2001}),
    ("acknowledge", {"why": "x"}),
    ("acknowledge", {"text": 5}),
    ("acknowledge", {"text": "a\0b"}),
    ("comments", {}),
    ("comments", {"text": ""}),
    ("assign", {}),
    ("assign", {"assignee": "x" * 129}),
    ("silence", {"for_s": 0}),
    ("silence", {"for_s": 1e12}),
    ("silence", {"for_s": "1h"}),
    ("clip", {"last_s": 5}),
)


async def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    wrong = []
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("sim_1")
        for action, body in UNFIT:
            refused = await said(http, alert.id, action, **body)
            named = next(iter(body), "text" if action == "comments" else "assignee")
            got = (refused.status_code, refused.json().get("code"))
            if got != (400, "invalid_request") or named not in refused.json()["detail"]:
                wrong.append((action, body, refused.text))
    assert wrong == []


async def test_alerts_of_robots_out_of_scope_do_not_exist(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, AsyncExitStack() as stack:
        http, guest = [await stack.enter_async_context(client(some.ready, key=key)) for key in (SCOPED, VIEWER)]
        hidden, shown = await some.open("hall_1"), await some.open("lab_1")
        fleet = await some.open("", cause="too_many")
        assert await ids(http) == [shown.id]
        assert await ids(http, robot="hall_1") == []
        assert await ids(guest) == [fleet.id, shown.id, hidden.id]
        assert (await http.get(f"{ALERTS}/counts")).json()["open"] == 1
        unknown = "01J" + "0" * 23
        for alert in (hidden.id, fleet.id, unknown, "no-such"):
            answers = [await http.get(f"{ALERTS}/{alert}")]
            answers += [await said(http, alert, action, **body) for action, body in ACTIONS.items()]
            assert {(one.status_code, one.json()["code"]) for one in answers} == {(404, "unknown_alert")}
            assert {one.json()["detail"] for one in answers} == {f"there is no alert {alert!r}"}
        for action, body in ACTIONS.items():
            refused = await said(guest, shown.id, action, **body)
            assert (refused.status_code, refused.json()["code"]) == (403, "forbidden"), action
        assert (await guest.get(f"{ALERTS}/{fleet.id}")).json()["path"] == "/alerts"


async def test_a_comment_is_said_once_under_its_key(tmp_path: Path) -> None:
    key = {"Idempotency-Key": "mine"}
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("sim_1")
        path = f"{ALERTS}/{alert.id}/comments"
        answers = [await http.post(path, json={"text": "once"}, headers=key) for _ in range(2)]
        assert [one.status_code for one in answers] == [201, 201]
        assert [one["text"] for one in answers[1].json()["remarks"]] == ["once"]
        other = await http.post(path, json={"text": "twice"}, headers=key)
        assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict")


async def test_a_robot_shows_its_alerts_in_lists_and_streams(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        async with ScriptedAgent(some.ready, "sim_1"):
            pass  # it is away: its row holds until something is known anew
        none, one = {"open": 0, "error": 0, "warning": 0}, {"open": 1, "error": 1, "warning": 0}
        robots = {"fields": "id,alerts"}

        async def listed() -> httpx.Response:
            return await http.get("/api/v1/robots", params=robots)

        before = await listed()
        assert before.json()["robots"] == [{"id": "sim_1", "alerts": none}]
        async with open_socket(some.ready, "/api/v1/stream") as socket:
            await say(socket, op="subscribe_fleet", id=1)
            assert (await hear(socket, "fleet"))["robots"][0]["alerts"] == none
            alert = await some.open("sim_1")
            while (await hear(socket, "fleet"))["robots"][0]["alerts"] != one:
                pass  # what its link's end changed
            assert (await listed()).json()["robots"] == [{"id": "sim_1", "alerts": one}]
            common.Robot.model_validate_json((await http.get("/api/v1/robots/sim_1")).content)
            await said(http, alert.id, "silence")
            while (await hear(socket, "fleet"))["robots"][0]["alerts"] != none:
                pass
        assert (await http.get(f"{ALERTS}/counts")).json()["quiet"] == 1


async def test_normal_says_what_was_taught(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("sim_1")
        answer = await said(http, alert.id, "normal", text="summer")
        reported = alerts.AlertNormal.model_validate_json(answer.content)
        assert (answer.status_code, reported.alert.id) == (200, alert.id)
        remarks = (await http.get(f"{ALERTS}/{alert.id}")).json()["remarks"]
        assert ("normal", "test operator") in [(one["kind"], one["by"]) for one in remarks]


async def test_a_clip_is_asked_for_once(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        async with ScriptedAgent(some.ready, "sim_1"):
            pass  # a recording waits for its robot
        alert = await some.open("sim_1", severity="warning")  # of an error one is asked for by itself
        first, again = [await said(http, alert.id, "clip") for _ in range(2)]
        assert (first.status_code, first.json()["robot"], first.json()["state"]) == (202, "sim_1", "requested")
        assert first.headers["location"] == f"/api/v1/recordings/{first.json()['id']}"
        assert again.json()["id"] == first.json()["id"]
        assert (await http.get(f"{ALERTS}/{alert.id}")).json()["clip"] == first.json()["id"]
        await http.request("DELETE", f"/api/v1/recordings/{first.json()['id']}", json={})
        refused = await said(http, alert.id, "clip")
        assert (refused.status_code, refused.json()["code"]) == (429, TooManyError.code), "one a minute of a robot"


async def test_two_who_acknowledge_at_once_both_hear_that_it_is(tmp_path: Path) -> None:
    async with alerting_gateway(tmp_path) as some, client(some.ready) as http:
        alert = await some.open("sim_1")
        answers = await asyncio.gather(*(said(http, alert.id, "acknowledge") for _ in range(8)))
        assert {(one.status_code, one.json()["state"]) for one in answers} == {(200, "acknowledged")}
        remarks = (await http.get(f"{ALERTS}/{alert.id}")).json()["remarks"]
        assert [one["kind"] for one in remarks] == ["acknowledged"]
