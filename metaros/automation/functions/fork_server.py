"""The program that a gateway starts to have workers forked from it: trusted code only, one thread, no secrets.

It is run as `python -I -S -c <BOOT> <arguments as JSON>`, so that nothing but what it needs is imported.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import json
import os
import signal
import socket
import sys
from collections.abc import Sequence

from metaros.automation.functions.child import run_init, tell
from metaros.automation.functions.sandbox import seccomp
from metaros.automation.functions.sandbox.isolation import clone_flags
from metaros.automation.functions.sandbox.libc import PR_SET_PDEATHSIG, clone, prctl

TYPE_CHECKING = False  # `typing` and others cost a cold start by exec milliseconds
if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec
    from typing import Any

__all__ = ["BOOT", "FILES", "REQUEST_BYTES", "main"]

BOOT = (
    "import sys, json; a = json.loads(sys.argv[1]); sys.path[:] = a['paths'];"
    "from metaros.automation.functions.fork_server import main; main(a)"
)
REQUEST_BYTES = 128 * 1024  # one request, which is one datagram
AWS_CLIENT = tuple(
    f"awslambdaric.{name}" for name in ("__main__", "lambda_config", "lambda_runtime_client", "bootstrap")
)
AWS_CLIENT_NEEDS = "libstdc++.so.6"
AWS_CLIENT_CORE = ("awslambdaric.lambda_runtime_client", "awslambdaric.bootstrap")
FILES = 3  # that come with it: control, output, logs


class CompiledAhead:
    """Finds modules that a worker imports itself, as they look at its environment, but need not compile again."""

    def __init__(self, names: Sequence[str]) -> None:
        from importlib.machinery import SourceFileLoader
        from importlib.util import find_spec

        self._specs: dict[str, ModuleSpec] = {}
        for name in names:
            with contextlib.suppress(ImportError):
                spec = find_spec(name)
                if spec is not None and isinstance(spec.loader, SourceFileLoader):
                    code = spec.loader.get_code(name)
                    spec.loader.get_code = lambda _, code=code: code  # type: ignore[method-assign,misc]
                    self._specs[name] = spec

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """The import system's question; None leaves the answer to the others."""
        return self._specs.get(name)


def main(arguments: dict[str, Any]) -> None:
    """Serve fork requests on the inherited socket until its other end closes."""
    if sys.platform != "linux":
        raise NotImplementedError
    gc.disable()  # imports make much and drop little: `run_entry` has it on again for the handler
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    channel = socket.socket(fileno=arguments["channel"])
    if os.getppid() != arguments["parent"]:
        return
    import site

    site.setquit()
    for name in arguments["preload"]:
        try:
            importlib.import_module(name)
        except ImportError:
            continue
    if not arguments["once"]:
        _prepare(arguments["api"])
    # What is here now is never collected: the workers' collectors leave the pages shared.
    gc.freeze()
    signal.signal(
        signal.SIGCHLD, signal.SIG_IGN
    )  # ended init processes are gone at once; they report to the gateway themselves
    channel.send(b"ready")
    while True:
        try:
            data, files, _, _ = socket.recv_fds(channel, REQUEST_BYTES, FILES)
        except ConnectionError:
            break
        if not data:
            break
        for opened in files:
            os.set_inheritable(opened, False)
        _fork(json.loads(data), files, channel)
    if arguments["once"]:
        _wait_for_children()


def _prepare(api: str) -> None:
    """What every worker would do itself, and none of which depends on the worker."""
    sys.meta_path.insert(0, CompiledAhead(AWS_CLIENT))
    with contextlib.suppress(OSError):  # it takes the linker a while
        ctypes.CDLL(AWS_CLIENT_NEEDS)
    if api:  # which AWS's client reads as it is imported, and never again
        os.environ["AWS_LAMBDA_RUNTIME_API"] = api
        for name in AWS_CLIENT_CORE:  # `child` has the second one imported anew where that makes a difference
            with contextlib.suppress(ImportError):
                importlib.import_module(name)
    for own_network in (True, False):
        seccomp.build(own_network=own_network)
    gc.collect()


def _fork(request: dict[str, Any], files: list[int], channel: socket.socket) -> None:
    if sys.platform != "linux":
        raise NotImplementedError
    control, output, logs = files
    with socket.socket(fileno=control) as status:
        was = os.geteuid(), os.getegid()
        try:
            flags = clone_flags(request["level"])
            pid = clone(flags | signal.SIGCHLD) if flags else os.fork()
        except OSError as error:
            tell(status, {"error": f"cannot fork: {error}"})
            pid = -1
        if pid == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            channel.close()
            run_init(request, status, output, logs, was)
    os.close(output)
    os.close(logs)


def _wait_for_children() -> None:
    if sys.platform != "linux":
        raise NotImplementedError
    while True:
        try:
            os.wait()
        except ChildProcessError:
            return
