"""A fork server: an interpreter that has imported what handlers need, and becomes workers in a few milliseconds."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from metaros.automation.functions.fork_server import BOOT, REQUEST_BYTES
from metaros.automation.functions.program import Confinement, Program, import_paths, request_of
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.worker_process import WorkerProcess
from metaros.errors import LaunchError
from metaros.limits import LIMITS, Limits

__all__ = ["PRELOAD", "Zygote", "zygote_works"]

# AWS's client reads its environment as it is imported: only what it stands on is imported ahead.
PRELOAD = (
    *(
        "logging",
        "traceback",
        "decimal",
        "json",
        "http.client",
        "threading",
        "tempfile",
        "subprocess",
        "uuid",
        "resource",
    ),
    *("typing", "pathlib", "platform", "dataclasses", "datetime"),  # of which a handler has some
    *("awslambdaric", "awslambdaric.lambda_runtime_marshaller", "awslambdaric.lambda_context"),
    *("awslambdaric.lambda_runtime_log_utils", "awslambdaric.lambda_runtime_exception", "awslambdaric.lambda_literals"),
    "metaros.automation.functions.runtime.runtime_client",
)
MESSAGE_BYTES = 4096
BACKLOG = 16


def zygote_works() -> bool:
    """Whether this system forks safely: only Linux."""
    return sys.platform == "linux"


@dataclass(slots=True)
class _Ends:
    """Our ends of what a worker is given, and the worker's ends."""

    control: socket.socket
    output: int
    logs: int
    listener: socket.socket | None
    egress: socket.socket | None
    theirs: list[int]

    def close_theirs(self) -> None:
        while self.theirs:
            os.close(self.theirs.pop())

    def close(self) -> None:
        self.close_theirs()
        self.control.close()
        os.close(self.output)
        os.close(self.logs)
        for listener in (self.listener, self.egress):
            if listener is not None:
                listener.close()


class Zygote:
    """One fork server; it dies with this process, and its workers with it. A dead one is not revived: make another.
    Started by a thread it ends with that thread: that is for the one of the event loop to do.

    `once`: it ends with its first worker, whose start is then that of a new interpreter. `api`: where all its workers
    find their Runtime API, if that is one place for all; then AWS's client is imported ahead as a whole.
    """

    def __init__(
        self, *, preload: Sequence[str] = PRELOAD, once: bool = False, api: str = "", limits: Limits = LIMITS
    ) -> None:
        self._preload, self._once, self._api, self._limits = tuple(preload), once, api, limits
        self._channel: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Its process; 0 before its start."""
        return self._process.pid if self._process else 0

    @property
    def alive(self) -> bool:
        """Whether it can still be asked for workers."""
        return self._channel is not None and self._process is not None and self._process.poll() is None

    async def start(self) -> None:
        """Start it and wait until it is ready; LaunchError where it is not within `function_launch_s`."""
        self.spawn()
        assert self._channel is not None
        try:
            async with asyncio.timeout(self._limits.function_launch_s):
                data, _, _ = await _receive(self._channel)
        except TimeoutError:
            data = b""
        if not data:
            await self.close()
            raise LaunchError("the fork server did not start: see the gateway's log for what it printed")

    def spawn(self) -> None:
        """Start it and wait for nothing: what is asked of it meanwhile is done once it is ready."""
        if sys.platform != "linux":
            raise NotImplementedError
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        arguments = {
            "paths": import_paths(),
            "channel": theirs.fileno(),
            "parent": os.getpid(),
            "preload": self._preload,
            "once": self._once,
            "api": self._api,
        }
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", BOOT, json.dumps(arguments)],
                stdin=subprocess.DEVNULL,
                env={"LANG": "C.UTF-8", "PATH": os.defpath},
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self._channel = ours

    async def fork(self, program: Program, confinement: Confinement) -> WorkerProcess:
        """A new worker, up and confined. LaunchError where the zygote is gone, or the sandbox cannot be made; then
        nothing of it is left."""
        confinement.tmp_dir.mkdir(parents=True, exist_ok=True)
        ends = _make_ends(confinement.level, egress=program.egress)
        try:
            port, egress_port = (s.getsockname()[1] if s else 0 for s in (ends.listener, ends.egress))
            request = json.dumps(request_of(program, confinement, port=port, egress_port=egress_port)).encode()
            if len(request) > REQUEST_BYTES:
                raise LaunchError(f"environment and layers: {len(request)} bytes, at most {REQUEST_BYTES}")
            await self._send(request, ends.theirs)
            ends.close_theirs()
            async with asyncio.timeout(self._limits.function_launch_s):
                return await self._greet(ends, confinement)
        except TimeoutError:
            ends.close()
            raise LaunchError(f"the worker was not up within {self._limits.function_launch_s} s") from None
        except BaseException:
            ends.close()
            raise

    async def close(self) -> None:
        """End it. Its workers end with it, but of a `once` one, which waits for its own."""
        if self._channel is not None:
            self._channel.close()
            self._channel = None
        if self._process is not None:
            if not self._once:
                self._process.kill()
            await _exited(self._process)

    async def _send(self, request: bytes, files: Sequence[int]) -> None:
        if sys.platform != "linux":
            raise NotImplementedError
        while True:
            if self._channel is None:
                raise LaunchError("the fork server is closed")
            try:
                socket.send_fds(self._channel, [request], files)
                return
            except BlockingIOError:
                await _ready(self._channel, writing=True)
            except OSError as error:
                raise LaunchError(f"the fork server is gone: {error}") from None

    async def _greet(self, ends: _Ends, confinement: Confinement) -> WorkerProcess:
        """Receive from init and worker; the kernel itself tells their process ids, as this process sees them."""
        if sys.platform != "linux":
            raise NotImplementedError
        init, (init_fd,), _ = await _hear(ends.control)  # its own: it may be gone already, and the worker with it
        try:
            pid, files, _ = await _hear(ends.control)
        except BaseException:
            _end(init_fd, init, confinement.level)
            os.close(init_fd)
            raise
        if files:
            ends.listener = socket.socket(fileno=files[0])
            ends.egress = socket.socket(fileno=files[1]) if len(files) > 1 else None
        for listener in (ends.listener, ends.egress):
            if listener is not None:
                listener.setblocking(False)
        return _hold(ends, confinement, pid, init, init_fd)


def _make_ends(level: Level, *, egress: bool) -> _Ends:
    if sys.platform != "linux":
        raise NotImplementedError
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
    output, output_in = os.pipe()
    logs, logs_in = os.pipe()
    for opened in (output, logs):
        os.set_blocking(opened, False)
    ends = _Ends(ours, output, logs, None, None, [theirs.detach(), output_in, logs_in])
    if level < Level.L3:
        try:
            ends.listener = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG)
            ends.egress = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG) if egress else None
        except BaseException:
            ends.close()
            raise
    return ends


def _hold(ends: _Ends, confinement: Confinement, pid: int, init: int, init_fd: int) -> WorkerProcess:
    if sys.platform != "linux":
        raise NotImplementedError
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[int] = loop.create_future()

    def heard() -> None:
        """It ended, or its init process was killed, and it with that."""
        try:
            data = ends.control.recv(MESSAGE_BYTES)
        except BlockingIOError:
            return
        except ConnectionError:
            data = b""
        loop.remove_reader(ends.control)
        ends.control.close()
        os.close(init_fd)
        if not ended.done():
            ended.set_result(int(json.loads(data).get("status", 1)) if data else -signal.SIGKILL)

    loop.add_reader(ends.control, heard)
    return WorkerProcess(
        pid=pid,
        listener=ends.listener,
        egress=ends.egress,
        output=ends.output,
        logs=ends.logs,
        tmp_dir=confinement.tmp_dir,
        root_pid=init,
        ended=ended,
        _kill=lambda: _end(init_fd, init, confinement.level),
    )


def _end(init_fd: int, init: int, level: Level) -> None:
    """In its own pid namespace all ends with init; elsewhere all is in init's process group."""
    if sys.platform != "linux":
        raise NotImplementedError
    with contextlib.suppress(ProcessLookupError):
        if level >= Level.L3:
            signal.pidfd_send_signal(init_fd, signal.SIGKILL)
        else:
            signal.pidfd_send_signal(init_fd, 0)  # is it this one still?
            os.killpg(init, signal.SIGKILL)


async def _hear(control: socket.socket) -> tuple[int, list[int], dict[str, Any]]:
    data, files, pid = await _receive(control)
    if not data:
        raise LaunchError("the worker ended before it was up")
    message = json.loads(data)
    if "error" in message:
        raise LaunchError(f"the worker could not be confined: {message['error']}")
    return pid, files, message


async def _receive(source: socket.socket) -> tuple[bytes, list[int], int]:
    """A message, the open files in it, and its sender's process id (0: the socket does not tell)."""
    if sys.platform != "linux":
        raise NotImplementedError
    while True:
        try:
            space = socket.CMSG_SPACE(12) + socket.CMSG_SPACE(8)
            data, extra, _, _ = source.recvmsg(MESSAGE_BYTES, space, socket.MSG_CMSG_CLOEXEC)
        except BlockingIOError:
            await _ready(source)
            continue
        except ConnectionError:
            return b"", [], 0
        files: list[int] = []
        pid = 0
        for _, kind, content in extra:
            if kind == socket.SCM_RIGHTS:
                files += struct.unpack(f"{len(content) // 4}i", content[: len(content) // 4 * 4])
            elif kind == socket.SCM_CREDENTIALS:
                pid = struct.unpack("3i", content)[0]
        return data, files, pid


async def _ready(source: socket.socket, *, writing: bool = False) -> None:
    if sys.platform != "linux":
        raise NotImplementedError
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[None] = loop.create_future()

    def wake() -> None:
        if not ready.done():
            ready.set_result(None)

    (loop.add_writer if writing else loop.add_reader)(source, wake)
    try:
        await ready
    finally:
        (loop.remove_writer if writing else loop.remove_reader)(source)


async def _exited(process: subprocess.Popen[bytes]) -> None:
    """Wait for a child that is about to end, and take it from the kernel."""
    if process.poll() is None:
        await asyncio.to_thread(process.wait)
