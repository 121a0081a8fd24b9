"""A gateway that is no root, and a worker that tries to get at it.

`python -m tests.support.gateways.plain_gateway FOLDER LEVEL...`
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from metaros.automation.functions.probe import probe
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote
from tests.support.functions.sandboxed_worker import CagedError, SandboxedWorker, listening
from tests.support.waiting import wait_until_async

TRY = """
def tried(f, *a):
    try:
        return f(*a)
    except OSError as error:
        import errno
        return errno.errorcode.get(error.errno, str(error))
"""
ATTACKS = (
    TRY
    + """
import ctypes, os, socket
libc = ctypes.CDLL(None, use_errno=True)
header, data = (ctypes.c_uint * 2)(0x20080522, 0), (ctypes.c_uint * 6)()
assert libc.capget(header, data) == 0
def unshare():
    if libc.unshare(0x10000000) < 0:
        raise OSError(ctypes.get_errno(), "")
    return "done"
def tcp():
    socket.create_connection(("127.0.0.1", port), timeout=5).close()
    return "open"
result = dict(uids=os.getresuid(), caps=list(data), secret=tried(lambda: open(secret).read()),
    environ=tried(lambda: open(f"/proc/{gateway}/environ").read()), victim_tmp=tried(os.listdir, victim_tmp),
    kill=tried(os.kill, gateway, 0), kill_victim=tried(os.kill, victim, 0), tcp=tried(tcp),
    unshare=tried(unshare) if walled else "")
"""
)
BOMB = """
import os, signal
result = 0
try:
    while result < 500:
        if os.fork() == 0:
            signal.pause()
        result += 1
except BlockingIOError:
    pass
"""


async def attacked(level: Level, folder: Path) -> dict[str, Any]:
    """What the worker got."""
    found: dict[str, Any] = {"probe": (await asyncio.to_thread(probe)).reasons[level]}
    await asyncio.to_thread(folder.mkdir)
    (folder / "secret").write_text("s3cret")
    zygote = Zygote()
    await zygote.start()
    with listening() as tcp:
        async with (
            SandboxedWorker(level, folder / "one", zygote=zygote, processes=16) as one,
            SandboxedWorker(level, folder / "two") as two,
        ):
            found |= await one.ask(
                ATTACKS,
                secret=str(folder / "secret"),
                gateway=os.getpid(),
                victim=two.launched.pid,
                victim_tmp=str(two.tmp_dir),
                port=tcp.getsockname()[1],
                walled=level >= Level.L2,
            )
            found["answer"] = await two.ask("result = 6 * 7")
            try:
                found["memory"] = await two.ask("result = len(bytearray(600 << 20))")
            except CagedError as error:
                found["memory"] = error.kind
            found["children"] = await one.ask(BOMB)
    await zygote.close()
    await wait_until_async(lambda: own_processes() == [os.getpid()])  # they count for the next worker's limit
    return found


def own_processes() -> list[int]:
    """All of this user."""
    pids = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if entry.stat().st_uid == os.getuid():
                pids.append(int(entry.name))
    return pids


async def main(folder: Path, levels: Sequence[Level]) -> None:
    try:
        print(json.dumps({level.name: await attacked(level, folder / level.name) for level in levels}))
    except PermissionError as error:  # seen once, and never explained: which folder on the way was closed, and to whom
        print(*_way(Path(str(error.filename))), sep="\n", file=sys.stderr)
        raise


def _way(path: Path) -> list[str]:
    """Who owns each folder above it, and what others may do there."""
    lines = [Path("/proc/self/mountinfo").read_text()]
    for part in reversed(path.parents):
        with suppress(OSError):
            found = part.stat()
            lines.append(f"{found.st_mode:o} {found.st_uid} {part}")
    return lines


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), [Level(int(number)) for number in sys.argv[2:]]))
