"""Our engine in this process, without a gateway: calls, workers' cold starts and what a worker holds of memory."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from load_tests.functions.figures import Calls
from metaros.automation.functions.calls import FunctionSpec, Invocation
from metaros.automation.functions.engine import Engine
from metaros.clock import SystemClock

__all__ = ["call_engine", "cold_starts", "running_engine", "spec_of", "worker_bytes"]

_numbers = itertools.count(1)


@asynccontextmanager
async def running_engine(folder: Path, *, warm_start: bool = True) -> AsyncIterator[Engine]:
    """The engine at the highest level that this machine has; `warm_start` forks workers from a ready interpreter."""
    engine = Engine(folder, clock=SystemClock(), warm_start=warm_start)
    await engine.start()
    try:
        yield engine
    finally:
        await engine.close()


def spec_of(code: Path, *, workers: int = 1) -> FunctionSpec:
    """The function of `app.py` in a folder, with a pool of its own."""
    return FunctionSpec(
        key=f"bench-{next(_numbers)}",
        name="bench",
        version="$LATEST",
        arn="arn:aws:lambda:local:000000000000:function:bench",
        handler="app.handler",
        code_dir=code,
        timeout_s=30.0,
        max_workers=workers,
    )


def _call() -> Invocation:
    return Invocation(request_id=f"r{next(_numbers)}", payload=b'{"n":1}')


async def call_engine(engine: Engine, spec: FunctionSpec, count: int, *, at_once: int = 1) -> Calls:
    """Calls by `at_once` callers; the first ones, which start the workers, are not counted."""
    await asyncio.gather(*(engine.invoke(spec, _call()) for _ in range(at_once)))
    took: list[float] = []
    failed = 0

    async def caller() -> None:
        nonlocal failed
        for _ in range(count // at_once):
            start = time.perf_counter()
            outcome = await engine.invoke(spec, _call())
            if outcome.ok:
                took.append((time.perf_counter() - start) * 1000)
            else:
                failed += 1

    began = time.perf_counter()
    await asyncio.gather(*(caller() for _ in range(at_once)))
    return Calls(tuple(took), failed, time.perf_counter() - began)


async def cold_starts(engine: Engine, code: Path, count: int) -> list[float]:
    """ms from a worker's start to its readiness (`init_ms`), each of a new pool."""
    found = []
    for _ in range(count):
        spec = spec_of(code)
        outcome = await engine.invoke(spec, _call())
        assert outcome.ok, outcome
        found.append(outcome.init_ms)
        await engine.retire(spec.key)
    return found


def worker_bytes(pid: int) -> dict[str, int]:
    """Rss, Pss (shared pages counted in parts) and private bytes of a process."""
    found = {"Rss": 0, "Pss": 0, "Private_Clean": 0, "Private_Dirty": 0}
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        name, _, rest = line.partition(":")
        if name in found:
            found[name] = int(rest.split()[0]) * 1024
    return {"rss": found["Rss"], "pss": found["Pss"], "private": found["Private_Clean"] + found["Private_Dirty"]}
