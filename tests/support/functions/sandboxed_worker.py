"""A sandboxed worker that runs any code it is sent, at any sandbox level: what a hostile function would try."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import textwrap
from pathlib import Path
from types import TracebackType
from typing import Any

from metaros.automation.functions.launch import Confinement, Program, WorkerProcess, launch
from metaros.automation.functions.probe import probe
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote

HANDLER = """
def handler(event, context):
    scope = {}
    exec(event["code"], scope)
    return scope.get("result")
"""
LEVELS = (Level.L1, Level.L2, Level.L3)
ANSWER_S = 60


class CagedError(Exception):
    """The code raised: type and message."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(f"{kind}: {message}")
        self.kind = kind


class EndedError(Exception):
    """The worker ended instead of answering."""


async def here(level: Level) -> bool:
    """Whether this machine has the level; every machine that CI uses does."""
    reason = (await asyncio.to_thread(probe)).reasons[level]
    assert reason == "ok" or "CI" not in os.environ, f"{level.name}: {reason}"
    return reason == "ok"


class SandboxedWorker:
    """Use with `async with`; `ask` runs code, which leaves what it found in `result`."""

    def __init__(self, level: Level, folder: Path, *, zygote: Zygote | None = None, **bounds: Any) -> None:
        self.level, self._zygote = level, zygote
        self.code_dir = folder / "code"
        self.code_dir.mkdir(parents=True)
        self.code_dir.chmod(0o755)
        (self.code_dir / "app.py").write_text(HANDLER)
        (self.code_dir / "app.py").chmod(0o444)
        self._confinement = Confinement(level=level, tmp_dir=folder / "tmp", **bounds)
        self.tmp_dir = folder / "tmp"
        self.launched: WorkerProcess

    async def __aenter__(self) -> SandboxedWorker:
        program = Program(handler="app.handler", code_dir=self.code_dir, env={"OWN": "mine"})
        start = self._zygote.fork if self._zygote else launch
        self.launched = await start(program, self._confinement)
        assert self.launched.listener is not None
        self._connection, _ = await asyncio.get_running_loop().sock_accept(self.launched.listener)
        self._reader, self._writer = await asyncio.open_connection(sock=self._connection)
        await self._request()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()
        self.launched.close()
        await self.launched.wait()

    async def ask(self, code: str, /, **values: Any) -> Any:
        """Run code with these values as its globals; CagedError, EndedError."""
        lines = [f"{name} = {value!r}" for name, value in values.items()]
        event = json.dumps({"code": "\n".join([*lines, textwrap.dedent(code)])}).encode()
        head = "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nLambda-Runtime-Aws-Request-Id: one\r\n"
        head += "Lambda-Runtime-Deadline-Ms: 99999999999999\r\nLambda-Runtime-Invoked-Function-Arn: arn\r\n"
        self._writer.write(f"{head}Content-Length: {len(event)}\r\n\r\n".encode() + event)
        async with asyncio.timeout(ANSWER_S):
            line, body = await self._request()
            self._writer.write(b"HTTP/1.1 202 Accepted\r\nContent-Length: 2\r\n\r\n{}")
            await self._request()
        if "/error" in line:
            document = json.loads(body)
            raise CagedError(document["errorType"], document["errorMessage"])
        return json.loads(body)

    async def _request(self) -> tuple[str, bytes]:
        """The worker's next request; it comes on a new connection where it closes them."""
        while True:
            with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
                head = (await self._reader.readuntil(b"\r\n\r\n")).decode("latin-1")
                sizes = [r.split(":")[1] for r in head.split("\r\n") if r.lower().startswith("content-length:")]
                return head.split("\r\n")[0], await self._reader.readexactly(int(sizes[0]) if sizes else 0)
            self._writer.close()
            await self._connected_again()

    async def _connected_again(self) -> None:
        assert self.launched.listener is not None
        accepting = asyncio.ensure_future(asyncio.get_running_loop().sock_accept(self.launched.listener))
        ending = asyncio.ensure_future(self.launched.wait())
        try:
            await asyncio.wait([accepting, ending], return_when=asyncio.FIRST_COMPLETED)
            if not accepting.done():
                raise EndedError(await self.launched.wait())
        finally:  # before the listener is closed: the loop would take the next one of its number for it
            ending.cancel()
            if accepting.cancel():
                await asyncio.gather(accepting, return_exceptions=True)
        self._connection, _ = accepting.result()
        self._reader, self._writer = await asyncio.open_connection(sock=self._connection)

    def output(self) -> bytes:
        """What it printed and was not read yet."""
        assert self.launched.output is not None
        with contextlib.suppress(BlockingIOError):
            return os.read(self.launched.output, 1 << 16)
        return b""


def listening(kind: int = socket.SOCK_STREAM) -> socket.socket:
    """A socket of the host that a worker must not reach."""
    sock = socket.socket(socket.AF_INET, kind)
    sock.bind(("127.0.0.1", 0))
    if kind == socket.SOCK_STREAM:
        sock.listen()
    sock.settimeout(0.2)
    return sock
