"""The desk of the twin: nodes begin later than all else, and a trial's time with the link counts from then."""

from __future__ import annotations

import asyncio
import hashlib
from pathlib import Path
from typing import Any

from edge_agent.link.frames import ControlFrame
from edge_agent.outbox import OsDisk
from edge_agent.twin.confirm import CommitConfirm
from edge_agent.twin.manager import TwinManager
from edge_agent.twin.record import Record
from edge_agent.twin.state import TwinFile
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.waiting import wait_until_async

DOCUMENT = b'{"nodes":{"radio":{"allowed":"radio"}}}'
WINDOW_S = 60.0


class Applier:
    """Lives by anything at once, but for its nodes."""

    def __init__(self) -> None:
        self.active_version = b""
        self.handed_over = False

    async def apply(self, document: bytes, *, trial: bool, known: bool = True) -> None:
        """See edge_agent.twin.apply."""
        self.active_version = document

    def reported(self) -> dict[str, Any]:
        """See edge_agent.twin.apply."""
        return {}


class World:
    """An agent's desk on a link, with a document on trial."""

    def __init__(self, folder: Path) -> None:
        self.clock, self.applier = ManualClock(), Applier()
        self.confirm = CommitConfirm(Record(), self.clock, boot_id="boot")
        self.manager = TwinManager(self.confirm, TwinFile(OsDisk(folder)), self.applier, self.clock)  # type: ignore[arg-type]
        self.manager.link_up(lambda frame: None, link_pb2.Welcome(twin=True))
        digest = hashlib.sha256(DOCUMENT).digest()
        wanted = link_pb2.TwinDesired(
            revision=1, sha256=digest, document=DOCUMENT, confirm_within_ms=int(WINDOW_S * 1000)
        )
        self.manager.take(ControlFrame(link_pb2.GatewayFrame(twin=wanted), 0.0))
        self.task = asyncio.ensure_future(self.manager.run())

    async def later(self, seconds: float) -> None:
        """Time passes, and the desk has looked at everything: without a thread, where nothing is to be kept."""
        self.clock.advance(seconds)
        self.manager.mark_changed()
        for _ in range(10):
            await asyncio.sleep(0)

    async def end(self) -> None:
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


async def test_the_link_must_live_with_nodes_that_run(tmp_path: Path) -> None:
    world = World(tmp_path)
    await wait_until_async(lambda: world.applier.active_version == DOCUMENT)
    await world.later(10 * LIMITS.twin_settle_s)
    assert world.confirm.state == "applying"  # the supervisor is slow: nothing of it has begun
    assert world.confirm.confirmed(1) == []
    world.applier.handed_over = True
    await world.later(0)
    await world.later(0.5 * LIMITS.twin_settle_s)
    assert world.confirm.state == "applying"
    await world.later(LIMITS.twin_settle_s)
    assert world.confirm.state == "confirming"
    await world.end()


async def test_nodes_that_never_begin_are_taken_back_with_the_window(tmp_path: Path) -> None:
    world = World(tmp_path)
    await wait_until_async(lambda: world.applier.active_version == DOCUMENT)
    await world.later(WINDOW_S)
    await wait_until_async(lambda: world.confirm.state == "reverted")
    assert world.applier.active_version != DOCUMENT
    assert world.confirm.why[0] == "not_confirmed"
    await world.end()
