"""Engines and functions for tests: a handler's source in, its outcome out."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.engine import Engine
from metaros.automation.functions.pool import PoolStatus
from metaros.automation.functions.sandbox.level import Level
from metaros.clock import SystemClock
from metaros.limits import LIMITS, Limits

__all__ = ["Bench", "alive", "running_engine"]

_numbers = itertools.count(1)


class Bench:
    """An engine, and functions for it."""

    def __init__(self, engine: Engine, folder: Path, entry: str) -> None:
        self.engine, self.folder, self.entry = engine, folder, entry

    def spec(self, source: str, *, handler: str = "app.handler", **options: Any) -> FunctionSpec:
        """A function of one module, `app.py`."""
        number = next(_numbers)
        code = self.folder / f"code{number}"
        code.mkdir()
        (code / "app.py").write_text(source)
        given = {"key": f"f{number}", "name": f"f{number}", "version": "$LATEST", "memory_mb": 128, "timeout_s": 20.0}
        arn = f"arn:aws:lambda:local:000000000000:function:f{number}"
        return FunctionSpec(**(given | {"arn": arn, "handler": handler, "code_dir": code} | options))

    @cached_property
    def shared(self) -> Path:
        """A folder where workers, which are other users, write too: pytest's own folders are closed to them."""
        folder = Path(tempfile.mkdtemp(prefix="metaros-functions-"))
        folder.chmod(0o777)
        return folder

    def pool(self, spec: FunctionSpec) -> PoolStatus:
        """The function's workers."""
        (found,) = (pool for pool in self.engine.status().pools if pool.key == spec.key)
        return found

    async def invoke(self, spec: FunctionSpec, payload: object = None, **options: Any) -> Outcome:
        """Call it; what is no bytes is sent as JSON."""
        body = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        options.setdefault("request_id", f"request-{next(_numbers)}")
        return await self.engine.invoke(spec, Invocation(payload=body, **options))

    async def returned(self, spec: FunctionSpec, payload: object = None, **options: Any) -> Any:
        """What the function returned, which it must."""
        outcome = await self.invoke(spec, payload, **options)
        assert outcome.ok, (outcome.error_type, outcome.payload, outcome.log)
        return json.loads(outcome.payload)

    async def stream(self, spec: FunctionSpec, payload: object = None) -> tuple[bytes, Outcome]:
        """All pieces of a streamed answer, and its outcome."""
        pieces = bytearray()
        call = Invocation(request_id=f"request-{next(_numbers)}", payload=json.dumps(payload).encode())
        async for piece in self.engine.stream(spec, call):
            if isinstance(piece, Outcome):
                return bytes(pieces), piece
            pieces += piece
        raise AssertionError("a stream without an outcome")


@asynccontextmanager
async def running_engine(
    folder: Path, *, entry: str = "metaros", level: Level | None = Level.L1, limits: Limits = LIMITS, **options: Any
) -> AsyncIterator[Bench]:
    """An engine; at its end no process of it may be left."""
    engine = Engine(folder / "engine", clock=SystemClock(), level=level, entry=entry, limits=limits, **options)
    await engine.start()
    bench = Bench(engine, folder, entry)
    try:
        yield bench
    finally:
        await engine.close()
        if "shared" in vars(bench):
            shutil.rmtree(bench.shared)


def alive(pid: int) -> bool:
    """Whether the process runs."""
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (OSError, IndexError):
        return False
