"""A worker's own processes, network, mounts and messages: what the kernel calls namespaces."""

from __future__ import annotations

import os
import socket
import struct
import sys

__all__ = ["API_PORT", "EGRESS_PORT", "ISOLATED", "USER", "listen", "loopback_up", "map_self", "own_pid"]

NEW_NS, NEW_IPC, NEW_USER, NEW_PID, NEW_NET, NEW_UTS = (
    0x00020000,
    0x08000000,
    0x10000000,
    0x20000000,
    0x40000000,
    0x04000000,
)
ISOLATED = NEW_NS | NEW_IPC | NEW_PID | NEW_NET | NEW_UTS
USER = NEW_USER
API_PORT = 9001  # of the Runtime API, inside: every worker has a loopback of its own
EGRESS_PORT = 9002  # and of its proxy, if it has one
BACKLOG = 16
SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 0x1


def map_self(uid: int, gid: int) -> None:
    """In a new user namespace: be who one was, and nobody else."""
    for name, text in (("setgroups", "deny"), ("uid_map", f"{uid} {uid} 1"), ("gid_map", f"{gid} {gid} 1")):
        with open(f"/proc/self/{name}", "w", encoding="utf-8") as file:
            file.write(text)


def loopback_up() -> None:
    """In a new network namespace: bring its loopback up."""
    if sys.platform != "linux":
        raise NotImplementedError
    import fcntl

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        request = struct.pack("16sh14x", b"lo", 0)
        flags = struct.unpack("16sh14x", fcntl.ioctl(asked, SIOCGIFFLAGS, request))[1]
        fcntl.ioctl(asked, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", flags | IFF_UP))


def listen(port: int) -> socket.socket:
    """Listen on the loopback, for the gateway that is handed the socket."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.bind(("127.0.0.1", port))
    listener.listen(BACKLOG)
    return listener


def own_pid() -> int:
    """This process's id as the /proc that it still sees has it: the machine's, not that of its new namespace."""
    return int(os.readlink("/proc/self"))
