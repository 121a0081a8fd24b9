"""A worker as a plain process, for systems without a sandbox: macOS (L1: with limits) and Windows (L0)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from typing import Any

from metaros.automation.functions.program import Confinement, Program, import_paths, request_of
from metaros.automation.functions.worker_process import WorkerProcess

__all__ = ["launch_plain", "run_plain"]

BOOT = (
    "import sys, json; r = json.loads(sys.stdin.buffer.read()); sys.path[:] = r['paths'];"
    "from metaros.automation.functions.plain_process import run_plain; run_plain(r)"
)
BACKLOG = 16
# Windows starts no process without these.
KEPT = ("SYSTEMROOT", "SYSTEMDRIVE", "WINDIR")


async def launch_plain(program: Program, confinement: Confinement) -> WorkerProcess:
    """A new interpreter with the function's environment, in its own process group."""
    confinement.tmp_dir.mkdir(parents=True, exist_ok=True)
    listener = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG)
    listener.setblocking(False)
    egress: socket.socket | None = None
    try:
        if program.egress:
            egress = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG)
            egress.setblocking(False)
        port, egress_port = (s.getsockname()[1] if s else 0 for s in (listener, egress))
        request = request_of(program, confinement, port=port, egress_port=egress_port)
        request["paths"] = import_paths()
        process, output = _start(request)
    except BaseException:
        for opened in (listener, egress):
            if opened is not None:
                opened.close()
        raise
    launched = _hold(process, listener, output, confinement)
    launched.egress = egress
    return launched


def _start(request: dict[str, Any]) -> tuple[subprocess.Popen[bytes], int]:
    """The process, and the reading end of what it prints."""
    output, output_in = os.pipe()
    if sys.platform != "win32":
        os.set_blocking(output, False)
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-c", BOOT],
            stdin=subprocess.PIPE,
            stdout=output_in,
            stderr=output_in,
            env={"LANG": "C.UTF-8", **{name: os.environ[name] for name in KEPT if name in os.environ}},
            start_new_session=True,
        )
    except BaseException:
        os.close(output)
        raise
    finally:
        os.close(output_in)
    assert process.stdin is not None
    with process.stdin as stdin:
        stdin.write(json.dumps(request).encode())
    return process, output


def _hold(
    process: subprocess.Popen[bytes], listener: socket.socket, output: int, confinement: Confinement
) -> WorkerProcess:
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[int] = loop.create_future()

    def told(status: int) -> None:
        if not ended.done():
            ended.set_result(status)

    def await_end() -> None:
        status = process.wait()
        with contextlib.suppress(RuntimeError):  # the loop went first
            loop.call_soon_threadsafe(told, status)

    threading.Thread(target=await_end, name="function-worker", daemon=True).start()
    return WorkerProcess(
        pid=process.pid,
        listener=listener,
        output=output,
        logs=None,
        tmp_dir=confinement.tmp_dir,
        root_pid=process.pid,
        ended=ended,
        _kill=lambda: _end(process),
    )


def _end(process: subprocess.Popen[bytes]) -> None:
    if sys.platform == "win32":
        process.kill()
    else:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


def run_plain(request: dict[str, Any]) -> None:
    """In the new interpreter: its limits, where the system has them, then the user's code."""
    from metaros.automation.functions.child import run_entry, set_surroundings

    if sys.platform != "win32" and request["level"] >= 1:
        from metaros.automation.functions.sandbox import rlimits

        rlimits.limit(
            memory_mb=request["memory_mb"],
            processes=request["processes"],
            open_files=request["open_files"],
            file_bytes=request["disk_bytes"],
            had=rlimits.private_bytes(),
        )
    set_surroundings(
        request,
        code_dir=request["code_dir"],
        layer_dirs=request["layer_dirs"],
        tmp_dir=request["tmp_dir"],
        port=request["port"],
        egress_port=request["egress_port"],
        logs=None,
    )
    run_entry(request["entry"], request["handler"])
