"""The control socket: its protocol, whom it lets in, and that nonsense harms nobody."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import subprocess
import sys
import textwrap
import threading
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.clock import SystemClock, boot_s, system_rng
from metaros.errors import ConfigError, FrameError, UnavailableError
from metaros.supervise import verbs
from metaros.supervise.client import SupervisorClient
from metaros.supervise.control import CLIENTS, Control
from metaros.supervise.control_socket import LINE_BYTES, SOCKET, TOKEN, ControlSocket, connect
from metaros.supervise.logs.reader import Page
from metaros.supervise.service import NodeService
from metaros.supervise.verbs import Verbs
from tests.support.nodes.node_code import SLEEP
from tests.support.waiting import wait_until_async

UNIX = sys.platform != "win32"


class Rig:
    """A service behind its door."""

    def __init__(self, directory: Path, *, unix: bool) -> None:
        self.directory = directory
        self.ended = asyncio.Event()
        self.service = NodeService(directory, clock=SystemClock(), rng=system_rng(), lease_s=boot_s)
        self.control = Control(ControlSocket(directory, unix=unix), Verbs(self.service, self.ended.set).handle)

    async def table(self, *names: str) -> None:
        rows = [{"name": name, "argv": [sys.executable, "-S", "-c", SLEEP]} for name in names]
        async with await SupervisorClient.open(self.directory) as client:
            await client.ask("set_table", rows=rows, tag="t")


@pytest.fixture(params=[pytest.param(True, marks=pytest.mark.skipif(not UNIX, reason="no Unix sockets")), False])
async def rig(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Rig]:
    rig = Rig(tmp_path, unix=request.param)
    await rig.control.open()
    rig.service.start()
    yield rig
    await rig.control.close()
    await rig.service.stop(grace_s=1.0)


@pytest.fixture
async def client(rig: Rig) -> AsyncIterator[SupervisorClient]:
    async with await SupervisorClient.open(rig.directory) as client:
        yield client


async def test_a_conversation(rig: Rig, client: SupervisorClient) -> None:
    await rig.table("a")
    found = await client.ask("list")
    assert (found["tag"], found["table"], [node["name"] for node in found["nodes"]]) == ("t", 1, ["a"])
    await client.ask("stop", node="a")
    assert (await client.ask("list"))["nodes"][0]["why"] == "by hand"
    with pytest.raises(UnavailableError, match="no node 'b'"):
        await client.ask("start", node="b")
    with pytest.raises(ConfigError, match="no verb 'dance'"):
        await client.ask("dance")
    await client.ask("shutdown")
    assert rig.ended.is_set()


async def test_a_list_waits_for_something_new(rig: Rig, client: SupervisorClient) -> None:
    found = await client.ask("list")
    waiting = asyncio.create_task(client.ask("list", since=found["revision"], life=found["life"], wait_s=30))
    await rig.table("a")
    assert (await waiting)["revision"] > found["revision"]
    other = await client.ask("list", since=found["revision"], life="another life", wait_s=30)
    assert other["life"] == found["life"]


async def test_tail_brings_lines_as_they_come(rig: Rig, client: SupervisorClient) -> None:
    await rig.table("a")
    page = await client.ask("tail", node="a", cursor="0", wait_s=30)
    assert [line["text"] for line in page["lines"]] == ["up"]
    empty = await client.ask("tail", node="a", cursor=page["cursor"], wait_s=0.3)
    assert empty["lines"] == []


async def test_searches_take_turns(
    rig: Rig, client: SupervisorClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each holds the interpreter: many at once would keep the loop from what has a deadline."""
    await rig.table("a")
    go, under_way, most = threading.Event(), Counter[str](), []

    def slow(path: Path, **options: Any) -> Page:
        under_way["now"] += 1
        most.append(under_way["now"])
        go.wait(60)
        under_way["now"] -= 1
        return Page((), "0", False)

    monkeypatch.setattr(verbs, "read_page", slow)
    searches = [asyncio.create_task(client.ask("log", node="a", query="x")) for _ in range(10)]
    await wait_until_async(lambda: len(most) >= verbs.READING)
    assert (await client.ask("list"))["nodes"], "all else goes on"
    assert len(most) == verbs.READING
    go.set()
    await asyncio.gather(*searches)
    assert (len(most), max(most)) == (10, verbs.READING)


async def test_leases_of_the_future_and_of_nobody_knows_when(rig: Rig, client: SupervisorClient) -> None:
    for at_s in (boot_s() + 5.0, 0.0, None):
        with pytest.raises(ConfigError, match="at_s"):
            await client.ask("leases", leases=[{"node": "a", "lease_id": "x", "valid_s": 5.0}], at_s=at_s)
    await client.ask("leases", leases=[{"node": "a", "lease_id": "x", "valid_s": 5.0}], at_s=boot_s())


async def test_too_long_a_line_puts_out_its_sender_alone(rig: Rig, client: SupervisorClient) -> None:
    reader, writer = await connect(rig.directory)
    writer.write(b"x" * (LINE_BYTES + 10))
    answer = json.loads(await reader.readline())
    assert answer["code"] == "too_large"
    assert await reader.read() == b""
    writer.close()
    assert (await client.ask("list"))["ok"]


async def test_clients_are_bounded(rig: Rig) -> None:
    lines = [await connect(rig.directory) for _ in range(CLIENTS)]
    for reader, writer in lines:
        writer.write(b'{"verb": "list"}\n')
        await reader.readline()
    async with await SupervisorClient.open(rig.directory) as more:
        with pytest.raises((FrameError, UnavailableError)):
            await more.ask("list")
    lines[0][1].close()
    await wait_until_async(lambda: len(rig.control._clients) < CLIENTS)
    async with await SupervisorClient.open(rig.directory) as more:
        assert (await more.ask("list"))["ok"]
    for _, writer in lines:
        writer.close()


async def test_a_client_that_goes_away_takes_nothing_along(rig: Rig, client: SupervisorClient) -> None:
    _, writer = await connect(rig.directory)
    writer.write(b'{"verb": "tail", "node": "a", "wait_s": 30}\n{"verb": "list", "since": 0, "wait_s": 30}\n')
    await writer.drain()
    writer.transport.abort()
    await wait_until_async(lambda: len(rig.control._clients) == 1)
    assert (await client.ask("list"))["ok"]


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=10), inner, max_size=4),
    max_leaves=8,
)
VERBS = ("list", "set_table", "start", "stop", "restart", "retry", "signal", "log", "tail", "crashes", "leases", "no")
KEYS = ("node", "rows", "tag", "signal", "cursor", "max_bytes", "query", "backwards", "leases", "at_s", "since", "life")
requests = st.fixed_dictionaries(
    {"verb": st.sampled_from(VERBS) | json_values},
    optional={key: st.sampled_from(["a", "m", 0, 1, -1, 1e308, 10**400, [], {}]) | json_values for key in KEYS},
)


@settings(max_examples=30, suppress_health_check=list(HealthCheck), deadline=None)
@given(lines=st.lists(st.binary(max_size=200) | requests, min_size=2, max_size=4))
async def test_messages_of_chance_break_nothing(tmp_path_factory: pytest.TempPathFactory, lines: list[Any]) -> None:
    """Each is answered or put out; the node that ran runs on, unless it was asked to end."""
    rig = Rig(tmp_path_factory.mktemp("fuzz"), unix=UNIX)
    await rig.control.open()
    rig.service.start()
    try:
        reader, writer = await connect(rig.directory)
        for line in lines:
            data = line.replace(b"\n", b" ") if isinstance(line, bytes) else json.dumps(line).encode()
            writer.write(data + b"\n")
        for _ in lines:
            answer = json.loads(await asyncio.wait_for(reader.readline(), 60))
            assert answer["ok"] or answer["code"] not in ("internal", "disk_error"), answer
        writer.close()
        async with await SupervisorClient.open(rig.directory) as client:
            assert (await client.ask("list"))["ok"]
    finally:
        await rig.control.close()
        await rig.service.stop(grace_s=1.0)


# -- who comes in ------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not UNIX, reason="no Unix sockets")
async def test_the_socket_is_its_users_alone_and_replaces_a_dead_ones(tmp_path: Path) -> None:
    (tmp_path / SOCKET).touch()
    (tmp_path / TOKEN).write_text("{}")
    rig = Rig(tmp_path, unix=True)
    await rig.control.open()
    assert (tmp_path / SOCKET).stat().st_mode & 0o777 == 0o600
    async with await SupervisorClient.open(tmp_path) as client:
        await client.ask("list")
    await rig.control.close()
    assert not (tmp_path / SOCKET).exists()
    with pytest.raises(UnavailableError, match="no supervisor"):
        await SupervisorClient.open(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="by /proc")
async def test_a_directory_with_a_long_name(tmp_path: Path) -> None:
    deep = tmp_path / ("x" * 90) / ("y" * 90)
    deep.mkdir(parents=True)
    rig = Rig(deep, unix=True)
    await rig.control.open()
    async with await SupervisorClient.open(deep) as client:
        assert (await client.ask("list"))["nodes"] == []
    await rig.control.close()


async def test_without_the_token_nobody_comes_in(tmp_path: Path) -> None:
    rig = Rig(tmp_path, unix=False)
    await rig.control.open()
    assert not UNIX or (tmp_path / TOKEN).stat().st_mode & 0o077 == 0
    port = json.loads((tmp_path / TOKEN).read_text())["port"]
    for first in (b'{"token": "guess"}', b'{"token": 7}', b"[]", b"{", b'{"verb": "shutdown"}'):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(first + b"\n" + b'{"verb": "shutdown"}\n')
        assert json.loads(await reader.readline())["code"] == "forbidden"
        writer.close()
    assert not rig.ended.is_set()
    await rig.control.close()


STRANGER = """
    import json, os, socket, sys
    os.setresuid(1234, 1234, 1234)
    found = socket.socket(socket.AF_UNIX)
    found.connect(sys.argv[1])
    try:
        found.sendall(b'{"verb": "shutdown"}\\n')
    except BrokenPipeError:
        pass  # refused before a word was said: the answer is there all the same
    print(found.makefile().readline(), end="")
"""


def why_no_stranger() -> str:
    if sys.platform != "linux":
        return "the kernel's word is Linux's here"
    return "" if os.getuid() == 0 else "only root can be somebody else here"


@pytest.mark.skipif(bool(why_no_stranger()), reason=why_no_stranger())
async def test_another_user_is_refused_by_the_kernels_word() -> None:
    """The file's mode is taken away, so that only the word of the kernel stands between."""
    folder = Path("/tmp") / f"metaros-stranger-{os.getpid()}"
    folder.mkdir()
    rig = Rig(folder, unix=True)
    try:
        await rig.control.open()
        (folder / SOCKET).chmod(0o666)
        folder.chmod(0o755)
        done = await asyncio.to_thread(
            subprocess.run,
            [sys.executable, "-I", "-S", "-c", textwrap.dedent(STRANGER), str(folder / SOCKET)],
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert json.loads(done.stdout)["code"] == "forbidden", done.stderr
        assert not rig.ended.is_set()
    finally:
        await rig.control.close()
        shutil.rmtree(folder)


@pytest.mark.skipif(not UNIX, reason="no Unix sockets")
async def test_a_client_of_another_number_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(tmp_path, unix=True)
    await rig.control.open()
    user = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    async with await SupervisorClient.open(tmp_path) as client:
        with pytest.raises((FrameError, UnavailableError)):
            await client.ask("shutdown")
    assert not rig.ended.is_set()
    await rig.control.close()


def test_a_peer_says_who_it_is() -> None:
    if sys.platform not in ("linux", "darwin"):
        pytest.skip("the platform does not say")
    from metaros.supervise.control_socket import peer_uid

    one, other = socket.socketpair(socket.AF_UNIX)
    with one, other:
        assert peer_uid(one) == os.getuid()
