"""AlertService over a real gateway: the same alerts, the same refusals and the same audit rows as in REST."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest

from gateway.api.grpc.errors import CODE_KEY
from gateway.domain.principal import Role
from metaros._proto import alerts_pb2, alerts_pb2_grpc
from tests.gateway.harness import RING, ScriptedAgent, client
from tests.support.gateways.alerting_gateway import Alerting, alerting_gateway
from tests.support.gateways.memory_authenticator import bearer

OPERATOR = RING.add(role=Role.OPERATOR, name="ada")
ADMIN = RING.add(role=Role.ADMIN, name="chief")
REMOTE = RING.add(role=Role.ADMIN, robots=("other_*",), name="stranger")
UNKNOWN = "01KB2Y4P5ZQ7W3M8T6X9R0N1VD"


class Stub:
    """AlertService with somebody's key; a refusal is its code."""

    def __init__(self, channel: grpc.aio.Channel, key: str = OPERATOR) -> None:
        self.service = alerts_pb2_grpc.AlertServiceStub(channel)
        self.metadata = tuple((name.lower(), value) for name, value in bearer(key).items())

    async def ask(self, method: str, request: Any) -> Any:
        """The answer."""
        return await getattr(self.service, method)(request, metadata=self.metadata, timeout=60)

    async def refused(self, method: str, request: Any) -> str:
        """The code with which it is refused."""
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await self.ask(method, request)
        return str(dict(caught.value.trailing_metadata() or ())[CODE_KEY])

    def watch(self, **wanted: Any) -> Any:
        """WatchAlerts."""
        asked = alerts_pb2.WatchAlertsRequest(filter=alerts_pb2.AlertFilter(**wanted))
        return self.service.WatchAlerts(asked, metadata=self.metadata, timeout=60)

    async def act(self, method: str, alert: str, text: str = "") -> Any:
        """What somebody does with an alert."""
        return await self.ask(method, alerts_pb2.AlertActionRequest(alert=alert, text=text))


@asynccontextmanager
async def fleet(folder: Path) -> AsyncIterator[tuple[Alerting, grpc.aio.Channel]]:
    """A gateway and a channel to its programs' port."""
    async with alerting_gateway(folder) as some:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{some.ready.api_grpc_port}") as channel:
            yield some, channel


def listed(**wanted: Any) -> alerts_pb2.ListAlertsRequest:
    """What ListAlerts is asked."""
    return alerts_pb2.ListAlertsRequest(filter=alerts_pb2.AlertFilter(**wanted))


async def test_alerts_are_listed_counted_and_shown(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel):
        hot = await some.open("sim_1")
        silent = await some.open("sim_2", cause="silence", severity="warning", value=math.nan, high=math.nan)
        stub, stranger = Stub(channel), Stub(channel, REMOTE)
        page = await stub.ask("ListAlerts", listed())
        assert [item.id for item in page.alerts] == [silent.id, hot.id]
        first = page.alerts[1]
        assert (first.robot, first.cause, first.state, first.severity) == ("sim_1", "heat", "open", "error")
        assert (first.value, first.high, first.HasField("low")) == (97.5, 95.0, False)
        assert first.path.startswith("/robots/sim_1?t=")
        assert not page.alerts[0].HasField("value")
        for wanted, ids in (
            ({"severities": ["error"]}, [hot.id]),
            ({"robots": ["sim_2"]}, [silent.id]),
            ({"causes": ["h*"]}, [hot.id]),
            ({"states": ["resolved"]}, []),
            ({"quiet": True}, []),
            ({"quiet": False}, [silent.id, hot.id]),
            ({"until_ns": 1}, []),
        ):
            assert [item.id for item in (await stub.ask("ListAlerts", listed(**wanted))).alerts] == ids, wanted
        short = await stub.ask("ListAlerts", alerts_pb2.ListAlertsRequest(limit=1))
        assert short.next == silent.id
        rest = await stub.ask("ListAlerts", alerts_pb2.ListAlertsRequest(limit=1, before=short.next))
        assert ([item.id for item in rest.alerts], rest.next) == ([hot.id], "")
        counts = await stub.ask("CountAlerts", alerts_pb2.CountAlertsRequest())
        assert (counts.open, counts.error, counts.warning) == (2, 1, 1)
        detail = await stub.ask("GetAlert", alerts_pb2.GetAlertRequest(alert=hot.id))
        assert [item.detector for item in detail.findings] == ["motor_overheats"]
        assert detail.findings[0].active
        assert list((await stranger.ask("ListAlerts", listed())).alerts) == []
        assert (await stranger.ask("CountAlerts", alerts_pb2.CountAlertsRequest())).open == 0
        for asking, alert in ((stranger, hot.id), (stub, UNKNOWN), (stub, "x")):
            assert await asking.refused("GetAlert", alerts_pb2.GetAlertRequest(alert=alert)) == "unknown_alert"


async def test_what_people_do_with_an_alert(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel):
        alert = (await some.open("sim_1")).id
        stub, viewer = Stub(channel), Stub(channel, RING.add(role=Role.VIEWER))
        taken = await stub.act("AcknowledgeAlert", alert, "mine")
        assert (taken.state, taken.acknowledged_by) == ("acknowledged", "ada")
        assert (await stub.act("UnacknowledgeAlert", alert)).state == "open"
        assigned = await stub.ask("AssignAlert", alerts_pb2.AssignAlertRequest(alert=alert, assignee="bob"))
        assert assigned.assignee == "bob"
        await stub.act("CommentAlert", alert, "hot")
        accepted = await stub.act("AcceptAlert", alert, "as built")
        assert accepted.alert.id == alert
        assert (await stub.act("ResolveAlert", alert)).state == "resolved"
        assert await stub.refused("AcknowledgeAlert", alerts_pb2.AlertActionRequest(alert=alert)) == "alert_state"
        remarks = (await stub.ask("GetAlert", alerts_pb2.GetAlertRequest(alert=alert))).remarks
        kinds = ["acknowledged", "unacknowledged", "assigned", "comment", "normal", "resolved"]
        assert [item.kind for item in remarks] == kinds
        assert [item.text for item in remarks if item.kind == "comment"] == ["hot"]
        for method, request, code in (
            ("CommentAlert", alerts_pb2.AlertActionRequest(alert=alert), "invalid_request"),
            ("CommentAlert", alerts_pb2.AlertActionRequest(alert=alert, text="x" * 2001), "invalid_request"),
            ("AssignAlert", alerts_pb2.AssignAlertRequest(alert=alert, assignee="x" * 129), "invalid_request"),
            ("ResolveAlert", alerts_pb2.AlertActionRequest(alert=UNKNOWN), "unknown_alert"),
        ):
            assert await stub.refused(method, request) == code, method
        assert await viewer.refused("ResolveAlert", alerts_pb2.AlertActionRequest(alert=alert)) == "forbidden"
        async with client(some.ready, key=ADMIN) as http:
            rows = (await http.get("/api/v1/audit")).json()["rows"]
        reported = [
            (row["name"], row["code"]) for row in rows if row["action"] == "alerts.handle" and row["name"] == "ada"
        ]
        assert ("ada", "alert_state") in reported
        details = [row["detail"] for row in rows if row["name"] == "ada"]
        assert f"{alert} sim_1 heat to bob" in details


async def test_silences(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel):
        alert = (await some.open("sim_1")).id
        stub, admin = Stub(channel), Stub(channel, ADMIN)
        one = await stub.ask("SilenceAlert", alerts_pb2.SilenceAlertRequest(alert=alert, for_s=60, reason="known"))
        assert (list(one.robots), list(one.causes), one.by, one.up_to) == (["sim_1"], ["heat"], "ada", "error")
        assert one.until_ns - one.from_ns == pytest.approx(60e9, abs=1e9)
        every = alerts_pb2.AddSilenceRequest(causes=["rate*"], up_to="warning")
        assert await stub.refused("AddSilence", every) == "forbidden", "it would be of the whole fleet"
        whole = await admin.ask("AddSilence", every)
        assert whole.until_ns - whole.from_ns == pytest.approx(3600e9, abs=1e9)
        found = await stub.ask("ListSilences", alerts_pb2.ListSilencesRequest())
        assert [item.id for item in found.silences] == [one.id, whole.id]
        seen = await Stub(channel, REMOTE).ask("ListSilences", alerts_pb2.ListSilencesRequest())
        assert list(seen.silences) == []
        assert await stub.refused("EndSilence", alerts_pb2.EndSilenceRequest(silence=whole.id)) == "forbidden"
        await stub.ask("EndSilence", alerts_pb2.EndSilenceRequest(silence=one.id))
        assert await stub.refused("EndSilence", alerts_pb2.EndSilenceRequest(silence=UNKNOWN)) == "unknown_silence"
        unfit: list[dict[str, Any]] = [{"for_s": -1.0}, {"up_to": "bad"}, {"robots": ["x" * 200]}]
        for bad in unfit:
            request = alerts_pb2.AddSilenceRequest(**{"robots": ["sim_1"], **bad})
            assert await stub.refused("AddSilence", request) == "invalid_request", bad


async def test_checks_routes_and_what_is_learned(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel), ScriptedAgent(some.ready):
        stub, admin = Stub(channel), Stub(channel, ADMIN)
        checks = {item.id: item for item in (await stub.ask("ListChecks", alerts_pb2.ListChecksRequest())).checks}
        assert checks["motor_hot"].high == 80.0
        assert not checks["motor_hot"].HasField("low")
        changed = await admin.ask("SetCheck", alerts_pb2.SetCheckRequest(check="motor_hot", high=70, for_s=2))
        assert (changed.high, changed.for_s, sorted(changed.changed), changed.by) == (70, 2, ["for_s", "high"], "chief")
        unbound = await admin.ask("SetCheck", alerts_pb2.SetCheckRequest(check="motor_hot", high=math.nan))
        assert not unbound.HasField("high")
        back = await admin.ask("ResetCheck", alerts_pb2.ResetCheckRequest(check="motor_hot"))
        assert (back.high, list(back.changed)) == (80.0, [])
        one = alerts_pb2.SetCheckRequest(check="motor_hot", high=70)
        assert await stub.refused("SetCheck", one) == "forbidden"
        assert await Stub(channel, REMOTE).refused("SetCheck", one) == "forbidden"
        nothing = alerts_pb2.SetCheckRequest(check="motor_hot")
        assert await admin.refused("SetCheck", nothing) == "invalid_request"
        assert await admin.refused("SetCheck", alerts_pb2.SetCheckRequest(check="no", high=1)) == "unknown_check"
        assert list((await stub.ask("ListRoutes", alerts_pb2.ListRoutesRequest())).routes) == []
        assert await admin.refused("TestRoute", alerts_pb2.TestRouteRequest(route="ops")) == "unknown_route"
        assert list((await stub.ask("GetLearning", alerts_pb2.GetLearningRequest(robot="sim_1"))).series) == []
        band = alerts_pb2.GetBandRequest(robot="sim_1", series="x", from_ns=1, to_ns=2)
        assert list((await stub.ask("GetBand", band)).points) == []
        band.to_ns = 1
        assert await stub.refused("GetBand", band) == "invalid_request"
        for method, request in (
            ("GetLearning", alerts_pb2.GetLearningRequest(robot="no")),
            ("GetBand", alerts_pb2.GetBandRequest(robot="no", from_ns=1, to_ns=2)),
            ("Backtest", alerts_pb2.BacktestRequest(robot="no")),
        ):
            assert await stub.refused(method, request) == "unknown_robot"


async def test_a_backtest(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel), ScriptedAgent(some.ready):
        stub = Stub(channel)
        asked = alerts_pb2.BacktestRequest(robot="sim_1", start="-1h")
        asked.checks_json = json.dumps({"motor_hot": {"high": 60.0, "low": None}})
        report = await stub.ask("Backtest", asked)
        assert (report.robot, report.samples, list(report.findings), report.cut) == ("sim_1", 0, [], False)
        assert report.to_ns - report.from_ns == 3600 * 10**9
        for bad in ({"checks_json": "{"}, {"checks_json": '{"x": {}}'}, {"series": ["x"]}, {"detectors": ["x"]}):
            request = alerts_pb2.BacktestRequest(robot="sim_1", start="-1h", **bad)
            assert await stub.refused("Backtest", request) == "invalid_request", bad


async def after(over: str, call: Any) -> Any:
    """The next reply; of an alert that was over before the watch began its journal may tell late."""
    while (reported := await call.read()).alert.id == over:
        pass
    return reported


async def test_watching_begins_with_what_is_and_goes_on_with_each_change(tmp_path: Path) -> None:
    async with fleet(tmp_path) as (some, channel):
        hot = (await some.open("sim_1")).id
        over = (await some.open("sim_2")).id
        stub = Stub(channel)
        await stub.act("ResolveAlert", over)
        every, few, blind = stub.watch(), stub.watch(robots=["sim_2"]), Stub(channel, REMOTE).watch()
        is_ = await every.read()
        assert (is_.change, is_.alert.id) == ("is", hot)
        for call in (every, few, blind):
            assert (await call.read()).change == "began"
        unseen = asyncio.ensure_future(blind.read())
        await stub.act("AcknowledgeAlert", hot)
        reported = await after(over, every)
        assert (reported.change, reported.alert.id, reported.alert.state) == ("acknowledged", hot, "acknowledged")
        other = (await some.open("sim_2", cause="battery")).id
        for call in (every, few):
            reported = await after(over, call)
            assert (reported.change, reported.alert.id) == ("opened", other)
        assert not unseen.done()
        for call in (every, few, blind):
            call.cancel()
        await asyncio.gather(unseen, return_exceptions=True)


async def test_watching_tells_no_change_that_what_is_reported_already(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with fleet(tmp_path) as (some, channel):
        events, stub = some.services.events, Stub(channel)
        start = await events.newest()
        hot = (await some.open("sim_1")).id
        await stub.act("AcknowledgeAlert", hot)
        await stub.act("CommentAlert", hot, "mine")

        kinds: list[str] = []
        async with asyncio.timeout(60), aclosing(events.watch(after=start)) as pages:
            while len(kinds) < 3:
                kinds += [event.kind for event in (await anext(pages)).events]
        assert kinds == ["alert.opened", "alert.acknowledged", "alert.changed"]

        async def from_before() -> int:
            return start

        monkeypatch.setattr(events, "newest", from_before)  # the events are stored after the watch had its place
        call = stub.watch()
        is_, began = await call.read(), await call.read()
        await stub.act("UnacknowledgeAlert", hot)
        commented, last = await call.read(), await call.read()
        call.cancel()
    assert (is_.change, is_.alert.id, began.change) == ("is", hot, "began")
    assert (commented.change, last.change) == ("changed", "changed")
    assert last.alert.state == "open"


async def test_a_filter_that_does_not_fit(tmp_path: Path) -> None:
    unfit: tuple[dict[str, Any], ...] = (
        {"states": ["closed"]},
        {"severities": ["bad"]},
        {"robots": ["x"] * 65},
        {"causes": ["\0"]},
        {"text": "x" * 201},
        {"from_ns": -1},
    )
    async with fleet(tmp_path) as (_, channel):
        for wanted in unfit:
            assert await Stub(channel).refused("ListAlerts", listed(**wanted)) == "invalid_request", wanted
