"""Two real gateways of one store: what a client does at the one that has not the robot's link works all the same."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from typing import Any

import httpx
import pytest

from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.fleet.twin import digest
from metaros.idl import message_class
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_srvs.srv import Trigger
from tests.gateway.cluster.gateway_pair import Pair, has, stored
from tests.gateway.harness import BACKFILL, CONTROL, DATA, RING, ScriptedAgent, client, hear, open_socket, say
from tests.support.gateways.lambda_gateway import ROLE, LambdaGateway, zipped
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.xdist_group("gateway pair")]

ONLINE = '"state":"online"'
ADMIN_KEY = RING.add(role=Role.ADMIN, name="admin of replicas")
LIDAR = {"bundle": "lidar-node", "version": "1.2.0"}
FIBONACCI = "example_interfaces/action/Fibonacci"


@asynccontextmanager
async def linked(pair: Pair) -> AsyncIterator[tuple[ScriptedAgent, httpx.AsyncClient]]:
    """The robot is linked to the first gateway, and a client of the second one, which knows of it."""
    async with pair.agent(pair.one) as agent, agent.beating(), client(pair.two, key=ADMIN_KEY) as http:
        await has(pair.two, pair.path, ONLINE)
        await stored(agent)
        yield agent, http


async def answered(agent: ScriptedAgent, asking: Awaitable[httpx.Response], **answer: Any) -> httpx.Response:
    """The response to a request whose command the agent answers, or that never becomes one."""
    task, command = asyncio.ensure_future(asking), asyncio.ensure_future(agent.next("command"))
    await asyncio.wait({task, command}, return_when=asyncio.FIRST_COMPLETED)
    if command.done():
        await agent.answer(command.result().command, **answer)
    command.cancel()
    return await task


async def test_commands_calls_and_refusals(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        order = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}}
        done = await answered(agent, http.post(f"{pair.path}/commands", json=order))
        assert (done.status_code, done.json()["state"]) == (200, "done")
        failed = await answered(agent, http.post(f"{pair.path}/commands", json=order), code="busy")
        assert (failed.json()["state"], failed.json()["code"]) == ("failed", "busy")
        call = {"service": "go", "type": "std_srvs/srv/Trigger", "request": {}}
        payload = codec("std_srvs/srv/Trigger_Response").encode(Trigger.Response(success=True, message="ok"))
        answer = await answered(agent, http.post(f"{pair.path}/services/call", json=call), payload=payload)
        assert answer.json()["response"] == {"success": True, "message": "ok"}


async def test_a_twin_that_is_changed_remote_is_reported_at_once_and_its_node_answers(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        await agent.send(CONTROL, twin=link_pb2.TwinReport(state="applied", sha256=digest({})))
        edited = await http.patch(f"{pair.path}/twin?reason=first", json={"nodes": {"lidar": LIDAR}})
        assert edited.status_code == 200, edited.text
        assert (await agent.next("twin")).twin.revision == 1
        values = codec("rcl_interfaces/srv/ListParameters_Response")
        empty = values.encode(message_class("rcl_interfaces/srv/ListParameters_Response")())
        found = await answered(agent, http.get(f"{pair.path}/nodes/lidar/parameters"), payload=empty)
        assert (found.status_code, found.json()["parameters"]) == (200, [])
        began = await answered(agent, http.post(f"{pair.path}/nodes/lidar/restart", json={}))
        assert began.status_code == 200, began.text
        lines = b'{"lines": [{"at_ns": 1, "text": "hello"}], "cursor": "7", "more": false}'
        log = await answered(agent, http.get(f"{pair.path}/nodes/lidar/log"), payload=lines)
        assert "hello" in log.text


async def test_a_durable_order_is_delivered_at_once_and_its_end_is_seen_where_it_was_given(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        order = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}, "durable": True}
        sent = await http.post(f"{pair.path}/commands", json=order)
        assert sent.json()["state"] in ("issued", "delivered"), sent.text
        command = (await agent.next("command")).command
        assert command.durable
        waiting = asyncio.ensure_future(http.get(f"/api/v1/commands/{sent.json()['id']}?wait_s=50"))
        result = link_pb2.CommandResult(command_id=command.command_id, ok=True, kept=True)
        await agent.send(CONTROL, result=result)
        assert (await waiting).json()["state"] == "done"
        assert (await agent.next("result_stored")).result_stored.command_id == command.command_id


async def test_teleop_is_driven_from_either_and_by_one_alone(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        async with (
            open_socket(pair.two, f"{pair.path}/teleop") as ann,
            open_socket(pair.one, f"{pair.path}/teleop") as bob,
        ):
            await say(ann, op="take", holder="ann")
            grant = (await agent.next("command")).command
            await agent.answer(grant)
            lease_id = (await hear(ann, "granted"))["lease_id"]
            assert grant.grant_lease.lease_id == lease_id
            await say(bob, op="take", holder="bob")
            assert (await hear(bob, "refused"))["holder"] == "ann"
            for seq in (1, 2):
                await say(ann, op="drive", linear=0.5, angular=0.1, seq=seq)
                assert (await hear(ann, "ack"))["seq"] == seq
                assert (await agent.next("teleop")).teleop.lease_id == lease_id
            for ready in (pair.one, pair.two):
                await has(ready, pair.path, '"holder":"ann"')
            cdr = codec("geometry_msgs/msg/Twist").encode(Twist())
            publish = {"topic": "cmd_vel", "type": "geometry_msgs/msg/Twist", "message": {}, "lease_id": lease_id}
            assert (await answered(agent, http.post(f"{pair.path}/publish", json=publish))).status_code < 300, cdr
            refused = await http.post(f"{pair.path}/publish", json={**publish, "lease_id": "x"})
            assert refused.json()["code"] == "lease_required"
            await say(ann, op="release")
            await agent.answer((await agent.next("command")).command)
            await hear(ann, "released")
            await say(bob, op="take", holder="bob")
            await agent.answer((await agent.next("command")).command)
            await hear(bob, "granted")
            await say(bob, op="release")
            await agent.answer((await agent.next("command")).command)
            await hear(bob, "released")


async def test_a_goal_is_sent_at_one_and_seen_at_both(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        accepted = message_class(f"{FIBONACCI}_SendGoal_Response")(accepted=True)
        payload = codec(accepted).encode(accepted)
        asking = http.post(f"{pair.path}/actions/count", json={"type": FIBONACCI, "goal": {"order": 3}})
        begun = await answered(agent, asking, payload=payload)
        assert begun.status_code == 202, begun.text
        goal_id = begun.json()["goal"]
        event = link_pb2.GoalEvent(
            goal_id=bytes.fromhex(goal_id.replace("-", "")), action=pair.topic("count"), type_name=FIBONACCI, status=2
        )
        await agent.send(CONTROL, goals=link_pb2.GoalEvents(events=[event]))
        for ready in (pair.one, pair.two):
            await has(ready, f"{pair.path}/goals/{goal_id}", "executing")


async def test_a_recording_that_is_asked_for_remote_is_cut_at_once(pair: Pair) -> None:
    async with linked(pair) as (agent, http):
        asked = await http.post(f"{pair.path}/recordings", json={"last_s": 60})
        assert asked.status_code == 202, asked.text
        save = (await agent.next("command", timeout_s=4)).command.save_recording  # sooner than the home's own look
        assert (save.recording_id, save.last_ns) == (asked.json()["id"], 60 * 10**9)


async def test_a_command_under_way_ends_when_the_link_does(pair: Pair) -> None:
    async with client(pair.two) as http:
        async with pair.agent(pair.one) as agent, agent.beating():
            await has(pair.two, pair.path, ONLINE)
            await stored(agent)
            order = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}}
            running = asyncio.ensure_future(http.post(f"{pair.path}/commands", json=order))
            await agent.next("command")
        assert (await running).json()["code"] == "robot_offline"


async def test_a_robot_that_moves_ends_its_former_session_and_an_older_one_is_refused(pair: Pair) -> None:
    async with pair.agent(pair.one, number=5) as former, client(pair.one) as http:
        await has(pair.two, pair.path, ONLINE)
        await stored(former)
        async with pair.agent(pair.two, number=6) as agent:
            goodbye = (await former.next("goodbye")).goodbye
            assert goodbye.code == "fenced"
            order = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}}
            done = await answered(agent, http.post(f"{pair.path}/commands", json=order))
            assert done.json()["state"] == "done", done.text
            late = pair.agent(pair.one, number=4)
            for lane in (CONTROL, DATA, BACKFILL):
                await late.open(lane, welcome=False)
            assert (await late.next("goodbye")).goodbye.code == "fenced"
            await late.__aexit__()


SOURCE = """
def handler(event, context):
    print("hello from", context.function_version)
    if event.get("fail"):
        raise ValueError(event["fail"])
    return {"said": event}
"""


async def test_a_gateway_without_functions_has_them_run_by_one_that_has(pair: Pair) -> None:
    loop = asyncio.get_running_loop()
    there = await asyncio.to_thread(LambdaGateway(pair.two, pair.folders[1], loop).client)
    aws = await asyncio.to_thread(LambdaGateway(pair.one, pair.folders[0], loop).client)

    def calls() -> None:
        code = {"ZipFile": zipped(SOURCE)}
        there.create_function(FunctionName="f", Role=ROLE, Handler="app.handler", Code=code, Runtime="python3.12")
        wait_until(lambda: [item["FunctionName"] for item in aws.list_functions()["Functions"]] == ["f"])
        answer = aws.invoke(FunctionName="f", Payload=b'{"a": 1}', LogType="Tail")
        assert json.loads(answer["Payload"].read()) == {"said": {"a": 1}}
        assert b"hello from $LATEST" in base64.b64decode(answer["LogResult"])
        failed = aws.invoke(FunctionName="f", Payload=b'{"fail": "no way"}')
        assert (failed["FunctionError"], json.loads(failed["Payload"].read())["errorMessage"]) == (
            "Unhandled",
            "no way",
        )
        with pytest.raises(aws.exceptions.ClientError, match="streamed answer"):
            aws.invoke_with_response_stream(FunctionName="f", Payload=b"{}")
        whole = aws.invoke(FunctionName="f", Payload=json.dumps({"a": "x" * 5_000_000}).encode())
        assert len(whole["Payload"].read()) > 5_000_000
        assert aws.invoke(FunctionName="f", Payload=b'{"late": 1}', InvocationType="Event")["StatusCode"] == 202

    await asyncio.to_thread(calls)
    await has(pair.one, "/api/v1/functions/f/invocations", '"event"')
