"""A viewer that was away goes on where it was, is told what is not there, and gets nothing twice."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection

from gateway.api.ws.requests import read_samples
from gateway.domain.principal import Principal, Role
from gateway.domain.records import split_records
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.idl.json import from_json
from metaros.interfaces.std_msgs.msg import String
from tests.gateway.harness import DATA, ScriptedAgent, channel, hear, open_socket, running_gateway, say

TOPIC = "/sim_1/chatter"


def text(number: int) -> bytes:
    return codec("std_msgs/msg/String").encode(from_json(String, {"data": f"n{number}"}))


async def take_until(viewer: ClientConnection, op: str) -> tuple[list[int], dict[str, Any]]:
    """The numbers of the samples that come before a message with that op, and the message."""
    seen: list[int] = []
    async with asyncio.timeout(60):
        while True:
            message = await viewer.recv()
            if isinstance(message, bytes):
                seen += [record.seq for _, _, record in split_records(message)]
            elif (said := json.loads(message))["op"] == op:
                return seen, said


async def test_stored_samples_come_first_then_live_ones_and_none_twice(tmp_path: Path) -> None:
    begin_ns = SystemClock().wall_ns() - 10**9
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, TOPIC, "std_msgs/msg/String"))
        await agent.samples(1, 1, [text(number) for number in range(1, 601)], stamp_ns=begin_ns + 1)
        await agent.next("ack", DATA)
        async with open_socket(ready, "/api/v1/stream") as viewer:
            since = {"sim_1": {TOPIC: str(begin_ns + 200), "/sim_1/none": begin_ns}}
            await say(viewer, op="subscribe", id=1, robots="*", topics="/**", mode="queue", resume=since)
            await agent.samples(1, 601, [text(601)], stamp_ns=begin_ns + 601)
            stored, resumed = await take_until(viewer, "resumed")
            assert stored in (list(range(201, 601)), list(range(201, 602))), "the last may be stored by then"
            assert (resumed["id"], resumed["robot"], resumed["topic"]) == (1, "sim_1", TOPIC)
            assert (resumed["count"], resumed["gaps"]) == (len(stored), [])
            _, nothing = await take_until(viewer, "resumed")
            assert (nothing["count"], [gap["reason"] for gap in nothing["gaps"]]) == (0, ["nothing_stored"])
            await agent.samples(1, 602, [text(602)], stamp_ns=begin_ns + 602)
            live: list[int] = []
            while len(stored) + len(live) < 402:
                message = await viewer.recv()
                assert isinstance(message, bytes)
                live += [record.seq for _, _, record in split_records(message)]
            assert [*stored, *live] == list(range(201, 603))


async def test_json_is_resumed_as_json(tmp_path: Path) -> None:
    begin_ns = SystemClock().wall_ns() - 10**9
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, TOPIC, "std_msgs/msg/String"))
        await agent.samples(1, 1, [text(1), text(2)], stamp_ns=begin_ns + 1)
        await agent.next("ack", DATA)
        async with open_socket(ready, "/api/v1/stream") as viewer:
            since = {"sim_1": {TOPIC: str(begin_ns + 1)}}
            asked = {"robots": "*", "topics": "/**", "mode": "queue", "encoding": "json"}
            await say(viewer, op="subscribe", id=1, **asked, resume=since)
            assert (await hear(viewer, "message"))["message"] == {"data": "n2"}
            await hear(viewer, "resumed")
            await agent.samples(1, 3, [text(3), b"no string"], stamp_ns=begin_ns + 3)
            live = await hear(viewer, "message")
            assert (live["id"], live["seq"], live["message"]) == (1, 3, {"data": "n3"})
            assert live["stamp_ms"] == pytest.approx((begin_ns + 3) / 1e6)
            assert (await hear(viewer, "message"))["message"] is None, "what cannot be decoded is no message"


WRONG = [7, [], {"sim_1": 7}, {"sim_1": {TOPIC: "x"}}, {"sim_1": {TOPIC: -1}}, {"r": {f"/t{n}": 1 for n in range(65)}}]


async def test_what_is_no_place_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, open_socket(ready, "/api/v1/stream") as viewer:
        for number, since in enumerate(WRONG):
            asked = {"id": number, "robots": "*", "topics": "/**", "mode": "queue"}
            await say(viewer, op="subscribe", **asked, resume=since)
            assert "resume" in (await hear(viewer, "error"))["message"], since
        await say(viewer, op="subscribe", id=99, robots="*", topics="/**", resume={"sim_1": {TOPIC: 1}})
        assert "queue" in (await hear(viewer, "error"))["message"]


def test_a_robot_out_of_scope_is_not_resumed() -> None:
    principal = Principal(kind="key", name="x", role=Role.VIEWER, robots=("lab_*",))
    since = {"sim_1": {TOPIC: 1}, "lab_1": {TOPIC: 2}}
    asked = {"op": "subscribe", "id": 1, "robots": "*", "topics": "/**", "mode": "queue", "resume": since}
    assert [item.robot for item in read_samples(asked, principal).resume] == ["lab_1"]
