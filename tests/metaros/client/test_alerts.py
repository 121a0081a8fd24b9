"""`client.alerts` of both clients against a real gateway, and what is made of documents and messages."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, asynccontextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.principal import Role
from metaros._proto import alerts_pb2
from metaros.client import Alert, AlertChange, AsyncClient, Client, alert_requests
from metaros.errors import RefusedError
from tests.gateway.harness import RING, ScriptedAgent
from tests.support.gateways.alerting_gateway import Alerting, alerting_gateway

KEY = RING.add(role=Role.ADMIN, name="chief")
Blocking = Callable[[Callable[[Client], Any]], Awaitable[Any]]  # what the client that blocks answers, in a thread


@asynccontextmanager
async def world(folder: Path) -> AsyncIterator[tuple[Alerting, AsyncClient, Blocking]]:
    """A gateway that alerts, a client that awaits, and one that blocks in a thread."""
    async with alerting_gateway(folder) as some, AsyncClient(some.ready.url, key=KEY) as aio:
        sync = Client(some.ready.url, key=KEY)
        try:
            yield some, aio, lambda job: asyncio.to_thread(job, sync)
        finally:
            await asyncio.to_thread(sync.close)


async def test_both_clients_do_the_same(tmp_path: Path) -> None:
    async with world(tmp_path) as (some, aio, blocking):
        hot, slow = await some.open("sim_1"), await some.open("sim_2", cause="rate", severity="warning")
        found = await aio.alerts.list()
        assert [item.id for item in found] == [slow.id, hot.id]
        assert found == await blocking(lambda client: client.alerts.list(limit=5))
        assert [item.id for item in await aio.alerts.list(severities="error", causes="h*")] == [hot.id]
        assert await aio.alerts.list(states="resolved") == []
        assert [item.id for item in await blocking(lambda client: client.alerts.list(limit=1))] == [slow.id]
        shown = await aio.alerts.get(hot.id)
        assert shown == await blocking(lambda client: client.alerts.get(hot.id))
        assert (shown.robot, shown.value, shown.low, shown.high) == ("sim_1", 97.5, None, 95.0)
        assert [(item.detector, item.active) for item in shown.findings] == [("motor_overheats", True)]
        assert shown.unresolved
        assert not shown.quiet

        assert (await aio.alerts.acknowledge(hot.id, "mine")).acknowledged_by == "chief"
        assert (await blocking(lambda client: client.alerts.unacknowledge(hot.id))).state == "open"
        assert (await blocking(lambda client: client.alerts.assign(hot.id, "ada"))).assignee == "ada"
        said = await aio.alerts.comment(hot.id, "hot")
        assert [item.text for item in said.remarks if item.kind == "comment"] == ["hot"]
        (taught,) = await blocking(lambda client: client.alerts.normal(slow.id))
        assert "motor_overheats has a fixed bound" in taught
        silence = await aio.alerts.silence(hot.id, for_s=60.0, reason="known")
        assert [item["id"] for item in await blocking(lambda client: client.alerts.silences())] == [silence["id"]]
        await blocking(lambda client: client.alerts.end_silence(silence["id"]))
        whole = await blocking(lambda client: client.alerts.add_silence(causes="rate", up_to="warning"))
        assert (whole["robots"], whole["causes"], whole["up_to"]) == ([], ["rate"], "warning")
        assert (await aio.alerts.resolve(hot.id)).state == "resolved"
        with pytest.raises(RefusedError) as caught:
            await aio.alerts.acknowledge(hot.id)
        assert (caught.value.status, caught.value.reason) == (409, "alert_state")


async def test_checks_learning_and_backtests(tmp_path: Path) -> None:
    async with world(tmp_path) as (some, aio, blocking), ScriptedAgent(some.ready):
        checks = {item["id"]: item for item in await aio.alerts.checks()}
        assert checks["motor_hot"]["high"] == 80.0
        assert (await aio.alerts.set_check("motor_hot", high=70.0, low=None))["changed"] == ["high"]
        assert (await blocking(lambda client: client.alerts.reset_check("motor_hot")))["changed"] == []
        assert await blocking(lambda client: client.alerts.learning("sim_1")) == []
        assert await aio.alerts.band("sim_1", "x") == []
        report = await aio.alerts.backtest("sim_1", start="-1h", checks={"motor_hot": {"high": 60.0}}, only="motor_hot")
        assert (report["samples"], report["alerts"], report["cut"]) == (0, [], False)
        report = await blocking(lambda client: client.alerts.backtest("sim_1", start="-1h"))
        assert report["robot"] == "sim_1"


async def test_watching_tells_what_is_and_what_changes(tmp_path: Path) -> None:
    async with world(tmp_path) as (some, aio, blocking):
        hot = (await some.open("sim_1")).id

        def until_acknowledged(client: Client) -> list[AlertChange]:
            reported = []
            for change in client.alerts.watch(causes="heat"):
                reported.append(change)
                if change.change == "is":
                    client.alerts.acknowledge(change.alert.id)
                if change.change == "acknowledged":
                    break
            return reported

        reported = await blocking(until_acknowledged)
        assert [(item.change, item.alert.state) for item in reported] == [
            ("is", "open"),
            ("acknowledged", "acknowledged"),
        ]
        async with aclosing(aio.alerts.watch(robots="sim_1")) as changes:
            first = await anext(changes)
            assert (first.change, first.alert.id) == ("is", hot)
            rest = await aio.alerts.list()
            assert [first.alert.id] == [item.id for item in rest]
            assert first.alert.opened_ns // 10**6 == rest[0].opened_ns // 10**6


def test_a_message_has_every_field_of_an_alert() -> None:
    alert = Alert.of_message(alerts_pb2.Alert(id="a", value=1.5, times=2))
    assert (alert.id, alert.value, alert.low, alert.times, alert.findings) == ("a", 1.5, None, 2, ())
    known = {field.name for field in alerts_pb2.Alert.DESCRIPTOR.fields}
    assert known == {field.name for field in fields(Alert)} - {"findings", "remarks"}


def test_only_what_may_be_done_twice_goes_without_a_key() -> None:
    assert alert_requests.action("a", "acknowledge", {}).headers == {}
    for ask in (
        alert_requests.action("a", "comments", {}, idempotent=False),
        alert_requests.silence("a", for_s=1.0, reason=""),
        alert_requests.add_silence(robots=None, causes=None, up_to="error", for_s=1.0, reason=""),
    ):
        assert ask.idempotent
        assert len(ask.headers["idempotency-key"]) == 32
    assert not alert_requests.end_silence("x").idempotent
    assert alert_requests.alert("a/b").path == "/api/v1/alerts/a%2Fb"
