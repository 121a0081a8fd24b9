"""A Foxglove client and a real gateway: samples, publishing, what is refused, and who sees what."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from gateway.domain.principal import Role
from metaros.idl import schema_text
from tests.gateway.api.foxglove.robot import STRING, TRIGGER, Answering, endpoint, made, text
from tests.gateway.api.foxglove.viewer import Viewer, viewing
from tests.gateway.harness import RING, channel, client, flood, running_gateway
from tests.support.waiting import wait_until_async

VIEWER_KEY = RING.add(role=Role.VIEWER, name="looker")
SCOPED_KEY = RING.add(role=Role.OPERATOR, robots=("sim_1",), name="scoped")


async def test_the_first_messages_and_a_sample_as_its_robot_sent_it(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot, viewing(ready, "/sim_1") as viewer:
        info = await viewer.next()
        assert isinstance(info, dict)
        assert (info["op"], info["name"], info["metadata"]["robot"]) == ("serverInfo", "Meta-ROS sim_1", "sim_1")
        assert "playbackControl" not in info["capabilities"]  # nothing is stored yet
        assert (await viewer.next())["op"] == "advertise"  # type: ignore[index,call-overload]
        await robot.agent.announce(channel(1, "/sim_1/chatter", STRING))
        offered = await viewer.channel("/sim_1/chatter")
        assert (offered["encoding"], offered["schemaEncoding"]) == ("cdr", "ros2msg")
        assert (offered["schemaName"], offered["schema"]) == (STRING, schema_text(STRING))
        await viewer.subscribe(7, "/sim_1/chatter")
        await viewer.say("getParameters", parameterNames=["none"], id="ready")
        await viewer.hear("parameterValues")
        await robot.agent.samples(1, 1, [text("one"), text("two")], stamp_ns=123)
        assert [await viewer.data(), await viewer.data()] == [(7, 123, text("one")), (7, 124, text("two"))]
        await viewer.say("unsubscribe", subscriptionIds=[7])
        await viewer.say("getParameters", parameterNames=["none"], id="over")
        await viewer.hear("parameterValues")
        await robot.agent.samples(1, 3, [text("three")])
        clock = await viewer.binary(2)
        assert struct.unpack("<Q", clock)[0] > 10**18


@pytest.mark.parametrize("offered", [["foxglove.websocket.v1", "foxglove.sdk.v1"], ["foxglove.websocket.v1"]])
async def test_both_subprotocols_are_spoken_and_the_newer_preferred(tmp_path: Path, offered: list[str]) -> None:
    async with running_gateway(tmp_path) as ready, viewing(ready, subprotocols=offered) as viewer:
        assert viewer.socket.subprotocol == offered[-1]
        assert (await viewer.hear("serverInfo"))["name"] == "Meta-ROS fleet"


async def test_who_speaks_something_else_is_reported_what_is_spoken(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for offered in (None, ["chat.v1"]):
            with pytest.raises(InvalidStatus) as refused:
                async with viewing(ready, subprotocols=offered):
                    pass
            assert refused.value.response.status_code == 400
            assert b"foxglove.sdk.v1" in (refused.value.response.body or b"")


async def test_robots_out_of_scope_do_not_exist(tmp_path: Path) -> None:
    async with (
        running_gateway(tmp_path, anonymous=False) as ready,
        Answering.of(ready) as mine,
        Answering.of(ready, "sim_2") as other,
    ):
        await mine.agent.announce(channel(1, "/sim_1/chatter", STRING))
        await other.agent.announce(channel(1, "/sim_2/chatter", STRING))
        async with viewing(ready) as all_of_them, viewing(ready, key=SCOPED_KEY) as scoped:
            await all_of_them.channel("/sim_1/chatter")
            await all_of_them.channel("/sim_2/chatter")
            await scoped.channel("/sim_1/chatter")
            while not scoped.services:
                await scoped.next()
            await scoped.say("subscribeConnectionGraph")
            graph = await scoped.hear("connectionGraphUpdate")
            assert {item["name"] for item in graph["publishedTopics"]} == {"/sim_1/chatter"}
            assert set(scoped.channels) == {"/sim_1/chatter"}
            assert {name.split("/")[1] for name in scoped.services} == {"sim_1"}
            hidden = all_of_them.channels["/sim_2/chatter"]["id"]
            assert hidden not in {item["id"] for item in scoped.channels.values()}
            await scoped.say("subscribe", subscriptions=[{"id": 1, "channelId": 999_999}])
            assert (await scoped.hear("status"))["message"] == "Unknown channel ID: 999999"
        for path, key, status in (("/sim_2", SCOPED_KEY, 404), ("/nobody", SCOPED_KEY, 404), ("/", "", 401)):
            with pytest.raises(InvalidStatus) as refused:
                async with viewing(ready, path, key=key):
                    pass
            assert refused.value.response.status_code == status
        async with viewing(ready, "?robot=sim_2") as one:
            assert (await one.hear("serverInfo"))["metadata"]["robot"] == "sim_2"


async def test_what_a_client_publishes_reaches_the_robot(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot, viewing(ready, "/sim_1") as viewer:
        await viewer.say(
            "advertise",
            channels=[
                {"id": 1, "topic": "/sim_1/orders", "encoding": "json", "schemaName": STRING},
                {"id": 2, "topic": "/sim_1/orders", "encoding": "cdr", "schemaName": STRING},
            ],
        )
        await viewer.socket.send(struct.pack("<BI", 1, 1) + b'{"data": "by json"}')
        await viewer.socket.send(struct.pack("<BI", 1, 2) + text("by cdr"))
        await wait_until_async(lambda: len(robot.published) == 2)
        reported = [("/sim_1/orders", STRING, text("by json")), ("/sim_1/orders", STRING, text("by cdr"))]
        assert robot.published == reported
        await viewer.say("unadvertise", channelIds=[1, 2])
        await viewer.socket.send(struct.pack("<BI", 1, 1) + b"{}")
        assert (await viewer.hear("status"))["message"] == "Unknown channel ID: 1"
        async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as http:
            for _ in range(200):  # the row of what is over is written a moment later
                rows = (await http.get("/api/v1/audit", params={"action": "robots.publish"})).json()["rows"]
                if any("2 sent" in row["detail"] for row in rows):
                    break
                await asyncio.sleep(0.1)
            else:
                raise AssertionError(rows)


async def test_who_may_publish_may_send_a_map(tmp_path: Path) -> None:
    large = {"id": 1, "topic": "/sim_1/orders", "encoding": "cdr", "schemaName": STRING}
    payload = text("x" * 500_000)
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot:
        async with viewing(ready, "/sim_1") as viewer:
            await viewer.say("advertise", channels=[large])
            await viewer.socket.send(struct.pack("<BI", 1, 1) + payload)
            await wait_until_async(lambda: robot.published)
            assert robot.published[0][2] == payload
        async with viewing(ready, "/sim_1", key=VIEWER_KEY) as viewer:
            await viewer.socket.send(struct.pack("<BI", 1, 1) + payload)
            with pytest.raises(ConnectionClosed):
                await viewer.hear("nothing")
            assert viewer.socket.close_code == 1009


async def test_a_long_message_is_not_overtaken_by_short_ones(tmp_path: Path) -> None:
    orders = {"id": 1, "topic": "/sim_1/orders", "encoding": "json", "schemaName": STRING}
    said = ["long " * 100_000, *map(str, range(20))]
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot, viewing(ready, "/sim_1") as viewer:
        await viewer.say("advertise", channels=[orders])
        for data in said:
            await viewer.socket.send(struct.pack("<BI", 1, 1) + json.dumps({"data": data}).encode())
        await wait_until_async(lambda: len(robot.published) == len(said))
        assert [payload for _, _, payload in robot.published] == [text(data) for data in said]


async def test_who_publishes_too_fast_is_reported_so_before_the_socket_ends(tmp_path: Path) -> None:
    orders = {"id": 1, "topic": "/sim_1/orders", "encoding": "json", "schemaName": STRING}
    async with (
        running_gateway(tmp_path, robot_requests_per_s=0.2) as ready,  # one at once: to advertise takes it
        Answering.of(ready),
        viewing(ready, "/sim_1") as viewer,
    ):
        await viewer.say("advertise", channels=[orders])
        await viewer.socket.send(struct.pack("<BI", 1, 1) + b"{}")
        assert (await viewer.hear("status"))["message"].endswith("(too_many_requests)")
        hearing = asyncio.create_task(last_status(viewer))
        with pytest.raises(ConnectionClosed) as closed:
            await flood(viewer.socket, op="unsubscribe", subscriptionIds=[])
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "too_many_requests")
        last = await hearing
        assert last["level"] == 2
        assert "150 frames" in last["message"]
        assert last["message"].endswith("(too_many_requests)")


async def last_status(viewer: Viewer) -> dict[str, Any]:
    """The last one before the socket ends."""
    found: dict[str, Any] = {}
    with contextlib.suppress(ConnectionClosed):
        while True:
            found = await viewer.hear("status")
    return found


async def test_a_viewer_looks_and_an_operator_without_a_lease_does_not_drive(tmp_path: Path) -> None:
    drive = {"id": 1, "topic": "/sim_1/cmd_vel", "encoding": "json", "schemaName": "geometry_msgs/msg/Twist"}
    speak = {"id": 2, "topic": "/sim_1/orders", "encoding": "json", "schemaName": STRING}
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot:
        async with viewing(ready, "/sim_1", key=VIEWER_KEY) as viewer:
            await viewer.say("advertise", channels=[speak])
            said = await viewer.hear("status")
            assert (said["level"], said["id"]) == (2, "publish /sim_1/orders")
            assert "operator" in said["message"]
        async with viewing(ready, "/sim_1") as viewer:
            await viewer.say("advertise", channels=[drive])
            await viewer.socket.send(struct.pack("<BI", 1, 1) + b'{"linear": {"x": 1.0}}')
            assert "lease" in (await viewer.hear("status"))["message"]
        assert robot.published == []


async def test_a_teleop_panel_drives_under_a_lease_of_its_own(tmp_path: Path) -> None:
    twist = {"id": 1, "topic": "/sim_1/cmd_vel", "encoding": "json", "schemaName": "geometry_msgs/msg/Twist"}
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot:
        async with viewing(ready, "/sim_1?drive=panel") as viewer:
            await viewer.say("advertise", channels=[twist])
            for _ in range(5):
                await viewer.socket.send(struct.pack("<BI", 1, 1) + b'{"linear": {"x": 1.0}}')
            await wait_until_async(lambda: len(robot.published) == 5)
            assert robot.lease
            async with client(ready) as http, viewing(ready, "/sim_1?drive=other") as other:
                lease = (await http.get("/api/v1/robots/sim_1")).json()["lease"]
                assert lease["holder"] == "panel"
                await other.say("advertise", channels=[twist])
                await other.socket.send(struct.pack("<BI", 1, 1) + b'{"linear": {"x": -1.0}}')
                assert "lease_taken" in (await other.hear("status"))["message"]
        await wait_until_async(lambda: robot.released)
        assert len(robot.published) == 5


async def test_a_service_answers_in_the_callers_encoding(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, Answering.of(ready), viewing(ready, "/sim_1") as viewer:
        while "/sim_1/base/resume" not in viewer.services:
            await viewer.next()
        service = viewer.services["/sim_1/base/resume"]
        assert service["type"] == TRIGGER
        assert "bool success" in service["response"]["schema"]
        for encoding, request in (("json", b"{}"), ("cdr", made(f"{TRIGGER}_Request", {}))):
            head = struct.pack("<BIII", 2, service["id"], 5, len(encoding)) + encoding.encode()
            await viewer.socket.send(head + request)
            answer = await viewer.binary(3)
            number, call, size = struct.unpack_from("<III", answer)
            assert (number, call, answer[12 : 12 + size].decode()) == (service["id"], 5, encoding)
            body = answer[12 + size :]
            values = {"success": True, "message": "on"}
            assert body == made(f"{TRIGGER}_Response", values) if encoding == "cdr" else json.loads(body) == values
        await viewer.socket.send(struct.pack("<BIII", 2, 4_000_000, 6, 4) + b"json{}")
        failure = await viewer.hear("serviceCallFailure")
        assert (failure["callId"], failure["message"]) == (6, "Unknown service ID: 4000000")


async def test_parameters_are_read_set_and_watched(tmp_path: Path) -> None:
    speed = {"name": "/sim_1/base.speed", "value": 1.5, "type": "float64"}
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot, viewing(ready, "/sim_1") as viewer:
        while not viewer.services:
            await viewer.next()
        await viewer.say("getParameters", parameterNames=[], id="all")
        said = await viewer.hear("parameterValues")
        assert (said["id"], said["parameters"]) == ("all", [speed])
        await viewer.say("setParameters", parameters=[{**speed, "value": 2}], id="set")
        said = await viewer.hear("parameterValues")
        assert (said["id"], said["parameters"]) == ("set", [{**speed, "value": 2.0}])
        assert robot.speed == 2.0
        await viewer.say("subscribeParameterUpdates", parameterNames=[speed["name"]])
        await viewer.say("getParameters", parameterNames=[speed["name"]], id="again")
        await viewer.hear("parameterValues")
        robot.speed = 2.5
        news = await hear_news(viewer, robot)
        assert news["parameters"] == [{**speed, "value": robot.speed}]


async def hear_news(viewer: Viewer, robot: Answering) -> dict[str, object]:
    """What is told unasked; the value changes until it is, as the first look only takes it in."""
    while True:
        robot.speed += 1.0
        said = await viewer.next()
        if isinstance(said, dict) and said["op"] == "parameterValues":
            robot.speed = said["parameters"][0]["value"]
            return said


async def test_the_graph_is_reported_whole_and_then_as_it_changes(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, Answering.of(ready) as robot, viewing(ready, "/sim_1") as viewer:
        while not viewer.services:
            await viewer.next()
        await viewer.say("subscribeConnectionGraph")
        first = await viewer.hear("connectionGraphUpdate")
        assert first["publishedTopics"] == [{"name": "/sim_1/chatter", "publisherIds": ["/sim_1/base"]}]
        assert first["subscribedTopics"] == [{"name": "/sim_1/orders", "subscriberIds": ["/sim_1/base"]}]
        assert {"name": "/sim_1/base/resume", "providerIds": ["/sim_1/base"]} in first["advertisedServices"]
        extra = endpoint(9, "publisher", "/sim_1/scan", "sensor_msgs/msg/LaserScan", "/sim_1/lidar")
        await robot.tell_graph("sim_1", revision=2, extra=(extra,))
        news = await viewer.hear("connectionGraphUpdate")
        assert news["publishedTopics"] == [{"name": "/sim_1/scan", "publisherIds": ["/sim_1/lidar"]}]
        assert news["advertisedServices"] == news["subscribedTopics"] == news["removedTopics"] == []


async def test_files_come_from_the_assets_directory_alone(tmp_path: Path) -> None:
    folder = tmp_path / "assets"
    (folder / "arm" / "meshes").mkdir(parents=True)
    (folder / "arm" / "meshes" / "link.stl").write_bytes(b"solid")
    async with running_gateway(tmp_path, assets_dir=folder) as ready, viewing(ready) as viewer:
        assert "assets" in (await viewer.hear("serverInfo"))["capabilities"]
        await viewer.say("fetchAsset", uri="package://arm/meshes/link.stl", requestId=3)
        assert await viewer.binary(4) == struct.pack("<IBI", 3, 0, 0) + b"solid"
        await viewer.say("fetchAsset", uri="package://arm/../../data/local.key", requestId=4)
        answer = await viewer.binary(4)
        assert struct.unpack_from("<IB", answer) == (4, 1)


async def test_what_cannot_be_read_is_reported_and_the_connection_stays(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, viewing(ready) as viewer:
        for wrong in ("no json", '{"op": "dance"}', b"\xff", b"", struct.pack("<BI", 1, 5)):
            await viewer.socket.send(wrong)
            assert (await viewer.hear("status"))["level"] == 2
        await viewer.say("subscribeConnectionGraph")
        await viewer.hear("connectionGraphUpdate")


async def test_a_credential_that_ends_ends_the_connection(tmp_path: Path, attentive: None) -> None:
    key = RING.add(role=Role.VIEWER)
    async with running_gateway(tmp_path) as ready, viewing(ready, key=key) as viewer:
        await viewer.hear("serverInfo")
        RING.revoke(key)
        with pytest.raises(ConnectionClosed):
            await viewer.hear("nothing")
        assert viewer.socket.close_code == 4401
