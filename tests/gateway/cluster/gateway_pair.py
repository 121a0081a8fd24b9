"""Gateways of one store that meet over a Zenoh router, in this process."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from gateway.main import Ready
from tests.gateway.cluster.meshes import router
from tests.gateway.harness import client, running_gateway
from tests.support.ports import free_port
from tests.support.postgres import PostgresServer

__all__ = ["gateways", "until"]


@asynccontextmanager
async def gateways(
    folder: Path, postgres: PostgresServer, *each: dict[str, Any], **settings: Any
) -> AsyncIterator[list[Ready]]:
    """A gateway for each of `each` (its own settings), which have all met."""
    port = free_port()
    shared = {
        "store_url": postgres.schema(),
        "objects_url": f"file://{folder}/objects",
        "cluster": (f"tcp/127.0.0.1:{port}",),
        "master_key": folder / "key" / "master.key",
        **settings,
    }
    (folder / "key").mkdir(mode=0o700)
    with router(port):
        async with AsyncExitStack() as stack:
            ready = [
                await stack.enter_async_context(running_gateway(folder / str(number), **{**shared, **own}))
                for number, own in enumerate(each)
            ]
            for one in ready:
                await until(one, "/metrics", f"metaros_cluster_peers {len(ready) - 1}.0")
            yield ready


async def until(ready: Ready, path: str, text: str) -> None:
    """Return as soon as what a gateway answers has that text."""
    async with client(ready) as http:
        for _ in range(1000):
            if text in (said := (await http.get(path)).text):
                return
            await asyncio.sleep(0.03)
    raise AssertionError(f"{text!r} is not in {said}")
