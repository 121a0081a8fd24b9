"""Processes of `metaros` forked from a server that has done the imports once.

`Forked(arguments, …)` is such a process, by its own id, and asked what a `Popen` is asked. `warm_metaros(folder)` puts
a program `metaros` into the folder, for PATH or to be run. That is a small one, which hands its arguments, its
environment, its place and its files to the server, passes signals on, and ends as the real one does. Who kills it kills
both. Imports are most of what a command costs, and three of the four seconds of a gateway's start. For tests of
starting, the real thing: `tests.support.processes.command_line.program`.

There is one server for all tests of a worker, with which it ends.
"""

from __future__ import annotations

import ast
import atexit
import contextlib
import functools
import gc
import importlib
import io
import os
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NoReturn

from metaros.supervise.parent_death import die_with_parent

__all__ = ["Forked", "warm_metaros"]

MODULES = (
    *("metaros.cli.main", "metaros.node", "metaros.sim", "metaros.cli.launch.run", "metaros.cli.topic.commands"),
    *("gateway.cli.gateway", "gateway.main", "gateway.wiring.gateway", "edge_agent.cli.agent", "edge_agent.main"),
)
PASSED_ON = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")
ROOT = Path(__file__).resolve().parents[3]
END_S = 60.0
BEGINNING = threading.Lock()

# Nothing is imported that is not in the interpreter itself: it starts in ten milliseconds.
CLIENT = """#!{python} -SE
import _signal, _socket, array, posix, sys
link = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
link.connect({place!r})
said = repr((sys.argv[1:], dict(posix.environ), posix.getcwd())).encode()
files = array.array("i", [0, 1, 2])
link.sendmsg([len(said).to_bytes(4, "big")], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, files)])
link.sendall(said)
link.recv(4)
for name in {passed_on!r}:
    _signal.signal(getattr(_signal, name), lambda number, _: link.send(bytes([number])))
code = int.from_bytes(link.recv(4) or b"\\0\\0\\0\\1", "big", signed=True)
if code < 0:
    _signal.signal(-code, _signal.SIG_DFL)
    posix.kill(posix.getpid(), -code)
posix._exit(code)
"""


@contextlib.contextmanager
def warm_metaros(folder: Path) -> Iterator[Path]:
    """The program's path; it is gone at the end, and what of it still runs is ended with the server."""
    path = folder / "metaros"
    path.write_text(CLIENT.format(python=sys.executable, place=_server(), passed_on=PASSED_ON))
    path.chmod(0o755)
    yield path
    path.unlink()


class Forked:
    """`metaros ARGUMENTS`, which is nobody's child here, and else what `subprocess.Popen` is."""

    stdin = stdout = stderr = None

    def __init__(self, arguments: Sequence[str], *, output: int, env: Mapping[str, str]) -> None:
        self.args = ["metaros", *arguments]
        self.returncode: int | None = None
        environ = {os.fsencode(name): os.fsencode(value) for name, value in env.items()}
        said = repr((list(arguments), environ, str(Path.cwd()))).encode()
        self._link = socket.socket(socket.AF_UNIX)
        self._link.connect(_server())
        with open(os.devnull, "rb") as nothing:
            files = [nothing.fileno(), output, output]
            socket.send_fds(self._link, [len(said).to_bytes(4, "big")], files)
            self._link.sendall(said)
            self.pid = int.from_bytes(self._link.recv(4), "big")
        self._over = threading.Thread(target=self._await, name=f"end of {self.pid}", daemon=True)
        self._over.start()

    def _await(self) -> None:
        with self._link:
            code = self._link.recv(4)
        self.returncode = int.from_bytes(code, "big", signed=True) if code else -signal.SIGKILL

    def poll(self) -> int | None:
        """Its exit code, once it has ended and is reaped."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """The same, when it is there."""
        self._over.join(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """To the process itself, which is not reaped before we are told."""
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        """SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """SIGKILL."""
        self.send_signal(signal.SIGKILL)


def _server() -> str:
    """Where this worker's server listens, until the worker ends; whoever asks first, in any thread, starts it."""
    with BEGINNING:
        return _begun()


@functools.cache
def _begun() -> str:
    place = str(Path(mkdtemp(prefix="metaros-warm-")) / "socket")
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.support.processes.fork_server", place],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # whoever has threads must not be forked
    )
    assert server.stdin is not None
    assert server.stdout is not None
    with server.stdout as said:
        assert said.readline() == b"ready\n"
    atexit.register(_end, server)
    return place


def _end(server: subprocess.Popen[bytes]) -> None:
    """What still runs of its processes ends with it; so it does where the worker is killed."""
    assert server.stdin is not None
    server.stdin.close()
    server.wait(END_S)


class Server:
    """Forks when it is asked to; each connection is a process, for as long as both are there."""

    def __init__(self, place: str) -> None:
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(place)
        self._place = place
        self._listener.listen(64)
        self._links: dict[int, socket.socket] = {}  # by the process
        self._woken, waker = os.pipe()
        for end in (self._woken, waker):
            os.set_blocking(end, False)
        self._ready = selectors.DefaultSelector()
        for file in (self._listener, self._woken, sys.stdin):
            self._ready.register(file, selectors.EVENT_READ)
        signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def run(self) -> None:
        """Until our owner closes our input."""
        while True:
            for key, _ in self._ready.select():
                if key.fileobj is sys.stdin:
                    for pid in self._links:
                        os.kill(pid, signal.SIGKILL)
                    shutil.rmtree(Path(self._place).parent)
                    return
                if key.fileobj is self._listener:
                    self._begin(self._listener.accept()[0])
                elif key.fileobj == self._woken:
                    os.read(self._woken, 4096)
                    self._reap()
                elif key.data in self._links:
                    self._hear(key.data)

    def _begin(self, link: socket.socket) -> None:
        head, files, _, _ = socket.recv_fds(link, 4, 3)
        said = b""
        while len(said) < int.from_bytes(head, "big"):
            said += link.recv(1 << 16)
        server = os.getpid()
        pid = os.fork()
        if pid == 0:
            die_with_parent(server)  # also where the server is killed with the worker
            self._become(files, *ast.literal_eval(said.decode()))
        for file in files:
            os.close(file)
        link.sendall(pid.to_bytes(4, "big"))
        self._links[pid] = link
        self._ready.register(link, selectors.EVENT_READ, pid)

    def _hear(self, pid: int) -> None:
        """A signal for the process, or its end with the program that stands for it."""
        numbers = self._links[pid].recv(16)
        for number in numbers or [signal.SIGKILL]:
            os.kill(pid, number)
        if not numbers:
            self._ready.unregister(self._links[pid])

    def _reap(self) -> None:
        with contextlib.suppress(ChildProcessError):
            while (found := os.waitpid(-1, os.WNOHANG))[0]:
                link = self._links.pop(found[0])
                with contextlib.suppress(KeyError):
                    self._ready.unregister(link)
                with contextlib.suppress(OSError), link:
                    link.sendall(os.waitstatus_to_exitcode(found[1]).to_bytes(4, "big", signed=True))

    def _become(self, files: list[int], argv: list[str], environ: dict[bytes, bytes], folder: str) -> NoReturn:
        code: Any = 1
        try:
            os.setsid()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            for number, file in enumerate(files):
                os.dup2(file, number)
            os.closerange(3, max(self._woken, *files, *(link.fileno() for link in self._links.values())) + 64)
            os.chdir(folder)
            os.environ.clear()
            os.environ.update({os.fsdecode(name): os.fsdecode(value) for name, value in environ.items()})
            sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False))
            for number, name in ((1, "stdout"), (2, "stderr")):
                file = io.BufferedWriter(io.FileIO(number, "w", closefd=False))
                setattr(sys, name, io.TextIOWrapper(file, encoding="utf-8", line_buffering=True))
            sys.argv = ["metaros", *argv]
            code = _run()
        except BaseException:
            traceback.print_exc()
        finally:
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.flush()
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.flush()
            os._exit(code)


def _run() -> int:
    """As an interpreter would, threads and what was to be done at exit included."""
    import atexit
    import threading

    from metaros.cli.main import main

    code: Any = 0
    try:
        main()
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    if isinstance(code, str):
        sys.stderr.write(f"{code}\n")
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    return int(code or 0)


def serve(place: str) -> None:
    """The server's life."""
    for name in MODULES:
        importlib.import_module(name)
    threads = len(os.listdir("/proc/self/task")) if sys.platform == "linux" else 1
    assert threads == 1
    gc.collect()
    gc.freeze()
    server = Server(place)
    print("ready", flush=True)
    server.run()


if __name__ == "__main__":
    serve(sys.argv[1])
