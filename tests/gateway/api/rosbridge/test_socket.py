"""rosbridge over a real gateway, with a scripted robot: what is subscribed, published, called, and by whom."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import cbor2
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from gateway.domain.principal import Role
from gateway.live import demand_manager
from gateway.live.demand import DemandTable
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.interfaces.nav_msgs.srv import SetMap
from metaros.interfaces.sensor_msgs.msg import CompressedImage, LaserScan
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import SetBool
from tests.gateway.harness import (
    DATA,
    OPERATOR_KEY,
    RING,
    ScriptedAgent,
    channel,
    client,
    hear,
    knows,
    open_socket,
    running_gateway,
    say,
)
from tests.support.gateways.memory_authenticator import bearer

VIEWER_KEY = RING.add(role=Role.VIEWER, name="rosbridge viewer")
REMOTE_KEY = RING.add(role=Role.OPERATOR, name="of another robot", robots=("other",))
TEXT, SCAN, IMAGE = "std_msgs/msg/String", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CompressedImage"
FIBONACCI = "example_interfaces/Fibonacci"


@asynccontextmanager
async def world(folder: Path, **settings: Any) -> AsyncIterator[tuple[Ready, ScriptedAgent]]:
    """A gateway and sim_1, which announces a text, a scan and an image."""
    async with running_gateway(folder, **settings) as ready, ScriptedAgent(ready) as agent:
        kinds = {"/sim_1/chat": TEXT, "/sim_1/scan": SCAN, "/sim_1/image": IMAGE}
        await agent.announce(*(channel(number, topic, kind) for number, (topic, kind) in enumerate(kinds.items(), 1)))
        await knows(ready, "sim_1", *kinds)
        yield ready, agent


async def settled(socket: ClientConnection) -> None:
    """Whatever was said before has been taken in."""
    await say(socket, op="call_service", service="rosapi/get_time", id="settled")
    await hear(socket, "service_response")


async def texts(agent: ScriptedAgent, first: int, *words: str) -> None:
    """Publish on the chat."""
    await agent.samples(1, first, [codec(TEXT).encode(String(data=word)) for word in words])
    await agent.next("ack", DATA)


async def test_a_subscriber_hears_a_topic_by_the_name_that_it_gave(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge/sim_1") as socket:
        await say(socket, op="subscribe", topic="sim_1/chat", type="std_msgs/String")
        await settled(socket)
        await texts(agent, 1, "a", "b")
        received = [await hear(socket, "publish") for _ in range(2)]
        assert [(item["topic"], item["msg"]) for item in received] == [("sim_1/chat", {"data": w}) for w in "ab"]
        await say(socket, op="unsubscribe", topic="sim_1/chat")
        await settled(socket)
        await texts(agent, 3, "c")
        await say(socket, op="subscribe", id="again", topic="/sim_1/chat")
        await settled(socket)
        await texts(agent, 4, "d")
        assert (await hear(socket, "publish"))["msg"] == {"data": "d"}


async def test_the_own_port_needs_no_path(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, _):
        url = f"ws://127.0.0.1:{ready.rosbridge_port}/?token={OPERATOR_KEY}"
        async with connect(url, proxy=None) as socket:
            await say(socket, op="call_service", service="/rosapi/topics", id="t")
            answer = await hear(socket, "service_response")
            assert answer["id"] == "t"
            assert answer["values"]["topics"] == ["/sim_1/chat", "/sim_1/image", "/sim_1/scan"]
            assert answer["values"]["types"] == [TEXT, IMAGE, SCAN]


async def test_every_compression_carries_the_same_message(tmp_path: Path) -> None:
    scan = LaserScan(ranges=[1.0, float("nan"), float("inf")], range_max=9.5)
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge") as socket:
        for compression in ("none", "cbor", "cbor-raw", "png"):
            async with open_socket(ready, "/rosbridge") as other:
                await say(other, op="subscribe", topic="/sim_1/scan", compression=compression)
                await settled(other)
                sequence = 1 + ("none", "cbor", "cbor-raw", "png").index(compression)
                await agent.samples(2, sequence, [codec(SCAN).encode(scan)], stamp_ns=5_000_000_007)
                frame = await asyncio.wait_for(other.recv(), 60)
                if compression == "none":
                    assert json.loads(frame)["msg"]["ranges"] == [1.0, None, None]
                elif compression == "png":
                    assert json.loads(frame)["op"] == "png"
                else:
                    assert isinstance(frame, bytes)
                    found = cbor2.loads(frame)
                    assert (found["op"], found["topic"]) == ("publish", "/sim_1/scan")
                    raw = found["msg"]
                    if compression == "cbor":
                        assert (raw["range_max"], raw["ranges"].tag) == (9.5, 85)
                    else:
                        assert (raw["secs"], raw["nsecs"], raw["bytes"]) == (5, 7, codec(SCAN).encode(scan))
        await say(socket, op="subscribe", topic="/sim_1/scan", compression="zip", id="z")
        assert (await hear(socket, "status"))["id"] == "z"


async def test_long_messages_come_in_pieces_and_bytes_as_base64(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge") as socket:
        await say(socket, op="subscribe", topic="/sim_1/image", fragment_size=1000)
        await settled(socket)
        image = CompressedImage(format="jpeg", data=bytes(3000))
        await agent.samples(3, 1, [codec(IMAGE).encode(image)])
        pieces = [await hear(socket, "fragment")]
        while len(pieces) < pieces[0]["total"]:
            pieces.append(await hear(socket, "fragment"))
        found = json.loads("".join(piece["data"] for piece in sorted(pieces, key=lambda piece: piece["num"])))
        assert len(found["msg"]["data"]) == 4000


async def test_what_is_published_reaches_the_robot_in_order(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge/sim_1") as socket:
        await say(socket, op="advertise", id="a", topic="/sim_1/chat", type="std_msgs/String", latch=False)
        for number in range(50):
            await say(socket, op="publish", id=f"p{number}", topic="/sim_1/chat", msg={"data": str(number)})
        received = []
        for _ in range(50):
            command = (await agent.next("command")).command
            received.append(codec(TEXT).decode(command.publish.payload).data)
            await agent.answer(command)
        assert received == [str(number) for number in range(50)]
        await say(socket, op="publish", id="bad", topic="/sim_1/chat", msg={"date": "x"})
        status = await hear(socket, "status")
        assert (status["id"], status["code"], status["level"]) == ("bad", "invalid_field", "error")
        await say(socket, op="advertise", id="b", topic="/sim_1/chat", type="std_msgs/Int32")
        assert "has type std_msgs/msg/String" in (await hear(socket, "status"))["msg"]
    async with running_gateway(tmp_path) as ready, client(ready, key=RING.add(role=Role.ADMIN, name="a")) as http:
        rows = (await http.get("/api/v1/audit", params={"action": "robots.publish"})).json()["rows"]
        assert [row["detail"] for row in rows] == [
            "sim_1 /sim_1/chat ends: 50 sent, 0 refused",
            "sim_1 /sim_1/chat begins",
        ]


async def test_a_viewer_may_look_and_not_act(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge/sim_1", key=VIEWER_KEY) as socket:
        await say(socket, op="publish", id="p", topic="/sim_1/chat", msg={"data": "x"})
        assert (await hear(socket, "status"))["code"] == "forbidden"
        await say(socket, op="call_service", id="c", service="/sim_1/reset", type="std_srvs/Trigger")
        answer = await hear(socket, "service_response")
        assert (answer["result"], answer["id"]) == (False, "c")
        await say(socket, op="send_action_goal", id="g", action="/sim_1/go", action_type="example_interfaces/Fibonacci")
        assert (await hear(socket, "action_result"))["result"] is False
        for op in ("advertise_service", "advertise_action"):
            name = op.removeprefix("advertise_")
            await say(socket, op=op, id=op, **{name: "/sim_1/mine"}, type="std_srvs/Trigger")
            assert (await hear(socket, "status"))["code"] == "forbidden"
        await say(socket, op="subscribe", topic="/sim_1/chat")
        await settled(socket)
        await texts(agent, 1, "seen")
        assert (await hear(socket, "publish"))["msg"] == {"data": "seen"}
        assert agent.frames[1].empty() or all(kind != "command" for kind in await drained(agent))


async def drained(agent: ScriptedAgent) -> list[str]:
    """The kinds of frames that came down the control lane."""
    kinds = []
    while not agent.frames[1].empty():
        kinds.append(str((await agent.frames[1].get()).WhichOneof("frame")))
    return kinds


async def test_a_robot_out_of_scope_does_not_exist(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent):
        for path in ("/rosbridge/sim_1", "/rosbridge?robot=sim_1", "/rosbridge/nobody"):
            with pytest.raises(InvalidStatus) as refused:
                await open_socket(ready, path, key=REMOTE_KEY).__aenter__()
            assert refused.value.response.status_code in (403, 404)
        async with open_socket(ready, "/rosbridge", key=REMOTE_KEY) as socket:
            for request in (
                {"op": "subscribe", "topic": "/sim_1/chat"},
                {"op": "publish", "topic": "/sim_1/chat", "msg": {}, "type": TEXT},
                {"op": "advertise_service", "service": "/sim_1/x", "type": "std_srvs/Trigger"},
            ):
                await say(socket, **request)
                assert (await hear(socket, "status"))["code"] == "unknown_robot", request
            await say(socket, op="call_service", service="rosapi/topics", id="t")
            assert (await hear(socket, "service_response"))["values"]["topics"] == []
            assert (await texts_unheard(agent, socket)) is None


async def texts_unheard(agent: ScriptedAgent, socket: ClientConnection) -> Any:
    """Publish on the chat; what came to the socket before the next answer."""
    await texts(agent, 1, "secret")
    await say(socket, op="call_service", service="rosapi/get_time", id="x")
    found = json.loads(await asyncio.wait_for(socket.recv(), 60))
    return None if found["op"] == "service_response" else found


async def test_services_are_called_by_name_with_rosbridges_values(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge") as socket:
        await say(socket, op="call_service", id="c", service="/sim_1/say", type="std_srvs/srv/SetBool", args=[True])
        command = (await agent.next("command")).command
        call = command.call_service
        assert (call.service, call.type_name) == ("/sim_1/say", "std_srvs/srv/SetBool")
        assert codec("std_srvs/srv/SetBool_Request").decode(call.request).data is True
        response = codec("std_srvs/srv/SetBool_Response")
        await agent.answer(command, payload=response.encode(SetBool.Response(success=True, message="ja")))
        answer = await hear(socket, "service_response")
        assert (answer["id"], answer["service"], answer["result"]) == ("c", "/sim_1/say", True)
        assert answer["values"] == {"success": True, "message": "ja"}
        await say(socket, op="call_service", id="d", service="/sim_1/nothing")
        answer = await hear(socket, "service_response")
        assert (answer["id"], answer["result"]) == ("d", False)
        await say(socket, op="call_service", id="e", service="/sim_1/say", type="std_srvs/srv/SetBool", args={})
        await agent.answer((await agent.next("command")).command, code="unavailable")
        answer = await hear(socket, "service_response")
        assert (answer["id"], answer["result"], answer["values"]) == ("e", False, "unavailable")


async def test_a_call_and_a_goal_each_take_one_from_the_robots_rate(tmp_path: Path) -> None:
    two = 0.4  # a second: a burst of two
    async with world(tmp_path, robot_requests_per_s=two) as (ready, agent), open_socket(ready, "/rosbridge") as socket:
        await say(socket, op="call_service", id="c", service="/sim_1/say", type="std_srvs/SetBool", args=[True])
        assert (await agent.next("command")).command.call_service.service == "/sim_1/say"
        await say(socket, op="send_action_goal", id="g", action="/sim_1/count", action_type=FIBONACCI)
        assert (await agent.next("command")).command.send_goal.action == "/sim_1/count"


async def test_an_actuator_needs_the_lease_and_drive_takes_it(tmp_path: Path) -> None:
    twist = {"linear": {"x": 0.5}}
    publish = {"op": "publish", "topic": "/sim_1/cmd_vel", "type": "geometry_msgs/Twist", "msg": twist}
    async with world(tmp_path) as (ready, agent):
        async with open_socket(ready, "/rosbridge/sim_1") as socket:
            await say(socket, id="p", **publish)
            assert (await hear(socket, "status"))["code"] == "lease_required"
        async with open_socket(ready, "/rosbridge/sim_1?drive=page") as socket:
            await say(socket, **publish)
            grant = (await agent.next("command")).command
            assert grant.grant_lease.holder == "page"
            await agent.answer(grant)
            moved = (await agent.next("command")).command
            assert (moved.lease_id, moved.publish.topic) == (grant.grant_lease.lease_id, "/sim_1/cmd_vel")
            await agent.answer(moved)
            async with open_socket(ready, "/rosbridge/sim_1?drive=other") as second:
                await say(second, id="q", **publish)
                assert (await hear(second, "status"))["code"] == "lease_taken"
        released = (await agent.next("command")).command
        assert released.release_lease.lease_id == grant.grant_lease.lease_id
        await agent.answer(released)


async def test_nobody_known_is_reported_to_sign_in(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready:
        with pytest.raises(InvalidStatus) as refused:
            await connect(f"ws://127.0.0.1:{ready.rosbridge_port}", proxy=None)
        assert refused.value.response.status_code == 401
        headers = bearer(OPERATOR_KEY)
        async with connect(f"ws://127.0.0.1:{ready.rosbridge_port}", proxy=None, additional_headers=headers) as socket:
            await settled(socket)


async def test_a_service_of_a_client_is_offered_on_the_robot_and_goes_with_it(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent):
        async with open_socket(ready, "/rosbridge/sim_1") as socket:
            await say(socket, op="advertise_service", service="/sim_1/ask", type="nav_msgs/SetMap", id="o")
            offers = (await agent.next("offers")).offers
            (offer,) = offers.offers
            assert (offer.name, offer.type_name, offer.action) == ("/sim_1/ask", "nav_msgs/srv/SetMap", False)
            states = link_pb2.OfferStates(states=[link_pb2.OfferState(number=offer.number)])
            await agent.send(1, offer_states=states)
            request = SetMap.Request()
            request.map.data = [5] * 100
            payload = codec("nav_msgs/srv/SetMap_Request").encode(request)
            await agent.send(1, asked=link_pb2.OfferAsked(ask=7, number=offer.number, request=payload))
            asked = await hear(socket, "call_service")
            assert (asked["service"], asked["args"]["map"]["data"]) == ("/sim_1/ask", [5] * 100)
            await say(socket, op="service_response", id=asked["id"], service="/sim_1/ask", values={"success": True})
            answer = (await agent.next("offer_answer")).offer_answer
            assert (answer.ask, answer.ok, answer.ended) == (7, True, True)
            assert codec("nav_msgs/srv/SetMap_Response").decode(answer.payload).success
            await say(socket, op="service_response", id=asked["id"], values={}, result=True)
            assert "waits for an answer" in (await hear(socket, "status"))["msg"]
        assert not (await agent.next("offers")).offers.offers


async def test_a_large_message_comes_whole_from_who_may_publish(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent):
        large = {"op": "publish", "topic": "/sim_1/image", "msg": {"format": "raw", "data": "A" * 400_000}}
        async with open_socket(ready, "/rosbridge/sim_1") as socket:
            await say(socket, **large)
            command = (await agent.next("command")).command
            assert len(codec(IMAGE).decode(command.publish.payload).data) == 300_000
            await agent.answer(command)
        async with open_socket(ready, "/rosbridge/sim_1", key=VIEWER_KEY) as socket:
            await say(socket, **large)
            with pytest.raises(ConnectionClosed):
                await asyncio.wait_for(socket.recv(), 60)
            assert socket.close_code == 1009


async def test_rosapi_answers_by_either_name_and_with_arguments_in_a_list(tmp_path: Path) -> None:
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge/sim_1") as socket:
        own = channel(9, "/sim_1/own", TEXT)
        own.schema_name, own.type_hash, own.schema = "mine/msg/Own", "", b"float32[3] speed\nstd_msgs/Header header"
        own.schema += b"\n" + b"=" * 80 + b"\nMSG: std_msgs/Header\nstring frame_id"
        await agent.announce(own)

        async def ask(service: str, args: Any = None) -> dict[str, Any]:
            await say(socket, op="call_service", id=service, service=service, args=args)
            answer = await hear(socket, "service_response")
            assert (answer["id"], answer["service"]) == (service, service)
            return answer

        for name in ("rosapi/topic_type", "/rosapi/topic_type"):
            for args in ({"topic": "/sim_1/scan"}, ["sim_1/scan"]):
                assert (await ask(name, args))["values"] == {"type": SCAN}
        assert (await ask("/rosapi/get_ros_version"))["values"] == {"version": 2, "distro": "jazzy"}
        assert (await ask("/rosapi/topics_for_type", {"type": "std_msgs/String"}))["values"]["topics"] == [
            "/sim_1/chat"
        ]
        found: dict[str, Any] = {"result": False}
        while not found["result"]:  # the announcement is on another connection
            found = await ask("/rosapi/message_details", {"type": "mine/Own"})
        first, second = found["values"]["typedefs"]
        assert (first["type"], first["fieldnames"], first["fieldarraylen"]) == (
            "mine/msg/Own",
            ["speed", "header"],
            [3, -1],
        )
        assert second["fieldnames"] == ["frame_id"]
        for name, args in {
            "/rosapi/message_details": {"type": "no/Such"},
            "/rosapi/topic_type": {},
            "/rosapi/dance": {},
            "/rosapi/get_param": {"name": "speed"},
        }.items():
            assert (await ask(name, args))["result"] is False, name


async def test_the_robot_is_asked_for_what_its_clients_want(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demand_manager, "DemandTable", partial(DemandTable, hold_s=0.05))
    monkeypatch.setattr(demand_manager, "RELEASE_S", 0.02)
    async with world(tmp_path) as (ready, agent), open_socket(ready, "/rosbridge/sim_1") as slow:
        await agent.announce(channel(8, "/sim_1/camera", TEXT, delivery=4))
        await say(slow, op="subscribe", topic="/sim_1/camera", throttle_rate=500)
        (entry,) = (await agent.next("demand")).demand.entries
        assert (entry.channel_id, entry.max_rate_hz) == (8, 2.0)
        async with open_socket(ready, "/rosbridge/sim_1") as fast:
            await say(fast, op="subscribe", topic="/sim_1/camera", throttle_rate=50)
            (entry,) = (await agent.next("demand")).demand.entries
            assert entry.max_rate_hz == 20.0
        (entry,) = (await agent.next("demand")).demand.entries
        assert entry.max_rate_hz == 2.0
