"""From a robot's link to viewers and back, through real gRPC, HTTP and WebSocket."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from gateway.domain.records import split_records
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import message_class
from metaros.interfaces.std_msgs.msg import String
from tests.gateway.harness import (
    BACKFILL,
    CONTROL,
    DATA,
    EPOCH,
    ScriptedAgent,
    channel,
    client,
    hear,
    hear_bytes,
    open_socket,
    running_gateway,
    say,
)
from tests.support.processes.clock_jump import LeapingClock

shared = pytest.mark.asyncio(loop_scope="module")
CLOCK = LeapingClock()
NUMBERS = itertools.count(1)
TWIST = "geometry_msgs/msg/Twist"
BATTERY = link_pb2.Series(
    series_id=1, name="battery_state.percentage", topic="/sim_1/battery_state", field="percentage"
)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def ready(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """A gateway that the tests of this file share; its robots are their own."""
    async with running_gateway(tmp_path_factory.mktemp("gateway"), clock=CLOCK) as ready:
        yield ready


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def http(ready: Ready) -> AsyncIterator[httpx.AsyncClient]:
    async with client(ready) as http:
        yield http


@pytest.fixture
def robot() -> str:
    """A name that no other test has."""
    return f"sim_{next(NUMBERS)}"


async def until(http: httpx.AsyncClient, robot: str, condition: Callable[[dict[str, Any]], bool]) -> None:
    """Ask for the robot until it is so."""
    async with asyncio.timeout(60):
        while not condition((await http.get(f"/api/v1/robots/{robot}")).json()):
            pass


async def nobody_streams(http: httpx.AsyncClient) -> None:
    """Return once the gateway has seen the last viewer go."""
    async with asyncio.timeout(60):
        while 'metaros_sockets{route="/api/v1/stream"} 0.0' not in (await http.get("/metrics")).text:
            pass


@shared
async def test_robot_shows_up_and_goes(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    assert (await http.get("/readyz")).json()["status"] == "ready"
    async with ScriptedAgent(ready, robot) as agent:
        assert agent.welcomes[DATA].store_id
        shown = (await http.get(f"/api/v1/robots/{robot}")).json()
        assert (shown["state"], shown["namespace"], shown["hostname"]) == ("online", f"/{robot}", "bench")
        beat = (await agent.next("heartbeat")).heartbeat
        await agent.send(CONTROL, heartbeat=link_pb2.Heartbeat(sent_ns=5, echo_ns=beat.sent_ns, held_ns=0))
        await until(http, robot, lambda shown: shown["link"]["rtt_ms"] is not None)
    await until(http, robot, lambda shown: shown["state"] == "offline")


@shared
async def test_samples_reach_a_viewer_byte_for_byte(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    payload = codec("std_msgs/msg/String").encode(String(data="x" * 21))
    async with ScriptedAgent(ready, robot) as agent:
        await agent.announce(channel(1, f"/{robot}/chatter", "std_msgs/msg/String"))
        async with open_socket(ready, "/api/v1/stream") as socket:
            assert (await hear(socket, "welcome"))["protocol"] == 1
            await say(socket, op="subscribe", id=7, robots="sim_*", topics=f"/{robot}/**", mode="queue")
            await say(socket, op="subscribe", id=7, robots="sim_*", topics=f"/{robot}/**")
            assert (await hear(socket, "error"))["code"] == "invalid_request"  # the first one is in place by now
            await agent.samples(1, 1, [payload, payload])
            described = await hear(socket, "channel")
            assert (described["topic"], described["type"]) == (f"/{robot}/chatter", "std_msgs/msg/String")
            assert "string data" in described["schema"]
            received = list(split_records(await hear_bytes(socket)))
            assert [(number, record.seq, record.payload) for number, _, record in received] == [
                (7, 1, payload),
                (7, 2, payload),
            ]
        ack = (await agent.next("ack", DATA)).ack.watermarks[0]
        assert (ack.stream_id, ack.epoch, ack.seq) == (1, EPOCH, 2)
        topic = (await http.get(f"/api/v1/robots/{robot}/topics")).json()["topics"][0]
        assert (topic["received"], topic["received_bytes"], topic["class"]) == (2, 2 * len(payload), "bulk")


@shared
async def test_live_topics_leave_the_robot_only_on_demand(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    async with ScriptedAgent(ready, robot) as agent:
        await agent.announce(channel(3, f"/{robot}/odom", "std_msgs/msg/String", delivery=4))
        async with open_socket(ready, "/api/v1/stream") as socket:
            await say(socket, op="subscribe", id=1, robots="*", topics="**/odom", max_rate_hz=10)
            demand = (await agent.next("demand")).demand
            assert [(entry.channel_id, entry.max_rate_hz) for entry in demand.entries] == [(3, 10.0)]
            assert (await http.get(f"/api/v1/robots/{robot}/topics")).json()["topics"][0]["demand_hz"] == 10
            await agent.samples(3, 500, [b"\x00\x01\x00\x00live"])
            assert [record.seq for _, _, record in split_records(await hear_bytes(socket))] == [500]
        await nobody_streams(http)
        CLOCK.leap(2.0)  # so long it would still be sent, to a page that comes again
        assert not (await agent.next("demand")).demand.entries


@shared
async def test_history_is_stored_and_neither_listed_nor_watched(
    ready: Ready, http: httpx.AsyncClient, robot: str
) -> None:
    live, history = (channel(n, f"/{robot}/odom", "std_msgs/msg/String", delivery=d) for n, d in ((3, 4), (4, 3)))
    live.history_rate_hz, history.history = 2.0, True
    async with ScriptedAgent(ready, robot) as agent:
        await agent.announce(live, history)
        async with open_socket(ready, "/api/v1/stream") as socket:
            await say(socket, op="subscribe", id=1, robots="*", topics="**/odom")
            assert [entry.channel_id for entry in (await agent.next("demand")).demand.entries] == [3]
            await agent.samples(4, 1, [b"kept", b"kept, too"])
            ack = (await agent.next("ack", DATA)).ack.watermarks[0]
            assert (ack.stream_id, ack.seq) == (4, 2)
            await agent.samples(3, 500, [b"live"])
            assert [record.payload for _, _, record in split_records(await hear_bytes(socket))] == [b"live"]
        (topic,) = (await http.get(f"/api/v1/robots/{robot}/topics")).json()["topics"]
        assert (topic["channel"], topic["class"], topic["history_hz"], topic["received"]) == (3, "live", 2.0, 1)
        shown = (await http.get(f"/api/v1/robots/{robot}")).json()
        assert (shown["channels"], shown["counts"]["samples"]) == (1, 3)


@shared
async def test_metrics_are_stored_acknowledged_and_streamed(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    async with ScriptedAgent(ready, robot) as agent:
        await agent.announce(series=[BATTERY])
        async with open_socket(ready, "/api/v1/stream") as socket:
            await say(socket, op="subscribe_metrics", id=2, robots="*", series=["battery_state.*"], max_rate_hz=50)
            await say(socket, op="subscribe_fleet", id=3)
            assert robot in [item["id"] for item in (await hear(socket, "fleet"))["robots"]]
            await agent.rows(1, [(1, 10_000_000 * n, n / 10) for n in range(1, 11)])
            message = await hear(socket, "metrics")
            assert message["values"] == {"battery_state.percentage": 1.0}
            (changed,) = (await hear(socket, "fleet"))["robots"]
            assert (changed["id"], changed["latest"]["battery_state.percentage"]["value"]) == (robot, 1.0)
        assert (await agent.next("ack", DATA)).ack.watermarks[0].seq == 10
        series = (await http.get(f"/api/v1/robots/{robot}/metrics")).json()["series"]
        assert (series[0]["name"], series[0]["samples"], series[0]["latest"]["value"]) == (BATTERY.name, 10, 1.0)
        query = {"name": BATTERY.name, "start": "1970-01-01T00:00:00Z", "end": "1970-01-01T00:00:01Z"}
        rows = (await http.get(f"/api/v1/robots/{robot}/metrics/range", params=query)).json()["series"][0]
        assert rows["mean"] == [n / 10 for n in range(1, 11)]
        assert rows["stamp_ms"][0] == 10.0
        few = (await http.get(f"/api/v1/robots/{robot}/metrics/range", params={**query, "points": 2})).json()
        assert sum(few["series"][0]["count"]) == 10


async def test_resume_after_a_restart_has_no_double_rows(tmp_path: Path) -> None:
    rows = [(1, n, float(n)) for n in range(1, 21)]
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(series=[BATTERY])
        await agent.rows(1, rows[:10])
        assert (await agent.next("ack", DATA)).ack.watermarks[0].seq == 10
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        agent = ScriptedAgent(ready, number=2)
        await agent.open(CONTROL)
        await agent.open(BACKFILL)
        await agent.open(DATA, [link_pb2.StreamState(stream_id=0, epoch=EPOCH, first_seq=1, last_seq=20)])
        async with asyncio.timeout(60):
            assert agent.welcomes[DATA].watermarks[0].seq == 10
            await agent.announce(series=[BATTERY])
            await agent.rows(6, rows[5:])  # five of them again
            assert (await agent.next("ack", DATA)).ack.watermarks[0].seq == 20
        robot = (await http.get("/api/v1/robots/sim_1")).json()
        assert robot["counts"]["duplicates"] == 5
        facts = (await http.get("/api/v1/robots/sim_1/metrics")).json()["series"][0]
        assert facts["samples"] == 20
        await agent.__aexit__()


@shared
async def test_newer_session_fences_the_older(ready: Ready, robot: str) -> None:
    async with ScriptedAgent(ready, robot, number=5) as older:
        async with ScriptedAgent(ready, robot, number=6, session=b"t" * 16):
            assert (await older.next("goodbye")).goodbye.code == "fenced"
            zombie = ScriptedAgent(ready, robot, number=4)
            await zombie.open(CONTROL, welcome=False)
            assert (await zombie.next("goodbye")).goodbye.code == "fenced"
            await zombie.__aexit__()


@shared
async def test_protocol_faults_end_the_link_with_a_reason(ready: Ready, robot: str) -> None:
    async with ScriptedAgent(ready, robot) as agent:
        await agent.samples(9, 1, [b"x"])
        goodbye = (await agent.next("goodbye", DATA)).goodbye
        assert (goodbye.code, "not announced" in goodbye.message) == ("protocol", True)
    stranger = ScriptedAgent(ready, "no such id!", number=2)
    await stranger.open(CONTROL, welcome=False)
    assert (await stranger.next("goodbye")).goodbye.code == "protocol"
    await stranger.__aexit__()


@shared
async def test_publish_and_service_call(
    ready: Ready, http: httpx.AsyncClient, robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with ScriptedAgent(ready, robot) as agent:
        body = {"topic": "chatter", "type": "std_msgs/String", "message": {"data": "hello"}}
        post = asyncio.create_task(http.post(f"/api/v1/robots/{robot}/publish", json=body))
        command = (await agent.next("command")).command
        assert (command.publish.topic, command.publish.type_name) == (f"/{robot}/chatter", "std_msgs/msg/String")
        assert codec("std_msgs/msg/String").decode(command.publish.payload) == String(data="hello")
        await agent.answer(command)
        assert (await post).json() == {"ok": True}

        call = {"service": f"/{robot}/base/resume", "type": "std_srvs/srv/Trigger"}
        post = asyncio.create_task(http.post(f"/api/v1/robots/{robot}/services/call", json=call))
        command = (await agent.next("command")).command
        assert command.call_service.service == f"/{robot}/base/resume"
        response = codec("std_srvs/srv/Trigger_Response")
        answer = message_class("std_srvs/srv/Trigger_Response")(success=True, message="on")
        await agent.answer(command, payload=response.encode(answer))
        assert (await post).json() == {"response": {"success": True, "message": "on"}}

        post = asyncio.create_task(http.post(f"/api/v1/robots/{robot}/services/call", json=call))
        await agent.answer((await agent.next("command")).command, code="unavailable")
        refused = await post
        assert (refused.status_code, refused.json()["code"]) == (503, "unavailable")

        monkeypatch.setattr("gateway.fleet.command_dispatcher.TRAVEL_S", 0.05)
        late = await http.post(f"/api/v1/robots/{robot}/services/call", json={**call, "timeout_s": 0.05})
        assert (late.status_code, late.json()["code"]) == (504, "timeout")


WRONG: list[tuple[str, dict[str, Any], int, str]] = [
    ("nobody", {"topic": "/a", "type": "std_msgs/String"}, 404, "unknown_robot"),
    ("", {"topic": "/a", "type": "no_such/Type"}, 400, "unknown_type"),
    ("", {"topic": "/a", "type": "a/b/c/d"}, 400, "invalid_request"),
    ("", {"topic": "/a b", "type": "std_msgs/String"}, 400, "invalid_name"),
    ("", {"topic": "/a", "type": "std_msgs/String", "message": {"dat": 1}}, 400, "invalid_field"),
    ("", {"topic": "/a", "type": "std_msgs/String", "message": {"data": 1}}, 400, "invalid_field"),
    ("", {"topic": "/a", "type": "std_msgs/String", "x": 1}, 400, "invalid_request"),
    ("", {"topic": "/a"}, 400, "invalid_request"),
    ("", {"topic": "cmd_vel", "type": TWIST}, 409, "lease_required"),
    ("", {"topic": "cmd_vel", "type": TWIST, "lease_id": "made up"}, 409, "lease_required"),
]


@shared
async def test_publish_says_what_is_wrong(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    async with ScriptedAgent(ready, robot):
        for name, body, status, code in WRONG:
            response = await http.post(f"/api/v1/robots/{name or robot}/publish", json=body)
            assert (response.status_code, response.json()["code"]) == (status, code), body
            assert response.headers["content-type"] == "application/problem+json"
        broken = await http.post(
            f"/api/v1/robots/{robot}/publish", content=b"{", headers={"Content-Type": "application/json"}
        )
        assert (broken.status_code, broken.json()["code"]) == (400, "invalid_request")


@shared
async def test_cdr_publish_and_offline_robot(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    cdr = {"Content-Type": "application/cdr"}
    query = {"topic": f"/{robot}/chatter", "type": "std_msgs/msg/String"}
    async with ScriptedAgent(ready, robot) as agent:
        post = asyncio.create_task(
            http.post(f"/api/v1/robots/{robot}/publish", params=query, content=b"\x00\x01\x00\x00", headers=cdr)
        )
        command = (await agent.next("command")).command
        assert command.publish.payload == b"\x00\x01\x00\x00"
        await agent.answer(command)
        assert (await post).status_code == 200
        pending = asyncio.create_task(
            http.post(f"/api/v1/robots/{robot}/publish", params=query, content=b"", headers=cdr)
        )
        await agent.next("command")
    assert (await pending).json()["code"] == "robot_offline"
    again = await http.post(f"/api/v1/robots/{robot}/publish", params=query, content=b"", headers=cdr)
    assert (again.status_code, again.json()["code"]) == (503, "robot_offline")


@shared
async def test_teleop_takes_drives_and_stops(ready: Ready, http: httpx.AsyncClient, robot: str) -> None:
    path = f"/api/v1/robots/{robot}/teleop"
    decode = codec(TWIST).decode
    async with ScriptedAgent(ready, robot) as agent:
        async with open_socket(ready, path) as driver:
            await say(driver, op="drive", linear=1, angular=0, seq=1)
            assert (await hear(driver, "error"))["code"] == "invalid_request"
            await say(driver, op="take", holder="ann")
            grant = (await agent.next("command")).command
            assert grant.grant_lease.holder == "ann"
            await agent.answer(grant)
            granted = await hear(driver, "granted")
            assert granted["topic"] == f"/{robot}/cmd_vel"
            assert (await http.get(f"/api/v1/robots/{robot}")).json()["lease"]["holder"] == "ann"

            async with open_socket(ready, path) as other:
                await say(other, op="take", holder="bob")
                refused = await hear(other, "refused")
                assert (refused["code"], refused["holder"]) == ("lease_taken", "ann")

            await say(driver, op="drive", linear=0.5, angular=-0.25, seq=8)
            frame = (await agent.next("teleop")).teleop
            twist = decode(frame.payload)
            assert (twist.linear.x, twist.angular.z) == (0.5, -0.25)
            assert (frame.lease_id, frame.topic, frame.type_name) == (granted["lease_id"], f"/{robot}/cmd_vel", TWIST)
            assert (await hear(driver, "ack"))["seq"] == 8

            body = {"topic": "cmd_vel", "type": TWIST, "lease_id": granted["lease_id"]}
            post = asyncio.create_task(http.post(f"/api/v1/robots/{robot}/publish", json=body))
            command = (await agent.next("command")).command
            assert command.lease_id == granted["lease_id"]
            await agent.answer(command)
            assert (await post).status_code == 200
        stop = (await agent.next("teleop")).teleop
        assert decode(stop.payload).linear.x == 0.0
        release = (await agent.next("command")).command
        assert release.release_lease.lease_id == granted["lease_id"]
        await agent.answer(release)
        assert (await http.get(f"/api/v1/robots/{robot}")).json()["lease"] is None


@shared
async def test_driver_hears_of_a_lost_robot(ready: Ready, robot: str) -> None:
    async with ScriptedAgent(ready, robot) as agent:
        driver = await open_socket(ready, f"/api/v1/robots/{robot}/teleop")
        await say(driver, op="take", holder="ann")
        await agent.answer((await agent.next("command")).command)
        await hear(driver, "granted")
    assert (await hear(driver, "lost"))["code"] == "robot_offline"
    await say(driver, op="take", holder="ann")
    assert (await hear(driver, "refused"))["code"] == "robot_offline"
    await driver.close()


async def test_shutdown_says_goodbye_everywhere(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        agent = await ScriptedAgent(ready).__aenter__()
        socket = await open_socket(ready, "/api/v1/stream")
        await hear(socket, "welcome")
    assert (await agent.next("goodbye")).goodbye.code == "shutting_down"
    with pytest.raises(ConnectionClosed):
        await hear(socket, "nothing")
    await agent.__aexit__()


@shared
async def test_unknown_op_and_garbage_keep_the_stream(ready: Ready) -> None:
    async with open_socket(ready, "/api/v1/stream") as socket:
        for text in ("{", "[]", '{"op": 3}', '{"op": "subscribe", "id": -1}', '{"op": "subscribe", "id": 1}'):
            await socket.send(text)
            assert (await hear(socket, "error"))["code"] in ("invalid_request", "invalid_name")
        await socket.send(b"\x00")
        assert (await hear(socket, "error"))["code"] == "invalid_request"
        await say(socket, op="subscribe", id=1, robots="*", topics="/a", mode="both")
        assert (await hear(socket, "error"))["id"] == 1


@shared
async def test_socket_of_another_page_is_refused(ready: Ready) -> None:
    with pytest.raises(InvalidStatus) as caught:
        await connect(ready.url.replace("http", "ws") + "/api/v1/stream", origin="http://evil.example", proxy=None)
    assert caught.value.response.status_code == 403
    assert json.loads(caught.value.response.body)["code"] == "origin_not_allowed"
