"""What a worker sees of the machine's files: at L3 a root of its own, below that a way to the interpreter."""

from __future__ import annotations

import contextlib
import os
import stat
import sys
from collections.abc import Iterable, Mapping

from metaros.automation.functions.sandbox.libc import syscall

__all__ = ["SYSTEM", "enter_root", "open_way"]

RDONLY, NOSUID, NODEV, NOEXEC = 1, 2, 4, 8
BIND, REC, PRIVATE, DETACH = 4096, 16384, 1 << 18, 2
AT_FDCWD, AT_RECURSIVE = -100, 0x8000
INODES = 16384  # of a worker's /tmp: each costs the kernel memory
# Programs and libraries of the machine, and the little of its settings that every program reads.
SYSTEM = (
    *("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64"),
    *("/etc/ld.so.cache", "/etc/localtime", "/etc/alternatives", "/etc/ssl/certs", "/etc/ssl/openssl.cnf"),
)
DEVICES = ("null", "zero", "full", "random", "urandom")


def enter_root(
    at: str, *, shown: Iterable[str], placed: Mapping[str, str], tmp_bytes: int, owner: tuple[int, int]
) -> None:
    """In new mount and pid namespaces: make a root of `shown` (in place) and `placed` (path inside: path here), all
    read-only, a /tmp of its own in memory, a few devices and its own /proc, and leave the machine's files for it.

    `at` is any folder; nothing of it changes outside.
    """
    _mount(None, "/", None, REC | PRIVATE)
    _mount("tmpfs", at, "tmpfs", NOSUID | NODEV, "mode=755,size=1m")
    for folder in ("tmp", "dev", "proc"):
        os.mkdir(f"{at}/{folder}", 0o755)
    uid, gid = owner
    options = f"mode=700,uid={uid},gid={gid},size={tmp_bytes},nr_inodes={INODES}"
    _mount("tmpfs", f"{at}/tmp", "tmpfs", NOSUID | NODEV, options)
    for path in (*SYSTEM, *_outermost(shown)):
        _show(at, path, path)
    for inside, path in placed.items():
        _show(at, path, inside)
    for name in DEVICES:
        os.close(os.open(f"{at}/dev/{name}", os.O_CREAT | os.O_WRONLY, 0o644))
        _mount(f"/dev/{name}", f"{at}/dev/{name}", None, BIND)
    os.symlink("/tmp", f"{at}/dev/shm")
    os.symlink("/proc/self/fd", f"{at}/dev/fd")
    # Some containers mask their /proc and then allow no other: the worker goes without.
    with contextlib.suppress(OSError):
        _mount("proc", f"{at}/proc", "proc", NOSUID | NODEV | NOEXEC | RDONLY)
    os.chdir(at)
    syscall("pivot_root", b".", b".")
    syscall("umount2", b".", DETACH)
    os.chdir("/")
    _read_only("/", recursive=False)


def open_way(paths: Iterable[str]) -> None:
    """As root, before becoming somebody else: where folders above `paths` are closed to others (/root), hide these
    folders for this process and show only the paths in them."""
    if sys.platform != "linux":
        raise NotImplementedError
    import ctypes  # noqa: F401  # before the interpreter's own folder is hidden

    closed: dict[str, list[str]] = {}
    for path in _outermost(paths):
        if (barrier := _barrier(path)) is not None:
            closed.setdefault(barrier, []).append(path)
    if not closed:
        return
    syscall("unshare", 0x00020000)
    _mount(None, "/", None, REC | PRIVATE)
    for barrier, hidden in closed.items():
        opened = [(path, os.open(path, os.O_PATH)) for path in hidden]
        _mount("tmpfs", barrier, "tmpfs", NOSUID | NODEV, "mode=755,size=1m")
        for path, handle in opened:
            os.makedirs(path, mode=0o755, exist_ok=True)
            _mount(f"/proc/self/fd/{handle}", path, None, BIND | REC)
            os.close(handle)


def _barrier(path: str) -> str | None:
    """The first folder on the way that others may not pass through."""
    parts = path.strip("/").split("/")
    for depth in range(1, len(parts)):
        folder = "/" + "/".join(parts[:depth])
        if not os.stat(folder).st_mode & stat.S_IXOTH:
            return folder
    return None


def _outermost(paths: Iterable[str]) -> list[str]:
    """Each path that no other of them holds."""
    kept: list[str] = []
    for path in sorted({path.rstrip("/") for path in paths}):
        if not any(path == outer or path.startswith(outer + "/") for outer in kept):
            kept.append(path)
    return kept


def _show(at: str, path: str, inside: str) -> None:
    target = at + inside
    if os.path.islink(path):
        os.makedirs(os.path.dirname(target), exist_ok=True)
        os.symlink(os.readlink(path), target)
        return
    if os.path.isdir(path):
        if os.path.isdir(target) and os.listdir(target):
            return  # it came with what holds it
        os.makedirs(target, exist_ok=True)
    elif os.path.exists(path):
        os.makedirs(os.path.dirname(target), exist_ok=True)
        with contextlib.suppress(OSError):
            os.close(os.open(target, os.O_CREAT | os.O_WRONLY, 0o644))
    else:
        return
    _mount(path, target, None, BIND | REC)
    _read_only(target, recursive=True)


def _read_only(path: str, *, recursive: bool) -> None:
    """Only adds to what a mount has: in a user namespace nothing may be taken off."""
    import ctypes

    attributes = b"".join(value.to_bytes(8, "little") for value in (RDONLY | NOSUID | NODEV, 0, 0, 0))
    flags = AT_RECURSIVE if recursive else 0
    syscall("mount_setattr", AT_FDCWD, os.fsencode(path), flags, ctypes.create_string_buffer(attributes, 32), 32)


def _mount(source: str | None, target: str, kind: str | None, flags: int, options: str | None = None) -> None:
    words = [None if word is None else os.fsencode(word) for word in (source, target, kind, options)]
    try:
        syscall("mount", words[0], words[1], words[2], flags, words[3])
    except OSError as error:
        raise OSError(error.errno, f"cannot mount {source or 'nothing'} on {target}: {error.strerror}") from None
