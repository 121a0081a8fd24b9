"""The kernel's calls that Python has no function for, through ctypes; nothing is loaded before the first call."""

from __future__ import annotations

import ctypes
import functools
import os
import sys

from metaros.automation.functions.sandbox.calls import CALLS

TYPE_CHECKING = False  # see ../fork_server.py
if TYPE_CHECKING:
    from typing import Any

__all__ = ["capset_none", "clone", "machine", "number", "prctl", "syscall"]

PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_CHILD_SUBREAPER, PR_SET_NO_NEW_PRIVS = 1, 4, 36, 38
CAPABILITY_VERSION_3 = 0x20080522


@functools.cache
def _libc() -> Any:
    # PyDLL keeps the interpreter's lock over the call: the child of `clone` must come back holding it.
    return ctypes.PyDLL(None, use_errno=True)


@functools.cache
def machine() -> str:
    """The processor's family, as `platform.machine` has it, which is slow to import."""
    if sys.platform == "win32":
        raise NotImplementedError
    return os.uname().machine


@functools.cache
def number(name: str) -> int:
    """The number of a system call on this machine; KeyError where it has none."""
    return CALLS[machine()][name]


def syscall(name: str, *args: int | bytes | ctypes.Array[ctypes.c_char] | None) -> int:
    """Make a system call; OSError names it."""
    wide = [ctypes.c_long(arg) if isinstance(arg, int) else arg for arg in args]
    result = int(_libc().syscall(ctypes.c_long(number(name)), *wide))
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"{name}: {os.strerror(code)}")
    return result


def prctl(option: int, value: int, *more: int) -> None:
    """Set one property of this process; the kernel wants the unused arguments to be zero."""
    syscall("prctl", option, value, *(*more, 0, 0, 0)[:3])


def capset_none() -> None:
    """Give up every capability, also those of an own user namespace."""
    header = ctypes.create_string_buffer(CAPABILITY_VERSION_3.to_bytes(4, "little") + bytes(4), 8)
    syscall("capset", header, ctypes.create_string_buffer(bytes(24), 24))


def clone(flags: int) -> int:
    """`os.fork()` into new namespaces; only for a process of one thread.

    `unshare` would not do: after its first new pid namespace a process may make no second one, and a fork server
    makes one a worker. Python is told of the fork as `os.fork` tells it.
    """
    hooks = ctypes.pythonapi
    hooks.PyOS_BeforeFork()
    try:
        pid = syscall("clone", flags, 0, 0, 0, 0)
    except OSError:
        hooks.PyOS_AfterFork_Parent()
        raise
    if pid == 0:
        hooks.PyOS_AfterFork_Child()
    else:
        hooks.PyOS_AfterFork_Parent()
    return pid
