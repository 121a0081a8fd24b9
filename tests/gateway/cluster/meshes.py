"""Gateways' meshes on real Zenoh routers, each with its threads, in one event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from gateway.cluster.mesh import ZenohMesh
from gateway.identity.master import MasterKey
from metaros.clock import SystemClock
from tests.support.waiting import wait_until_async

STORE = "store1"
MASTER = MasterKey(b"m" * 32)


def made(name: str, *ports: int, master: MasterKey = MASTER, store: str = STORE, **options: Any) -> ZenohMesh:
    """A mesh that has not started."""
    routers = [f"tcp/127.0.0.1:{port}" for port in ports]
    return ZenohMesh(routers, gateway_id=name, store_id=store, master=master, clock=SystemClock(), **options)


@asynccontextmanager
async def running(*meshes: ZenohMesh, met: bool = True) -> AsyncIterator[None]:
    """They run, and have all met."""
    for mesh in meshes:
        mesh.start()
    tasks = [asyncio.create_task(mesh.run()) for mesh in meshes]
    try:
        if met:
            await all_met(meshes)
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for mesh in meshes:
            await mesh.close()


async def all_met(meshes: Sequence[ZenohMesh]) -> None:
    """Wait until each has all the others as its peers."""
    names = {mesh.gateway_id for mesh in meshes}
    await wait_until_async(lambda: all(mesh.peers() == names - {mesh.gateway_id} for mesh in meshes))
