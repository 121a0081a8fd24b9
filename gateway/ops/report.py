"""A report on this process for a bug report: tasks, threads, memory, garbage; nothing that is secret."""

from __future__ import annotations

import asyncio
import gc
import os
import platform
import sys
import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

__all__ = ["as_text", "process_report", "settings_report", "task_kinds"]

_PACKAGES: Final = ("metaros", "uvicorn", "fastapi", "starlette", "grpcio", "websockets", "uvloop", "numpy", "orjson")
_HIDDEN: Final = ("store_url", "objects_url", "otlp")  # addresses may hold a password


def process_report() -> dict[str, Any]:
    """This process: versions, threads, memory and files where the system tells them."""
    return {
        "pid": os.getpid(),
        "python": platform.python_version(),
        "system": platform.platform(),
        "versions": {name: _version(name) for name in _PACKAGES},
        "threads": dict(
            sorted(Counter(thread.name.rstrip("0123456789-_") for thread in threading.enumerate()).items())
        ),
        "memory_bytes": _memory_bytes(),
        "open_files": _open_files(),
        "garbage": {"objects": gc.get_count()[0], "collections": [item["collections"] for item in gc.get_stats()]},
    }


def task_kinds(limit: int) -> list[dict[str, Any]]:
    """The event loop's tasks by what they run and where they wait, the most frequent first."""
    kinds: Counter[tuple[str, str]] = Counter()
    for task in asyncio.all_tasks():
        coroutine: Any = task.get_coro()
        kinds[getattr(coroutine, "__qualname__", type(coroutine).__name__), _place(task)] += 1
    return [{"runs": runs, "waits_at": at, "tasks": count} for (runs, at), count in kinds.most_common(limit)]


def settings_report(settings: Any) -> dict[str, str]:
    """Every setting that cannot hold a secret; of the others whether they are set."""
    facts: dict[str, str] = {}
    for item in fields(settings):
        value = getattr(settings, item.name)
        hidden = item.name in _HIDDEN or not item.repr
        facts[item.name] = ("(set)" if value else "") if hidden else str(value)
    return facts


def as_text(report: Mapping[str, Any], *, depth: int = 0) -> str:
    """The report as indented lines, for a person."""
    lines: list[str] = []
    for key, value in report.items():
        lead = "  " * depth
        if isinstance(value, Mapping):
            lines += [f"{lead}{key}:", as_text(value, depth=depth + 1)]
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            lines.append(f"{lead}{key}:")
            lines += [f"{lead}  " + "  ".join(f"{name}={item[name]}" for name in item) for item in value]
        else:
            lines.append(f"{lead}{key}: {value}")
    return "\n".join(line for line in lines if line)


def _place(task: asyncio.Task[Any]) -> str:
    stack = task.get_stack(limit=1)
    if not stack:
        return ""
    file = Path(stack[0].f_code.co_filename)
    return f"{file.parent.name}/{file.name}:{stack[0].f_lineno}"


def _kind(thread: threading.Thread) -> str:
    return thread.name.rstrip("0123456789-_")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _memory_bytes() -> int | None:
    """Resident memory, where /proc says so."""
    if sys.platform == "linux":
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    else:
        return None


def _open_files() -> int | None:
    return len(os.listdir("/proc/self/fd")) if sys.platform == "linux" else None
