"""Which files, ports and processes a worker reaches: the kernel's Landlock, that needs no privilege."""

from __future__ import annotations

import contextlib
import ctypes
import os
import stat
import struct
import sys
from collections.abc import Iterable

from metaros.automation.functions.sandbox.libc import syscall

__all__ = ["abi", "confine"]

EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
REFER, TRUNCATE, IOCTL_DEV = 1 << 13, 1 << 14, 1 << 15
READING = EXECUTE | READ_FILE | READ_DIR
OF_FILES = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
MAKE_DEVICES = 1 << 6 | 1 << 11
BIND, CONNECT = 1 << 0, 1 << 1
SCOPE_ABSTRACT_UNIX, SCOPE_SIGNAL = 1 << 0, 1 << 1
RULE_PATH, RULE_PORT = 1, 2
PORTS_SINCE, SCOPES_SINCE = 4, 6  # versions of the ABI: Linux 6.7 and 6.12


def abi() -> int:
    """The version of the kernel's Landlock; 0 where it has none."""
    try:
        return syscall("landlock_create_ruleset", None, 0, 1)
    except (OSError, KeyError):
        return 0


def _known_files(version: int) -> int:
    newest = {1: 13, 2: 14, 3: 15, 4: 15}.get(version, 16)
    return (1 << newest) - 1


def confine(*, read: Iterable[str], write: Iterable[str], ports: Iterable[int] | None) -> None:
    """Shut this process and its children in: it reads (and runs) below `read`, also writes below `write`, and no more.

    `ports`: the only TCP ports that it may connect to; None leaves the network alone. Signals and abstract Unix sockets
    do not leave either. A path that is not there is no rule.
    """
    version = abi()
    files = _known_files(version)
    network = BIND | CONNECT if ports is not None and version >= PORTS_SINCE else 0
    scopes = SCOPE_ABSTRACT_UNIX | SCOPE_SIGNAL if version >= SCOPES_SINCE else 0
    attributes = struct.pack("=QQQ", files, network, scopes)
    size = 24 if version >= SCOPES_SINCE else 16 if version >= PORTS_SINCE else 8
    ruleset = syscall("landlock_create_ruleset", ctypes.create_string_buffer(attributes, 24), size, 0)
    try:
        for path in read:
            _allow(ruleset, path, READING & files)
        for path in write:
            _allow(ruleset, path, files & ~MAKE_DEVICES)
        for port in (ports or ()) if network else ():
            rule = struct.pack("=QQ", CONNECT, port)
            syscall("landlock_add_rule", ruleset, RULE_PORT, ctypes.create_string_buffer(rule, len(rule)), 0)
        syscall("landlock_restrict_self", ruleset, 0)
    finally:
        os.close(ruleset)


def _allow(ruleset: int, path: str, access: int) -> None:
    if sys.platform != "linux":
        raise NotImplementedError
    with contextlib.suppress(FileNotFoundError, PermissionError):
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            if not stat.S_ISDIR(os.fstat(opened).st_mode):
                access &= OF_FILES
            rule = struct.pack("=Qi", access, opened)
            syscall("landlock_add_rule", ruleset, RULE_PATH, ctypes.create_string_buffer(rule, len(rule)), 0)
        finally:
            os.close(opened)
