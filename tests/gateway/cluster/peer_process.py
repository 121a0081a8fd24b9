"""A gateway's mesh in a process of its own, for tests that kill it; its argument is the router's port."""

from __future__ import annotations

import asyncio
import os
import sys

from gateway.cluster.transport import Timeouts
from tests.gateway.cluster.meshes import made, running


async def main(port: int) -> None:
    """Until it is killed."""
    mesh = made("b", port, patience=Timeouts(lease_s=1.0))

    async def pid(_sender: str, _payload: bytes) -> bytes:
        return str(os.getpid()).encode()

    async def never(_sender: str, _payload: bytes) -> bytes:
        await asyncio.Event().wait()
        return b""

    mesh.on_request("pid", pid)
    mesh.on_request("never", never)
    async with running(mesh, met=False):
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1])))
