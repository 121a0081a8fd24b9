"""Who a worker is: never the machine's root, with no capability and no way to a new privilege."""

from __future__ import annotations

import os
import sys

from metaros.automation.functions.sandbox.libc import PR_SET_DUMPABLE, PR_SET_NO_NEW_PRIVS, capset_none, prctl

__all__ = ["FIRST_UID", "NOBODY", "become", "choose", "without_privileges"]

NOBODY = 65534
FIRST_UID = 1_900_000_000  # plus the worker's process id: nobody else's on this machine as long as it lives


def choose(uid: int | None, gid: int | None, own_pid: int) -> tuple[int, int]:
    """The user and group of a worker: those of this process, but where it is root, those asked for, or (None) a user of
    this worker alone, or `nobody` where the container has so few users."""
    if sys.platform != "linux":
        raise NotImplementedError
    if os.geteuid() != 0:
        return os.geteuid(), os.getegid()
    own = FIRST_UID + own_pid if _has_user(FIRST_UID + own_pid) else NOBODY
    return own if uid is None else uid, own if gid is None else gid


def _has_user(uid: int) -> bool:
    with open("/proc/self/uid_map", encoding="utf-8") as lines:
        rows = [[int(word) for word in row.split()] for row in lines]
    return any(first <= uid < first + count for first, _, count in rows)


def become(uid: int, gid: int) -> None:
    """Leave root, for good, for a user that owns nothing; who is not root stays who it is."""
    if sys.platform != "linux":
        raise NotImplementedError
    if os.geteuid() == 0:
        os.setgroups([])
        os.setresgid(gid, gid, gid)
        os.setresuid(uid, uid, uid)
    if 0 in os.getresuid() or 0 in os.getresgid():
        raise PermissionError("a worker must not be root")


def without_privileges(*, dumpable: bool) -> None:
    """No capability, none to be had by any program, and no other process looks into this one unless `dumpable`."""
    capset_none()
    prctl(PR_SET_NO_NEW_PRIVS, 1)
    prctl(PR_SET_DUMPABLE, int(dumpable))
