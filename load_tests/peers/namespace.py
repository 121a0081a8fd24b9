"""A network of one's own: a namespace with nothing but a loopback whose counters no other process touches. Linux."""

from __future__ import annotations

import ctypes
import os
import socket
import struct
import sys
from contextlib import suppress
from pathlib import Path

__all__ = ["own_network"]

_NEW_USER, _NEW_NET = 0x10000000, 0x40000000
_GET_FLAGS, _SET_FLAGS, _UP = 0x8913, 0x8914, 1


def own_network() -> bool:
    """Move this process, which must have one thread, into a new network namespace; False where that is refused.

    Who is not root gets a user namespace with it. Root keeps its own: Zenoh's shared memory is locked in RAM, for which
    a user namespace has only what RLIMIT_MEMLOCK allows.
    """
    if sys.platform != "linux":
        return False
    user, group = os.geteuid(), os.getegid()
    libc = ctypes.CDLL(None)
    if libc.unshare(_NEW_NET) != 0:
        if libc.unshare(_NEW_USER | _NEW_NET) != 0:
            return False
        with suppress(OSError):  # without the maps only the names of users are lost
            Path("/proc/self/setgroups").write_text("deny")
            Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
            Path("/proc/self/gid_map").write_text(f"{group} {group} 1")
    return _loopback_up()


def _loopback_up() -> bool:
    """`ip link set lo up`, without `ip`."""
    import fcntl

    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            request = struct.pack("16sh14x", b"lo", 0)
            _, flags = struct.unpack("16sh14x", fcntl.ioctl(control, _GET_FLAGS, request))
            fcntl.ioctl(control, _SET_FLAGS, struct.pack("16sh14x", b"lo", flags | _UP))
    except OSError:
        return False
    return True
