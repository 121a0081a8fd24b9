"""A gateway to be killed: starts workers by a zygote and by exec, each with children of its own, and tells their ids.

`python -m tests.support.doomed_gateway LEVEL FOLDER`: a line of JSON, then it waits for its end.
"""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path

from metaros.functions.sandbox.level import Level
from metaros.functions.zygote import Zygote
from tests.support.caged import Caged

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


async def main(level: Level, folder: Path) -> None:
    zygote = Zygote()
    await zygote.start()
    async with Caged(level, folder / "one", zygote=zygote) as one, Caged(level, folder / "two") as two:
        for worker in (one, two):
            await worker.ask(CHILDREN, leaving=level >= Level.L2)
        print(json.dumps({"zygote": zygote.pid, "keepers": [w.launched.root_pid for w in (one, two)]}), flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(Level(int(sys.argv[1])), Path(sys.argv[2])))
