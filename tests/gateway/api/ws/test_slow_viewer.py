"""Viewers that take little or nothing: memory stays bounded, the others are not held up, the dead one is cut."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from pathlib import Path
from time import monotonic

import psutil
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from gateway.domain.records import split_records
from gateway.main import Ready
from tests.gateway.harness import ScriptedAgent, channel, hear, hear_bytes, open_socket, running_gateway, say

MIB, LIVE = 1 << 20, 4  # the class of a topic that is not stored


def small_socket(ready: Ready) -> socket.socket:
    """A connection whose system takes little that nobody reads."""
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
    made.connect((ready.host, ready.http_port))
    made.setblocking(False)
    return made


async def test_a_viewer_that_takes_nothing_is_cut_and_costs_little(tmp_path: Path) -> None:
    payload = bytes(MIB // 4)
    async with running_gateway(tmp_path, viewer_stall_s=0.5) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/image", "std_msgs/msg/String", delivery=LIVE))
        url = ready.url.replace("http", "ws") + "/api/v1/stream"
        # max_queue 1: the client's library stops reading the socket when nobody takes its messages.
        stuck = await connect(url, origin=ready.url, max_size=None, max_queue=1, compression=None, proxy=None)
        async with open_socket(ready, "/api/v1/stream") as healthy:
            for viewer in (stuck, healthy):
                await say(viewer, op="subscribe", id=1, robots="*", topics="/**", mode="queue", queue_bytes=2 * MIB)
                await say(viewer, op="subscribe", id=1, robots="*", topics="/**")
                await hear(viewer, "error")
            seen, sent, deadline, before = [], 0, monotonic() + 120, 0
            while monotonic() < deadline and sent < 200:
                sent += 1
                if sent == 50:  # what this process needs for itself is there by now
                    before = psutil.Process().memory_info().rss
                await agent.samples(1, sent, [payload])
                seen += [record.seq for _, _, record in split_records(await hear_bytes(healthy))]
            assert seen == list(range(1, sent + 1))
            assert psutil.Process().memory_info().rss - before < 40 * MIB
            await asyncio.sleep(0.6)
            received = await count_until_closed(stuck)
            assert received < sent
            assert stuck.close_code in (4408, 1006)


async def count_until_closed(viewer: ClientConnection) -> int:
    """How many binary frames come before the connection ends."""
    received = 0
    with contextlib.suppress(ConnectionClosed):
        while True:
            received += isinstance(await asyncio.wait_for(viewer.recv(), 60), bytes)
    return received


async def test_a_slow_viewer_loses_the_oldest_and_is_reported(tmp_path: Path) -> None:
    sent = 40  # more than the gateway's system takes that nobody reads
    async with running_gateway(tmp_path, viewer_stall_s=120) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/image", "std_msgs/msg/String", delivery=LIVE))
        async with open_socket(ready, "/api/v1/stream", max_queue=1, sock=small_socket(ready)) as viewer:
            await say(viewer, op="subscribe", id=1, robots="*", topics="/**", mode="queue", queue_bytes=1000)
            await say(viewer, op="subscribe", id=1, robots="*", topics="/**")
            await hear(viewer, "error")
            for seq in range(1, sent + 1):
                await agent.samples(1, seq, [bytes(MIB // 4)])
            dropped, received = 0, []
            while dropped + len(received) < sent:
                message = await asyncio.wait_for(viewer.recv(), 60)
                if isinstance(message, bytes):
                    received += [record.seq for _, _, record in split_records(message)]
                elif json.loads(message)["op"] == "dropped":
                    dropped = json.loads(message)["total"]
            assert 0 < dropped == sent - len(received)
            assert (received, received[-1]) == (sorted(received), sent), "in order, and the newest is there"
