"""A worker's sandbox at each level: built by its init process as the gateway's user, before the worker is forked."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Sequence

from metaros.automation.functions.sandbox import identity, landlock, mounts, namespaces, rlimits, seccomp

TYPE_CHECKING = False  # see ../fork_server.py
if TYPE_CHECKING:
    from typing import Any

__all__ = ["CODE_AT", "LAYERS_AT", "SandboxLayout", "build", "clone_flags", "confine"]

CODE_AT, LAYERS_AT = "/var/task", "/opt"  # as at AWS
L1, L2, L3 = 1, 2, 3
READ_DEVICES = ("/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
MACHINE = ("/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/sys/vm/overcommit_memory")


class SandboxLayout:
    """Where a worker finds things; `listeners` are what its gateway accepts on, where they must come from inside.

    `egress_port` is of its proxy; 0: it has none."""

    def __init__(
        self,
        code_dir: str,
        layer_dirs: Sequence[str],
        tmp_dir: str,
        port: int,
        egress_port: int,
        listeners: Sequence[socket.socket] = (),
    ) -> None:
        self.code_dir, self.layer_dirs, self.tmp_dir = code_dir, layer_dirs, tmp_dir
        self.port, self.egress_port, self.listeners = port, egress_port, listeners


def clone_flags(level: int) -> int:
    """The namespaces in which init is started; 0: a plain fork."""
    if sys.platform != "linux":
        raise NotImplementedError
    if level < L3:
        return 0
    return namespaces.ISOLATED | (0 if os.geteuid() == 0 else namespaces.USER)


def build(request: dict[str, Any], was: tuple[int, int]) -> SandboxLayout:
    """Namespaces, files, limits and user, so that the worker is born into them. `was`: user and group before."""
    level, root = request["level"], was[0] == 0
    had = rlimits.private_bytes()
    if level >= L3:
        if not root:
            namespaces.map_self(*was)
        uid, gid = identity.choose(request["uid"], request["gid"], namespaces.own_pid())
        layout = _isolated_layout(request, (uid, gid))
        processes = request["processes"] + 1  # its init process
    else:
        uid, gid = identity.choose(request["uid"], request["gid"], os.getpid())
        layout = _shared_layout(request, (uid, gid), root=root)
        processes = request["processes"] + 1 + (0 if root else rlimits.tasks_of(uid))
    rlimits.limit(
        memory_mb=request["memory_mb"],
        processes=processes,
        open_files=request["open_files"],
        file_bytes=request["disk_bytes"],
        had=had,
    )
    identity.become(uid, gid)
    identity.without_privileges(dumpable=False)
    return layout


def _isolated_layout(request: dict[str, Any], owner: tuple[int, int]) -> SandboxLayout:
    namespaces.loopback_up()
    egress_port = namespaces.EGRESS_PORT if request["egress"] else 0
    listeners = [namespaces.listen(port) for port in (namespaces.API_PORT, egress_port) if port]
    layers = [f"{LAYERS_AT}/{index}" for index in range(len(request["layer_dirs"]))]
    placed = {CODE_AT: request["code_dir"], **dict(zip(layers, request["layer_dirs"], strict=True))}
    mounts.enter_root(
        request["tmp_dir"],
        shown=request["shown"],
        placed=placed,
        tmp_bytes=request["disk_bytes"],
        owner=owner,
    )
    return SandboxLayout(CODE_AT, layers, "/tmp", namespaces.API_PORT, egress_port, listeners)


def _shared_layout(request: dict[str, Any], owner: tuple[int, int], *, root: bool) -> SandboxLayout:
    if sys.platform != "linux":
        raise NotImplementedError
    tmp_dir, code_dir, layers = request["tmp_dir"], request["code_dir"], request["layer_dirs"]
    if root:
        os.chown(tmp_dir, *owner)
        mounts.open_way([*request["shown"], code_dir, *layers, tmp_dir])
    os.chmod(tmp_dir, 0o700)
    return SandboxLayout(code_dir, layers, tmp_dir, request["port"], request["egress_port"])


def confine(layout: SandboxLayout, request: dict[str, Any]) -> None:
    """The last step, by the worker itself: from here on only its own files, its own ports and few system calls."""
    level = request["level"]
    if level >= L3:
        if landlock.abi():
            landlock.confine(read=["/"], write=["/tmp", "/dev"], ports=None)
    elif level == L2:
        read = (*mounts.SYSTEM, *request["shown"], layout.code_dir, *layout.layer_dirs, *READ_DEVICES, *MACHINE)
        ports = [port for port in (layout.port, layout.egress_port) if port]
        landlock.confine(read=read, write=[layout.tmp_dir, "/dev/null"], ports=ports)
    if level >= L2:
        seccomp.confine(own_network=level >= L3)
