"""What Linux tells of a process from outside: threads, memory, shared objects, CPU; and of the loopback."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

__all__ = ["busy_cpu_s", "loopback_bytes", "process_cpu_s", "resident_bytes", "shared_object_bytes", "thread_count"]

_SHARED_OBJECT = re.compile(r"\.so(\.[\w.]+)?$")


def thread_count(pid: int) -> int | None:
    """Threads that the process has now."""
    return _status_number(pid, "Threads")


def resident_bytes(pid: int) -> int | None:
    """Its resident memory."""
    kib = _status_number(pid, "VmRSS")
    return None if kib is None else kib * 1024


def shared_object_bytes(pid: int) -> int | None:
    """The address space that shared objects (`.so`) take in it."""
    try:
        lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    except OSError:
        return None
    return mapped_shared_objects(lines)


def mapped_shared_objects(lines: Iterable[str]) -> int:
    """The sum over the lines of /proc/<pid>/maps that belong to shared objects."""
    total = 0
    for line in lines:
        span, *_, path = line.split(maxsplit=5)
        if _SHARED_OBJECT.search(path.removesuffix(" (deleted)")):
            start, _, end = span.partition("-")
            total += int(end, 16) - int(start, 16)
    return total


def process_cpu_s(pid: int) -> float:
    """CPU time of all its threads so far; 0 where nobody tells."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def busy_cpu_s() -> float | None:
    """CPU time that the machine has spent on anything since it started."""
    try:
        line = Path("/proc/stat").read_text().partition("\n")[0]
    except OSError:
        return None
    user, nice, system, _idle, _wait, irq, softirq, *_ = (int(field) for field in line.split()[1:])
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")


def loopback_bytes() -> int | None:
    """Bytes that the loopback of this process's network namespace has received."""
    try:
        lines = Path("/proc/self/net/dev").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split(":")[1].split()[0]) for line in lines if line.strip().startswith("lo:")), None)


def _status_number(pid: int, name: str) -> int | None:
    try:
        text = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    found = re.search(rf"^{name}:\s+(\d+)", text, re.MULTILINE)
    return int(found[1]) if found else None
