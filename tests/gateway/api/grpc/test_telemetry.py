"""TelemetryService and EventService over a real gateway: stored messages, goals, events, readers that do not read."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest

from gateway.domain.principal import Role
from gateway.main import Ready
from metaros._proto import events_pb2, events_pb2_grpc, link_pb2, telemetry_pb2, telemetry_pb2_grpc
from metaros.cdr import codec
from metaros.idl.json import from_json
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, channel, client, running_gateway
from tests.support.gateways.memory_authenticator import bearer
from tests.support.waiting import wait_until_async

OPERATOR = RING.add(role=Role.OPERATOR)
ADMIN = RING.add(role=Role.ADMIN)
REMOTE = RING.add(role=Role.VIEWER, robots=("other_*",))
STRING = "std_msgs/msg/String"
PERCENT = link_pb2.Series(series_id=1, name="battery.percentage", topic="/sim_1/battery", field="percentage")


def known_by(key: str) -> tuple[tuple[str, str], ...]:
    """Metadata with a key."""
    return tuple((name.lower(), value) for name, value in bearer(key).items())


@asynccontextmanager
async def telemetry(ready: Ready) -> AsyncIterator[Any]:
    """A stub of the service."""
    async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}") as opened:
        yield telemetry_pb2_grpc.TelemetryServiceStub(opened)


def cdr(type_name: str, value: dict[str, Any]) -> bytes:
    """A message of that type, by its JSON."""
    return codec(type_name).encode(from_json(type_name, value))


def text(number: int) -> bytes:
    """A std_msgs/String."""
    return cdr(STRING, {"data": f"message {number}"})


async def until_stored(ready: Ready, count: int) -> None:
    """So many messages of sim_1's only topic are in the store."""
    async with client(ready) as http, asyncio.timeout(60):
        while True:
            topics = (await http.get("/api/v1/robots/sim_1/history")).json()["topics"]
            if topics and topics[0]["samples"] == count:
                return
            await asyncio.sleep(0.02)


async def test_subscribe_introduces_each_channel_and_sends_what_is_wanted(tmp_path: Path) -> None:
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(tmp_path))
        agent = await stack.enter_async_context(ScriptedAgent(ready))
        other = await stack.enter_async_context(ScriptedAgent(ready, "other_1", session=b"o" * 16))
        stub = await stack.enter_async_context(telemetry(ready))
        await agent.announce(channel(1, "/sim_1/chatter", STRING), channel(2, "/sim_1/other", STRING), series=[PERCENT])
        await other.announce(channel(1, "/other_1/noise", STRING))

        def subscribe(key: str = OPERATOR, **asked: Any) -> Any:
            return stub.Subscribe(telemetry_pb2.SubscribeRequest(**asked), metadata=known_by(key), timeout=60)

        shapes = {"cdr": telemetry_pb2.ENCODING_CDR, "json": telemetry_pb2.ENCODING_JSON}
        calls = {name: subscribe(topics=["chat*"], encoding=shape) for name, shape in shapes.items()}
        calls["values"] = subscribe(series=["battery.*"])
        calls["elsewhere"] = subscribe(REMOTE, topics=["**"], series=["**"])
        read = {name: asyncio.ensure_future(call.read()) for name, call in calls.items()}
        seq = 1
        while not all(one.done() for one in read.values()):  # a call counts once it has reached the gateway
            await agent.samples(1, seq, [text(seq)], stamp_ns=seq)
            await agent.samples(2, seq, [text(seq)], stamp_ns=seq)
            await agent.rows(seq, [(1, seq, 0.5)])
            await other.samples(1, seq, [text(seq)], stamp_ns=seq)
            seq += 1
            await asyncio.sleep(0.02)
        await other.samples(1, seq, [text(seq)], stamp_ns=seq)
        for name in shapes:
            reported, reply = read[name].result().info, await calls[name].read()
            assert (reported.robot, reported.topic, reported.type_name) == ("sim_1", "/sim_1/chatter", STRING), name
            assert b"string data" in reported.schema
            assert reply.channel == reported.channel
            sample = reply.samples[0]
            shown = {"cdr": sample.cdr, "json": sample.json}[name]
            assert shown in (text(sample.seq), json.dumps({"data": f"message {sample.seq}"}, separators=(",", ":")))
        (values,) = read["values"].result().values
        assert (values.robot, dict(values.values)) == ("sim_1", {"battery.percentage": 0.5})
        received = [read["elsewhere"].result()]
        while seq not in (sample.seq for sample in received[-1].samples):
            received.append(await calls["elsewhere"].read())
        introduced = [reply.info.robot for reply in received if reply.HasField("info")]
        assert introduced == ["other_1"], "sim_1 is out of that key's scope"
        assert not any(reply.values for reply in received)
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await subscribe(topics=["*"], max_rate_hz=-1).read()
        assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT


async def test_a_subscriber_that_is_slow_loses_the_oldest_and_is_reported(tmp_path: Path) -> None:
    settings = {"viewer_stall_s": 60.0}
    async with running_gateway(tmp_path, **settings) as ready, ScriptedAgent(ready) as agent, telemetry(ready) as stub:
        await agent.announce(channel(1, "/sim_1/chatter", STRING))
        asked = telemetry_pb2.SubscribeRequest(topics=["chatter"], queue_bytes=600_000)
        call = stub.Subscribe(asked, metadata=known_by(OPERATOR), timeout=60)
        first = asyncio.ensure_future(call.read())
        seq, big = 1, cdr(STRING, {"data": "x" * 200_000})
        while not first.done():
            await agent.samples(1, seq, [text(seq)])
            seq += 1
            await asyncio.sleep(0.02)
        for _ in range(200):  # 40 MB: more than any buffer on the way
            await agent.samples(1, seq, [big])
            seq += 1
        await agent.samples(1, seq, [text(seq)])
        got = dropped = newest = 0
        while newest < seq or got + dropped < 201:
            reply = await call.read()
            dropped += reply.dropped
            got += len(reply.samples)
            newest = max(newest, *(sample.seq for sample in reply.samples), 0)
        assert dropped > 0
        assert got < 150
        call.cancel()


async def test_query_pages_through_a_range_and_says_where_it_ended(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent, telemetry(ready) as stub:
        stamp_ns = 1_700_000_000_000_000_000
        await agent.announce(channel(1, "/sim_1/chatter", STRING))
        await agent.samples(1, 1, [text(number) for number in range(1500)], stamp_ns=stamp_ns)
        await until_stored(ready, 1500)
        span = {"start": "2023-11-14T00:00:00Z", "end": "2023-11-15T00:00:00Z"}

        async def query(**more: Any) -> list[Any]:
            request = telemetry_pb2.QueryRequest(robot="sim_1", topics=["chatter"], **{**span, **more})
            return [reply async for reply in stub.Query(request, metadata=known_by(OPERATOR), timeout=60)]

        replies = await query()
        samples = [sample for reply in replies for sample in reply.samples]
        assert [sample.seq for sample in samples] == list(range(1, 1501))
        assert [sample.cdr for sample in samples] == [text(number) for number in range(1500)]
        (reported,) = [info for reply in replies for info in reply.channels]
        assert (reported.topic, reported.type_name, samples[-1].channel) == ("/sim_1/chatter", STRING, reported.channel)
        assert replies[-1].cursor == ""
        assert len(replies) == 2

        first = await query(limit=7, newest_first=True, encoding=telemetry_pb2.ENCODING_JSON)
        rest = await query(limit=2, newest_first=True, cursor=first[-1].cursor)
        assert json.loads(first[0].samples[0].json) == {"data": "message 1499"}
        assert [sample.seq for reply in (*first, *rest) for sample in reply.samples] == list(range(1500, 1491, -1))

        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await query(start="yesterday")
        assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
        request = telemetry_pb2.QueryRequest(robot="sim_1")
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await stub.Query(request, metadata=known_by(REMOTE), timeout=60).read()
        assert caught.value.code() is grpc.StatusCode.NOT_FOUND


async def test_a_stream_whose_reader_reads_nothing_is_ended(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "gateway.api.grpc.serving")
    async with running_gateway(tmp_path, viewer_stall_s=0.3) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/chatter", STRING))
        piece = cdr(STRING, {"data": "x" * 500_000})
        for seq in range(1, 81):
            await agent.samples(1, seq, [piece], stamp_ns=1_700_000_000_000_000_000 + seq)
        await until_stored(ready, 80)
        async with telemetry(ready) as stub:
            request = telemetry_pb2.QueryRequest(robot="sim_1", start="2023-11-14T00:00:00Z")
            call = stub.Query(request, metadata=known_by(OPERATOR), timeout=60)
            await call.read()
            await wait_until_async(lambda: "nothing of it was read" in caplog.text)
            replies = 1
            with contextlib.suppress(grpc.aio.AioRpcError):
                while await call.read() is not grpc.aio.EOF:
                    replies += 1
            assert replies < 40, "what was on its way, of 40 MB in replies of 1 MB"
            assert await call.code() is grpc.StatusCode.DEADLINE_EXCEEDED
            assert dict(await call.trailing_metadata())["metaros-code"] == "stalled"


async def test_streams_are_reported_that_the_gateway_ends(tmp_path: Path, attentive: None) -> None:
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(tmp_path, drain_s=20.0))
        opened = grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}")
        stub, asked = events_pb2_grpc.EventServiceStub(opened), events_pb2.WatchEventsRequest()
        watching = stub.WatchEvents(asked, metadata=known_by(OPERATOR), timeout=60)
        await watching.read()
        await stack.aclose()
        assert await watching.code() is grpc.StatusCode.UNAVAILABLE
        assert dict(await watching.trailing_metadata())["metaros-code"] == "not_ready"
        await opened.close()


async def test_a_goal_or_call_that_moves_the_robot_needs_the_lease(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready), telemetry(ready) as stub:
        goal = telemetry_pb2.SendGoalRequest(
            robot="sim_1", action="cmd_vel", type_name="example_interfaces/action/Fibonacci", lease_id="guess"
        )
        call = telemetry_pb2.CallServiceRequest(robot="sim_1", service="cmd_vel", type_name="std_srvs/srv/Trigger")
        for asked in (
            stub.SendGoal(goal, metadata=known_by(OPERATOR), timeout=60).read(),
            stub.CallService(call, metadata=known_by(OPERATOR), timeout=60),
        ):
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await asked
            assert dict(caught.value.trailing_metadata() or ())["metaros-code"] == "lease_required"


async def test_a_goal_from_its_start_to_its_result(tmp_path: Path) -> None:
    fibonacci = "example_interfaces/action/Fibonacci"
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(tmp_path))
        agent = await stack.enter_async_context(ScriptedAgent(ready))
        stub = await stack.enter_async_context(telemetry(ready))
        http = await stack.enter_async_context(client(ready, key=ADMIN))
        request = telemetry_pb2.SendGoalRequest(
            robot="sim_1", action="fibonacci", type_name=fibonacci, json='{"order": 3}'
        )
        call = stub.SendGoal(request, metadata=known_by(OPERATOR), timeout=60)
        asked = (await agent.next("command")).command
        assert asked.send_goal.action == "/sim_1/fibonacci"
        await agent.answer(asked, payload=cdr(f"{fibonacci}_SendGoal_Response", {"accepted": True}))
        goal = asked.send_goal.goal_id
        first = await call.read()
        assert (first.kind, first.status, first.goal) == ("status", "accepted", goal.hex())
        feedback = cdr(f"{fibonacci}_FeedbackMessage", {"feedback": {"sequence": [0, 1]}})
        await agent.send(
            CONTROL, goals=link_pb2.GoalEvents(events=[link_pb2.GoalEvent(goal_id=goal, status=2, feedback=feedback)])
        )
        reported = await call.read()
        assert (reported.kind, json.loads(reported.json)) == ("feedback", {"sequence": [0, 1]})
        watching = stub.WatchGoal(
            telemetry_pb2.WatchGoalRequest(robot="sim_1", goal=goal.hex()), metadata=known_by(OPERATOR), timeout=60
        )
        assert (await watching.read()).goal == goal.hex()
        call.cancel()
        cancelling = asyncio.ensure_future(
            stub.CancelGoal(
                telemetry_pb2.CancelGoalRequest(robot="sim_1", goal=goal.hex()), metadata=known_by(OPERATOR), timeout=60
            )
        )
        asked = (await agent.next("command")).command
        assert asked.cancel_goal.goal_id == goal
        cancelling.cancel()
        rows: list[dict[str, Any]] = []
        async with asyncio.timeout(60):
            while len(rows) < 2:  # who sends a goal and goes has sent it
                rows = (await http.get("/api/v1/audit", params={"action": "robots.call"})).json()["rows"]
                await asyncio.sleep(0.02)
        kept = sorted((row["target"].rpartition("/")[2], row["status"], row["detail"]) for row in rows)
        send = ("SendGoal sim_1", 499, f"goal {goal.hex()} of /sim_1/fibonacci")
        assert kept == [("CancelGoal sim_1", 499, f"goal {goal.hex()}"), send]


async def test_events_are_read_and_followed(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}") as opened:
            stub = events_pb2_grpc.EventServiceStub(opened)
            asked = events_pb2.WatchEventsRequest(filter=events_pb2.EventFilter(kinds=["robot.*"]))
            watching = stub.WatchEvents(asked, metadata=known_by(OPERATOR), timeout=60)
            blind = stub.WatchEvents(asked, metadata=known_by(REMOTE), timeout=60)
            start = (await watching.read()).next
            await blind.read()
            async with ScriptedAgent(ready):
                (event,) = (await watching.read()).events
            assert (event.kind, event.robot) == ("robot.online", "sim_1")
            again = events_pb2.ListEventsRequest(after=start, filter=asked.filter)
            page = await stub.ListEvents(again, metadata=known_by(OPERATOR), timeout=60)
            assert page.events[0] == event
            nothing = await stub.ListEvents(again, metadata=known_by(REMOTE), timeout=60)
            assert (list(nothing.events), nothing.next >= event.cursor) == ([], True)
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.ListEvents(events_pb2.ListEventsRequest(limit=5000), metadata=known_by(OPERATOR), timeout=60)
            assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
            watching.cancel()
            blind.cancel()
