"""`metaros history` against a gateway, and against peers that do not keep their word."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader

from metaros.cli.main import main
from tests.gateway.api.rest.history.test_history import START_NS, fill
from tests.gateway.harness import ScriptedAgent, running_gateway

SPAN = ("--start", "2001-09-09T01:46:40Z", "--end", "2001-09-09T01:46:50Z")


async def run(*arguments: str) -> int:
    """`metaros history ARGUMENTS` on a thread; its exit code."""

    def called() -> int:
        with pytest.raises(SystemExit) as ended:
            main(["history", *arguments])
        return int(ended.value.code or 0)

    return await asyncio.to_thread(called)


async def test_topics_messages_and_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "some.mcap"
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await fill(agent)
        where = ("--gateway", ready.url)
        assert await run("topics", "sim_1", *where) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split()[:3] for line in lines] == [
            ["/sim_1/chatter", "std_msgs/msg/String", "10"],
            ["/sim_1/lidar/scan", "std_msgs/msg/String", "10"],
        ]
        assert await run("messages", "sim_1", "--topics", "chatter", *SPAN, "-n", "3", *where) == 0
        shown = capsys.readouterr()
        assert [line.split("  ")[1:] for line in shown.out.splitlines()] == [
            ["/sim_1/chatter", f'{{"data": "1.{n}"}}'] for n in range(3)
        ]
        assert "5 samples of that time are lost: outbox_full" in shown.err
        assert await run("messages", "sim_1", *SPAN, "--order", "desc", "-n", "1", "-o", "json", *where) == 0
        assert json.loads(capsys.readouterr().out)["seq"] == 10
        assert await run("export", str(path), "--robot", "sim_1", *SPAN, *where) == 0
        assert "some.mcap" in capsys.readouterr().out
        assert await asyncio.to_thread(stamps, path) == sorted(START_NS + n + k for n in (1, 2) for k in range(10))
        assert await run("export", str(path), "--robot", "sim_1", *SPAN, *where) != 0
        assert "is not overwritten" in capsys.readouterr().err
        assert await run("messages", "nobody", *where) != 0
        assert "nobody" in capsys.readouterr().err


async def test_more_messages_than_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.cli.history.PAGE", 4)
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await fill(agent)
        for limit, count in ((9, 9), (100, 20)):
            assert await run("messages", "sim_1", *SPAN, "-n", str(limit), "--gateway", ready.url) == 0
            assert len(set(capsys.readouterr().out.splitlines())) == count


@asynccontextmanager
async def peer(body: bytes) -> AsyncIterator[str]:
    """Answers every request with that body in chunks, and then no end."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n%b\r\n" % (len(body), body))
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"


async def test_a_file_that_ends_early_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cut.mcap"
    async with peer(b"\x89MCAP0\r\n and so on") as url:
        assert await run("export", str(path), "--robot", "sim_1", "--gateway", url) != 0
    said = capsys.readouterr().err
    assert "early" in said or "broke" in said
    assert await asyncio.to_thread(os.listdir, tmp_path) == []


async def test_places_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async with peer(b"x") as url:
        path = tmp_path / "none" / "a.mcap"
        assert await run("export", str(path), "--robot", "sim_1", "--gateway", url) != 0
    assert "cannot write" in capsys.readouterr().err


def stamps(path: Path) -> list[int]:
    with path.open("rb") as file:
        return [message.log_time for _, _, message in make_reader(file).iter_messages()]
