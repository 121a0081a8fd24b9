"""Start a worker in a new interpreter; where workers come often, a `Zygote` has them sooner."""

from __future__ import annotations

import asyncio
import os
import sys

from metaros.automation.functions.plain_process import launch_plain
from metaros.automation.functions.program import Confinement, Program
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.worker_process import Usage, WorkerProcess
from metaros.automation.functions.zygote import Zygote, zygote_works
from metaros.errors import LaunchError

__all__ = ["Confinement", "Program", "Usage", "WorkerProcess", "launch"]


async def launch(program: Program, confinement: Confinement) -> WorkerProcess:
    """A new worker, up and confined as `confinement.level` says. LaunchError where that cannot be.

    On Linux it is the only worker of a fork server of its own; elsewhere, and at L0, a plain process. Never root: on
    Linux root's L0 is as L1, elsewhere root is refused.
    """
    if not zygote_works() and _is_root():
        raise LaunchError("functions do not run as root: start the gateway as another user")
    if not zygote_works() or (confinement.level is Level.L0 and not _is_root()):
        return await launch_plain(program, confinement)
    server = Zygote(preload=(), once=True)
    server.spawn()
    try:
        launched = await server.fork(program, confinement)
    except BaseException:
        await server.close()
        raise
    launched.ended = asyncio.ensure_future(_take_leave(server, launched.ended))
    return launched


async def _take_leave(server: Zygote, ended: asyncio.Future[int]) -> int:
    """Its fork server ends after it, and is taken from the kernel."""
    status = await ended
    await server.close()
    return status


def _is_root() -> bool:
    if sys.platform == "win32":
        return False
    return os.geteuid() == 0
