"""A worker and its init process, from the fork on: init builds the sandbox and ends everything in it with the worker.

This runs in the fork server's child: one thread, nothing of the gateway in memory, and no way back.
"""

from __future__ import annotations

import array
import gc
import json
import os
import select
import signal
import socket
import sys
from collections.abc import Sequence

from metaros.automation.functions.sandbox import identity
from metaros.automation.functions.sandbox.isolation import L3, SandboxLayout, build, confine
from metaros.automation.functions.sandbox.libc import PR_SET_CHILD_SUBREAPER, PR_SET_PDEATHSIG, prctl

TYPE_CHECKING = False  # see fork_server.py
if TYPE_CHECKING:
    from typing import Any, NoReturn

__all__ = ["SignalPipe", "run_entry", "run_init", "set_surroundings", "tell"]

PATH = "/usr/local/bin:/usr/bin:/bin"
LOG_SETTINGS = ("AWS_LAMBDA_LOG_FORMAT", "AWS_LAMBDA_LOG_LEVEL")
PROXIES = ("HTTPS_PROXY", "HTTP_PROXY", "https_proxy", "http_proxy")


class SignalPipe:
    """The init process's signals as bytes of a pipe: one that comes just before a wait begins ends that wait, too.

    (A handler in Python runs between two steps of the interpreter: of a `recv` that was as good as begun, after it.)
    """

    def __init__(self) -> None:
        if sys.platform != "linux":
            raise NotImplementedError
        self._came, self._comes = os.pipe()
        for end in (self._came, self._comes):
            os.set_blocking(end, False)
        signal.set_wakeup_fd(self._comes, warn_on_full_buffer=False)
        for name in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(name, lambda *_: None)

    def release(self) -> None:
        """For the worker, which is forked off: it has none of that."""
        if sys.platform != "linux":
            raise NotImplementedError
        signal.set_wakeup_fd(-1)
        for name in (signal.SIGTERM, signal.SIGCHLD, signal.SIGINT):
            signal.signal(name, signal.SIG_DFL)
        os.close(self._came)
        os.close(self._comes)

    def wait(self, worker: int, control: socket.socket) -> None:
        """Return when the worker has ended, which is reported, the gateway lets go, or init is to end."""
        if sys.platform != "linux":
            raise NotImplementedError
        poll = select.poll()
        poll.register(self._came, select.POLLIN)
        poll.register(control, select.POLLIN)
        while True:
            ready = {descriptor for descriptor, _ in poll.poll()}
            if self._came in ready and (signal.SIGTERM in os.read(self._came, 4096) or _reap(worker, control)):
                return
            if control.fileno() in ready:
                return


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


def run_init(request: dict[str, Any], control: socket.socket, output: int, logs: int, was: tuple[int, int]) -> NoReturn:
    """Be a worker's init process: sends `kept`, with the pidfd by which it can be ended, and then how the
    worker ended; ends it where the gateway lets go of `control`.
    """
    if sys.platform != "linux":
        raise NotImplementedError
    try:
        os.setsid()
        os.umask(0o022)  # whatever the gateway's is: folders of the sandbox are for the worker, who is somebody else
        own_fd = os.pidfd_open(os.getpid())
        tell(control, {"kept": True}, own_fd)
        os.close(own_fd)
        layout = build(request, was)
        own = request["level"] >= L3
        # A killed fork server takes its init processes along. They end the rest; in a pid namespace the kernel does.
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL if own else signal.SIGTERM)
        prctl(PR_SET_CHILD_SUBREAPER, 1)  # whose parent ends is init's, so that all of a worker's memory is found
        signals = SignalPipe()
        worker = os.fork()
        if worker == 0:
            signals.release()
            _work(request, layout, control, output, logs)
        for opened in (output, logs, *(listener.detach() for listener in layout.listeners)):
            os.close(opened)
        signals.wait(worker, control)
    except BaseException as error:
        tell(control, {"error": f"{type(error).__name__}: {error}"})
    _end_all()


def _reap(worker: int, control: socket.socket) -> bool:
    """Take from the kernel who has ended; whether the worker is among them, which is reported to the gateway."""
    if sys.platform != "linux":
        raise NotImplementedError
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return False
        if pid == 0:
            return False
        if pid == worker:
            tell(control, {"status": os.waitstatus_to_exitcode(status)})
            return True


def _end_all() -> NoReturn:
    """In a pid namespace all ends with its first process; elsewhere the process group is ended."""
    if sys.platform != "linux":
        raise NotImplementedError
    if os.getpid() != 1:
        os.killpg(0, signal.SIGKILL)
    os._exit(0)


def _work(request: dict[str, Any], layout: SandboxLayout, control: socket.socket, output: int, logs: int) -> NoReturn:
    """Be the worker: take the last steps of the sandbox, then the user's code."""
    if sys.platform != "linux":
        raise NotImplementedError
    init = os.getppid()
    try:
        _streams(output)
        signal.pthread_sigmask(signal.SIG_SETMASK, set())
        os.umask(0o022)
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != init:
            os._exit(1)
        set_surroundings(
            request,
            code_dir=layout.code_dir,
            layer_dirs=layout.layer_dirs,
            tmp_dir=layout.tmp_dir,
            port=layout.port,
            egress_port=layout.egress_port,
            logs=logs,
        )
        identity.without_privileges(dumpable=request["level"] >= L3)
        confine(layout, request)
        if not tell(control, {"up": True}, *(listener.fileno() for listener in layout.listeners)):
            os._exit(1)
    except BaseException as error:
        tell(control, {"error": f"{type(error).__name__}: {error}"})
        os._exit(1)
    control.close()
    for listener in layout.listeners:
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


def _mind_log_settings() -> None:
    """AWS's client looks at them as it is imported, which it may have been before they were there."""
    if "awslambdaric.bootstrap" in sys.modules and any(name in os.environ for name in LOG_SETTINGS):
        del sys.modules["awslambdaric.bootstrap"], sys.modules["awslambdaric"].bootstrap


def run_entry(entry: str, handler: str) -> NoReturn:
    """The runtime's client, which imports the handler; as a program would end, so does the worker."""
    status = 1
    try:
        if entry == "awslambdaric":
            _mind_log_settings()
            from awslambdaric.__main__ import main as aws_main  # type: ignore[import-untyped]

            gc.enable()
            aws_main(["awslambdaric", handler])
        elif entry == "metaros":
            from metaros.automation.functions.runtime.runtime_client import main

            gc.enable()
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
