"""The report for a bug: what runs and where it waits, settings without what may be secret, and the same as text."""

from __future__ import annotations

import asyncio
import os
from dataclasses import dataclass, field

from gateway.ops.report import as_text, process_report, settings_report, task_kinds


@dataclass(frozen=True)
class Chosen:
    """Some settings."""

    host: str = "127.0.0.1"
    store_url: str = "postgresql://me:hunter2@db/x"
    objects_url: str = ""
    token: str = field(default="hunter2", repr=False)


async def waiting(event: asyncio.Event) -> None:
    await event.wait()


def test_settings_that_may_hold_a_secret_only_say_whether_they_are_set() -> None:
    assert settings_report(Chosen()) == {
        "host": "127.0.0.1",
        "store_url": "(set)",
        "objects_url": "",
        "token": "(set)",
    }


async def test_tasks_are_counted_by_what_they_run_and_where_they_wait() -> None:
    event = asyncio.Event()
    tasks = [asyncio.create_task(waiting(event)) for _ in range(50)]
    await asyncio.sleep(0)
    kinds = task_kinds(100)
    assert kinds[0]["runs"] == "waiting"
    assert kinds[0]["tasks"] == 50
    assert kinds[0]["waits_at"].startswith("ops/test_report.py:")
    assert len(task_kinds(1)) == 1
    event.set()
    await asyncio.gather(*tasks)


def test_the_process_and_its_text() -> None:
    report = process_report()
    assert report["pid"] == os.getpid()
    assert report["threads"]["MainThread"] == 1
    assert report["versions"]["grpcio"]
    text = as_text({"process": report, "tasks": [{"runs": "a", "tasks": 2}], "none": [], "empty": {}})
    assert f"  pid: {os.getpid()}" in text.splitlines()
    assert "  runs=a  tasks=2" in text.splitlines()
