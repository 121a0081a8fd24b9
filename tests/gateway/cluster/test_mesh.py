"""Gateways on real Zenoh routers: order, bounds, questions, and what a lost router or process does."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerRefusedError, PeerTimeoutError
from gateway.cluster.mesh import ZenohMesh
from gateway.cluster.transport import Timeouts
from gateway.cluster.wire import MESSAGE_BYTES
from gateway.errors import LeaseTakenError
from metaros.errors import TooLargeError
from metaros.limits import LIMITS
from tests.gateway.cluster.meshes import all_met, made, running
from tests.support.ports import free_port
from tests.support.processes.processes import started
from tests.support.servers.zenoh_router import inner_router
from tests.support.waiting import wait_until, wait_until_async

ROOT = Path(__file__).resolve().parents[3]
PEER = (sys.executable, "-m", "tests.gateway.cluster.peer_process")


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A router's port."""
    port = free_port()
    with inner_router(port):
        yield port


async def test_messages_of_any_size_come_in_order(port: int) -> None:
    a, b = made("a", port), made("b", port)
    got: list[tuple[str, bytes]] = []
    b.on_message("t", lambda sender, payload: got.append((sender, payload)))
    b.on_message("u", lambda _sender, payload: got.append(("u", payload)))
    sizes = [0, 1, 300_000, 7, 256 * 1024, 5_000_000, *range(200)]
    sent = [bytes([number % 256]) * size for number, size in enumerate(sizes)]
    async with running(a, b):
        assert all(a.send("b", "t", payload) for payload in sent)
        await wait_until_async(lambda: len(got) == len(sent))
        assert got == [("a", payload) for payload in sent]
        assert a.send("b", "t", b"x" * MESSAGE_BYTES)
        await wait_until_async(lambda: len(got) > len(sent))
        assert len(got[-1][1]) == MESSAGE_BYTES
        with pytest.raises(TooLargeError):
            a.send("b", "t", b"x" * (MESSAGE_BYTES + 1))
        assert not a.send("c", "t", b"nobody")
        a.broadcast("u", b"all")
        await wait_until_async(lambda: got[-1] == ("u", b"all"))
        assert (b.counts.lost, b.frames_dropped) == (0, 0)


async def test_what_waits_for_a_peer_is_bounded(port: int) -> None:
    a, b = made("a", port, limits=replace(LIMITS, cluster_queue_bytes=1_000_000)), made("b", port)
    got: list[int] = []
    b.on_message("t", lambda _sender, payload: got.append(payload[0]))
    async with running(a, b):
        reported = [number for number in range(50) if a.send("b", "t", bytes([number]) * 400_000)]
        assert 1 <= len(reported) < 50
        assert a.counts.dropped == 50 - len(reported)
        await wait_until_async(lambda: len(got) == len(reported))
        assert got == reported
        await wait_until_async(lambda: a.queued_bytes == 0)
        assert a.send("b", "t", b"again")


async def test_what_comes_too_fast_is_dropped_and_the_two_meet_anew(port: int) -> None:
    a, b = made("a", port), made("b", port, limits=replace(LIMITS, cluster_received_bytes=1_000_000))
    received: list[tuple[str, bool]] = []
    got: list[bytes] = []
    a.on_peer(lambda gateway, there: received.append((gateway, there)))
    b.on_peer(lambda gateway, there: received.append((gateway, there)))
    b.on_message("t", lambda _sender, payload: got.append(payload))
    async with running(a, b):
        received.clear()
        a.send("b", "t", b"x" * 8_000_000)
        a.send("b", "t", b"after it")
        wait_until(lambda: b.frames_dropped > 0)  # the event loop stands, so b handles nothing of it
        await wait_until_async(lambda: len(received) == 4)
        assert sorted(received) == [("a", False), ("a", True), ("b", False), ("b", True)]
        assert b"after it" not in got, "nothing comes out of order"
        assert a.send("b", "t", b"now")
        await wait_until_async(lambda: got == [b"now"])


async def test_questions(port: int) -> None:
    a, b = made("a", port, limits=replace(LIMITS, cluster_asks=3)), made("b", port)
    never = asyncio.Event()

    async def answer(sender: str, payload: bytes) -> bytes:
        if payload == b"wait":
            await never.wait()
        if payload == b"taken":
            raise LeaseTakenError("alice drives it", holder="alice")
        if payload == b"bug":
            raise KeyError("secret")
        return sender.encode() + payload

    b.on_request("v", answer)
    async with running(a, b):
        assert await a.request("b", "v", b"!" * 1_000_000, timeout_s=30) == b"a" + b"!" * 1_000_000
        with pytest.raises(LeaseTakenError) as taken:
            await a.request("b", "v", b"taken", timeout_s=30)
        assert taken.value.holder == "alice"
        with pytest.raises(PeerRefusedError) as bug:
            await a.request("b", "v", b"bug", timeout_s=30)
        assert bug.value.code == "internal"
        assert "secret" not in str(bug.value)
        with pytest.raises(PeerRefusedError, match="knows no 'other'"):
            await a.request("b", "other", b"", timeout_s=30)
        with pytest.raises(PeerGoneError):
            await a.request("c", "v", b"", timeout_s=30)
        with pytest.raises(PeerTimeoutError):
            await a.request("b", "v", b"wait", timeout_s=0.05)
        waiting = [asyncio.create_task(a.request("b", "v", b"wait", timeout_s=60)) for _ in range(3)]
        await asyncio.sleep(0)
        with pytest.raises(PeerBusyError):
            await a.request("b", "v", b"one too many", timeout_s=30)
        await b.close()
        for result in await asyncio.gather(*waiting, return_exceptions=True):
            assert isinstance(result, PeerGoneError)


async def test_a_gateway_that_hangs_or_is_killed_is_received_of_and_so_is_its_return(port: int) -> None:
    a = made("a", port)
    received: list[bool] = []
    a.on_peer(lambda _gateway, there: received.append(there))
    async with running(a):
        with started([*PEER, str(port)], cwd=ROOT) as process:
            await wait_until_async(lambda: a.peers() == {"b"})
            os.kill(process.pid, signal.SIGSTOP)
            try:
                await wait_until_async(lambda: a.peers() == frozenset())
            finally:
                os.kill(process.pid, signal.SIGCONT)
            await wait_until_async(lambda: a.peers() == {"b"})
            await killed(a, process)
            assert received == [True, False, True, False]
        with started([*PEER, str(port)], cwd=ROOT) as process:
            await wait_until_async(lambda: a.peers() == {"b"})
            await killed(a, process)
        assert received == [True, False, True, False, True, False]


async def killed(mesh: ZenohMesh, process: subprocess.Popen[str]) -> None:
    """Who asked a gateway that dies hears that at once."""
    assert await mesh.request("b", "pid", b"", timeout_s=60) == str(process.pid).encode()
    waiting = asyncio.create_task(mesh.request("b", "never", b"", timeout_s=60))
    await asyncio.sleep(0)
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(PeerGoneError):
        await waiting


async def test_gateways_find_each_other_again_when_routers_end() -> None:
    first, second = free_port(), free_port()
    a, b = made("a", first, second), made("b", second, first)
    got: list[bytes] = []
    received: list[bool] = []
    b.on_message("t", lambda _sender, payload: got.append(payload))
    b.on_peer(lambda _gateway, there: received.append(there))
    with ExitStack() as one, ExitStack() as two, ExitStack() as again:
        one.enter_context(inner_router(first))
        two.enter_context(inner_router(second, first))
        async with running(a, b):
            for ending in (one, two):
                met = received.count(True)
                ending.close()
                await wait_until_async(lambda met=met: received.count(True) > met)
                await all_met([a, b])
                got.clear()
                assert a.send("b", "t", b"through")
                await wait_until_async(lambda: got == [b"through"])
                if ending is one:
                    again.enter_context(inner_router(first, second))
            assert received[:3] == [True, False, True]


async def test_no_router_is_no_error(caplog: pytest.LogCaptureFixture) -> None:
    port, patience = free_port(), Timeouts(connect_s=0.1)
    a, b = made("a", port, patience=patience), made("b", port, patience=patience)
    async with running(a, b, met=False):
        await wait_until_async(lambda: "no router of --cluster answers" in caplog.text)
        assert not a.linked
        with inner_router(port):
            await all_met([a, b])
            assert a.linked
