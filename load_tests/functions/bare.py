"""What no design can pass on this machine: a process that only echoes JSON, an interpreter with only AWS's client."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import subprocess
import sys
import time

from load_tests.functions.figures import Calls

__all__ = ["cold_interpreters", "echo_json"]

_IMPORTS = "import sys; sys.path[:] = {path!r}; import awslambdaric.__main__"


class _Echo(asyncio.Protocol):
    answered: asyncio.Future[bytes]

    def data_received(self, data: bytes) -> None:
        self.answered.set_result(data)


async def echo_json(count: int, *, body: bytes = b'{"n":1}') -> Calls:
    """Calls of a forked process, one after another, over a socket pair and nothing else: decoded and encoded there."""
    loop = asyncio.get_running_loop()
    ours, theirs = socket.socketpair()
    pid = os.fork()
    if pid == 0:
        _serve(theirs, ours)
    theirs.close()
    ours.setblocking(False)
    transport, echo = await loop.create_connection(_Echo, sock=ours)
    took = []
    began = time.perf_counter()
    for _ in range(count):
        start = time.perf_counter()
        echo.answered = loop.create_future()
        transport.write(body)
        await echo.answered
        took.append((time.perf_counter() - start) * 1000)
    total = time.perf_counter() - began
    transport.close()
    await asyncio.to_thread(os.waitpid, pid, 0)
    return Calls(tuple(took), 0, total)


def _serve(own: socket.socket, other: socket.socket) -> None:
    other.close()
    while data := own.recv(65_536):
        own.sendall(json.dumps(json.loads(data)).encode())
    os._exit(0)


def cold_interpreters(count: int) -> list[float]:
    """ms of a new interpreter from its start to its end, that only imports what AWS's client is."""
    code = _IMPORTS.format(path=[path for path in sys.path if path])
    environment = {"AWS_LAMBDA_RUNTIME_API": "127.0.0.1:9001", "LANG": "C.UTF-8"}
    found = []
    for _ in range(count):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-I", "-S", "-c", code], env=environment, check=True)
        found.append((time.perf_counter() - start) * 1000)
    return found
