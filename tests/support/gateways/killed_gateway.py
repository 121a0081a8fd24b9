"""A gateway that tests kill: starts workers by zygote and exec, each with children of its own, and prints their ids.

`python -m tests.support.gateways.killed_gateway FOLDER LEVEL...`: a line of JSON, then it waits for its end.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Sequence
from contextlib import AsyncExitStack
from itertools import product
from pathlib import Path

from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote
from tests.support.functions.sandboxed_worker import SandboxedWorker

CHILDREN = """
import os, signal
reader, writer = os.pipe()
for name in ("plain", "daemon"):
    if os.fork() == 0:
        try:
            if name == "daemon" and leaving:
                os.setsid()
        except PermissionError:
            pass
        os.write(writer, b"x")
        signal.pause()
os.close(writer)
result = len(os.read(reader, 1) + os.read(reader, 1))
"""


async def main(folder: Path, levels: Sequence[Level]) -> None:
    zygote = Zygote()
    await zygote.start()
    async with AsyncExitStack() as stack:
        keepers = []
        for level, server in product(levels, (zygote, None)):
            sandboxed = SandboxedWorker(level, folder / f"{level.name}-{server is None}", zygote=server)
            worker = await stack.enter_async_context(sandboxed)
            await worker.ask(CHILDREN, leaving=level >= Level.L2)
            keepers.append(worker.launched.root_pid)
        print(json.dumps({"zygote": zygote.pid, "keepers": keepers}), flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), [Level(int(number)) for number in sys.argv[2:]]))
