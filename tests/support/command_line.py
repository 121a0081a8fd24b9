"""`metaros …` as a process that runs to its end, for tests that wait for it and for those in an event loop."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from pathlib import Path

__all__ = ["ask_metaros", "run_metaros"]

END_S = 120


def run_metaros(*arguments: str) -> str:
    """What it printed; it has to end well."""
    done = subprocess.run(
        [sys.executable, "-m", "metaros", *arguments],
        capture_output=True,
        text=True,
        timeout=END_S,
        env={**os.environ, "NO_COLOR": "1"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


async def ask_metaros(
    *arguments: str, folder: Path | None = None, stdin: str = "", **environ: str
) -> tuple[int, str, str]:
    """Its exit code, standard output and standard error."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "metaros", *arguments),
        cwd=folder,
        env={**os.environ, **environ},
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        async with asyncio.timeout(END_S):
            out, err = await process.communicate(stdin.encode())
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    return process.returncode or 0, out.decode(), err.decode()
