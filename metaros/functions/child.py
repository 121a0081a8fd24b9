"""A worker and its keeper, from the fork on: the keeper builds the room and ends everything in it with the worker.

This runs in the fork server's child: one thread, nothing of the gateway in memory, and no way back.
"""

from __future__ import annotations

import array
import json
import os
import signal
import socket
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from metaros.functions.sandbox import identity
from metaros.functions.sandbox.libc import PR_SET_CHILD_SUBREAPER, PR_SET_PDEATHSIG, prctl
from metaros.functions.sandbox.room import L3, Room, build, shut

__all__ = ["keep", "run_entry", "set_surroundings", "tell"]

PATH = "/usr/local/bin:/usr/bin:/bin"
PROXIES = ("HTTPS_PROXY", "HTTP_PROXY", "https_proxy", "http_proxy")


def tell(control: socket.socket, message: dict[str, Any], *files: int) -> bool:
    """Send the gateway a message, with open files; False where it has let go."""
    if sys.platform != "linux":
        raise NotImplementedError
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", files))] if files else []
    try:
        control.sendmsg([json.dumps(message).encode()], rights)
    except ConnectionError:
        return False
    return True


def keep(request: dict[str, Any], control: socket.socket, output: int, logs: int, was: tuple[int, int]) -> NoReturn:
    """Be a worker's keeper: tells `kept`, then how the worker ended; ends it where the gateway lets go of `control`."""
    if sys.platform != "linux":
        raise NotImplementedError
    try:
        os.setsid()
        os.umask(0o022)  # whatever the gateway's is: folders of the room are for the worker, who is somebody else
        tell(control, {"kept": True})
        room = build(request, was)
        own = request["level"] >= L3
        # A killed fork server takes its keepers along. They end the rest; in a pid namespace the kernel does.
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL if own else signal.SIGTERM)
        prctl(PR_SET_CHILD_SUBREAPER, 1)  # whose parent ends is the keeper's, so that all of a worker's memory is found
        signal.signal(signal.SIGTERM, lambda *_: _end_all())
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCHLD})
        worker = os.fork()
        if worker == 0:
            _work(request, room, control, output, logs)
        signal.signal(signal.SIGCHLD, lambda *_: _reap(worker, control))
        for opened in (output, logs, *(listener.detach() for listener in room.listeners)):
            os.close(opened)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGCHLD})
        control.recv(1)
    except BaseException as error:
        tell(control, {"error": f"{type(error).__name__}: {error}"})
    _end_all()


def _reap(worker: int, control: socket.socket) -> None:
    if sys.platform != "linux":
        raise NotImplementedError
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if pid == 0:
            return
        if pid == worker:
            tell(control, {"status": os.waitstatus_to_exitcode(status)})
            _end_all()


def _end_all() -> NoReturn:
    """In a pid namespace all ends with its first process; elsewhere the process group is ended."""
    if sys.platform != "linux":
        raise NotImplementedError
    if os.getpid() != 1:
        os.killpg(0, signal.SIGKILL)
    os._exit(0)


def _work(request: dict[str, Any], room: Room, control: socket.socket, output: int, logs: int) -> NoReturn:
    """Be the worker: take the last steps of the sandbox, then the user's code."""
    if sys.platform != "linux":
        raise NotImplementedError
    keeper = os.getppid()
    try:
        _streams(output)
        for name in (signal.SIGTERM, signal.SIGCHLD, signal.SIGINT):
            signal.signal(name, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, set())
        os.umask(0o022)
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != keeper:
            os._exit(1)
        set_surroundings(
            request,
            code_dir=room.code_dir,
            layer_dirs=room.layer_dirs,
            tmp_dir=room.tmp_dir,
            port=room.port,
            egress_port=room.egress_port,
            logs=logs,
        )
        identity.without_privileges(dumpable=request["level"] >= L3)
        shut(room, request)
        if not tell(control, {"up": True}, *(listener.fileno() for listener in room.listeners)):
            os._exit(1)
    except BaseException as error:
        tell(control, {"error": f"{type(error).__name__}: {error}"})
        os._exit(1)
    control.close()
    for listener in room.listeners:
        listener.close()
    run_entry(request["entry"], request["handler"])


def _streams(output: int) -> None:
    nothing = os.open("/dev/null", os.O_RDONLY)
    for have, wanted in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(have, wanted)
    os.close(nothing)
    os.close(output)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", errors="backslashreplace", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1, closefd=False)  # noqa: SIM115


def set_surroundings(
    request: dict[str, Any],
    *,
    code_dir: str,
    layer_dirs: Sequence[str],
    tmp_dir: str,
    port: int,
    egress_port: int,
    logs: int | None,
) -> None:
    """Environment, working folder and import path: the function's code, its layers, then what the gateway has."""
    asked = request["env"]
    os.environ.clear()
    os.environ.update(
        {
            "LANG": "C.UTF-8",
            "TZ": ":UTC",
            **asked,
            "PATH": os.pathsep.join([*(f"{layer}/bin" for layer in layer_dirs), asked.get("PATH", PATH)]),
            "HOME": tmp_dir,
            "TMPDIR": tmp_dir,
            "AWS_LAMBDA_RUNTIME_API": f"127.0.0.1:{port}",
            "_HANDLER": request["handler"],
            "LAMBDA_TASK_ROOT": code_dir,
            "LAMBDA_RUNTIME_DIR": request["runtime_dir"],
        }
    )
    if egress_port:
        os.environ.update(dict.fromkeys(PROXIES, f"http://127.0.0.1:{egress_port}"))
        os.environ.update(dict.fromkeys(("NO_PROXY", "no_proxy"), f"127.0.0.1:{port}"))
    if logs is not None:
        os.environ["_LAMBDA_TELEMETRY_LOG_FD"] = str(logs)
    os.chdir(code_dir)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    layered = [
        path
        for layer in reversed(layer_dirs)
        for path in (f"{layer}/python/lib/{version}/site-packages", f"{layer}/python")
    ]
    sys.path[:0] = [code_dir, *layered]
    sys.dont_write_bytecode = True
    sys.argv = ["function", request["handler"]]


def run_entry(entry: str, handler: str) -> NoReturn:
    """The runtime's client, which imports the handler; as a program would end, so does the worker."""
    status = 1
    try:
        if entry == "awslambdaric":
            from awslambdaric.__main__ import main as aws_main  # type: ignore[import-untyped]

            aws_main(["awslambdaric", handler])
        elif entry == "metaros":
            from metaros.functions.runtime_client import main

            main(handler, os.environ["AWS_LAMBDA_RUNTIME_API"])
        status = 0
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        if isinstance(leaving.code, str):
            print(leaving.code, file=sys.stderr)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            status = status or 1
    os._exit(status & 0xFF)
