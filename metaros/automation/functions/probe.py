"""Which sandbox levels this machine has: each is tried by starting a worker in it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import platform
import sys
import tempfile
import threading
from pathlib import Path

from metaros.automation.functions.launch import launch
from metaros.automation.functions.program import Confinement, Program
from metaros.automation.functions.sandbox import landlock
from metaros.automation.functions.sandbox.calls import CALLS
from metaros.automation.functions.sandbox.level import Level, Probe, check
from metaros.errors import LaunchError
from metaros.limits import LIMITS

__all__ = ["probe", "require"]

LANDLOCK_LEAST = 6  # the first that keeps signals inside, which L2 has nothing else for
OK = "ok"
_once = threading.Lock()
_known: list[Probe] = []


def probe(*, fresh: bool = False) -> Probe:
    """Try every level; remembered for this process. Blocks for some tenths of a second: not for the event loop."""
    with _once:
        if fresh or not _known:
            _known[:] = [asyncio.run(_probe())]
        return _known[0]


def require(least: Level) -> Probe:
    """The probe; SandboxError where it is below `least`."""
    found = probe()
    check(found, least)
    return found


async def _probe() -> Probe:
    reasons = {level: await _try(level) for level in Level}
    best = max(level for level in Level if reasons[level] == OK or level is Level.L0)
    return Probe(level=best, reasons=reasons, facts=_facts(best))


async def _try(level: Level) -> str:
    if refused := _lacking(level):
        return refused
    with tempfile.TemporaryDirectory(prefix="metaros-probe-") as folder:
        program, confinement = _nothing(Path(folder), level)
        try:
            launched = await launch(program, confinement)
        except (LaunchError, OSError) as error:
            return str(error)
        try:
            async with asyncio.timeout(LIMITS.function_launch_s):
                status = await launched.wait()
        except TimeoutError:
            return f"a worker that does nothing did not end within {LIMITS.function_launch_s} s"
        finally:
            launched.close()
    return OK if status == 0 else f"a worker that does nothing ended with {status}"


def _nothing(folder: Path, level: Level) -> tuple[Program, Confinement]:
    """A program without code, in a folder that others may read."""
    code = folder / "code"
    code.mkdir()
    code.chmod(0o755)
    program = Program(handler="none.none", code_dir=code, entry="none")
    return program, Confinement(level=level, tmp_dir=folder / "tmp")


def _lacking(level: Level) -> str:
    """What is known to be missing without a try; "" where it is worth one."""
    if level is Level.L0 or (level is Level.L1 and sys.platform != "win32"):
        return ""
    if sys.platform != "linux":
        return f"{level.name} is Linux's" if level > Level.L1 else "this system has no limits of processes"
    if platform.machine() not in CALLS:
        return f"no table of system calls for {platform.machine()}"
    if level is Level.L2 and (version := landlock.abi()) < LANDLOCK_LEAST:
        has = f"has Landlock ABI {version}" if version else "has no Landlock"
        return f"the kernel {has}; ABI {LANDLOCK_LEAST} is needed (Linux 6.12)"
    return ""


def _facts(best: Level) -> dict[str, str]:
    facts = {"system": f"{platform.system()} {platform.release()} {platform.machine()}"}
    if sys.platform != "linux":
        return facts
    version = landlock.abi()
    facts["landlock"] = f"ABI {version}" if version else "none"
    facts["started as"] = "root" if os.geteuid() == 0 else f"user {os.geteuid()}"
    if best is Level.L3:
        also = " and Landlock" if version else ", without Landlock"
        facts["files"] = f"an own root of read-only mounts{also}"
        facts["user"] = "an own one of each worker" if os.geteuid() == 0 else "the gateway's, in a user namespace"
    with contextlib.suppress(OSError):
        facts["user namespaces"] = Path("/proc/sys/user/max_user_namespaces").read_text().strip()
    return facts
