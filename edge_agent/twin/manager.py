"""The twin of a running agent: takes what the gateway says, does what the state machine says, and reports."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from typing import Final

from edge_agent.errors import DiskError
from edge_agent.twin.apply import Applier
from edge_agent.twin.confirm import Action, Confirm, Keep, Live, Tell
from edge_agent.twin.report import Reporter
from edge_agent.twin.state import TwinFile
from edge_agent.uplink.desk import Tell as TellGateway
from edge_agent.uplink.desk import Told
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["TwinDesk"]

LOG = logging.getLogger("metaros.agent.twin")
WAITING: Final = 64  # frames and changes of the link that wait; the oldest are dropped, and told again by the gateway


class TwinDesk:
    """A desk of the link. `start` before the link, then `run`; all on the event loop, one thing after the other."""

    frames = frozenset({"twin", "twin_confirmed"})

    def __init__(
        self, confirm: Confirm, file: TwinFile, applier: Applier, clock: Clock, *, limits: Limits = LIMITS
    ) -> None:
        self._confirm = confirm
        self._file = file
        self._applier = applier
        self._inbox: deque[Callable[[], list[Action]]] = deque(maxlen=WAITING)
        self._wake = asyncio.Event()
        self._beginning = False  # what is on trial: its time with the link counts from when its nodes have begun
        self.reporter = Reporter(confirm, applier.reported, clock, limits=limits)

    # -- the link ---------------------------------------------------------------------------------------------------

    def link_up(self, tell: TellGateway, welcome: link_pb2.Welcome) -> None:
        """See LinkDesk. A gateway that does not know twins is told nothing, and says nothing."""
        self.reporter.link(tell if welcome.twin else None)
        self._put(lambda: self._confirm.link(True))

    def link_down(self) -> None:
        """See LinkDesk."""
        self.reporter.link(None)
        self._put(lambda: self._confirm.link(False))

    def take(self, told: Told) -> None:
        """See LinkDesk."""
        if told.frame.HasField("twin"):
            wanted = told.frame.twin
            window_s = wanted.confirm_within_ms / 1000
            self._put(lambda: self._confirm.desired(wanted.revision, wanted.sha256, wanted.document, window_s))
        else:
            revision = told.frame.twin_confirmed.revision
            self._put(lambda: self._confirm.confirmed(revision))

    def stir(self) -> None:
        """What is reported may have changed."""
        self.reporter.stir()
        self._wake.set()

    # -- work -------------------------------------------------------------------------------------------------------

    async def start(self, actions: list[Action]) -> None:
        """Do what the state machine said at its start; before the link comes up."""
        await self._do(actions)

    async def run(self) -> None:
        """For ever."""
        while True:
            self._wake.clear()
            while self._inbox:
                await self._do(self._inbox.popleft()())
            if self._beginning and self._applier.handed_over:
                self._beginning = False
                await self._do(self._confirm.lived())
            await self._do(self._confirm.tick())
            self.reporter.send()
            waits = [wait_s for wait_s in (self._confirm.wait_s(), self.reporter.wait_s()) if wait_s is not None]
            if self._inbox:
                continue
            try:
                async with asyncio.timeout(max(min(waits), 0.01) if waits else None):
                    await self._wake.wait()
            except TimeoutError:
                continue

    def _put(self, step: Callable[[], list[Action]]) -> None:
        self._inbox.append(step)
        self._wake.set()

    async def _do(self, actions: list[Action]) -> None:
        """One after the other; what one of them leads to comes before the rest of them."""
        waiting = deque(actions)
        while waiting:
            match waiting.popleft():
                case Keep(record):
                    try:
                        await asyncio.to_thread(self._file.keep, record)
                    except DiskError as error:
                        LOG.error("the twin's record cannot be kept: %s", error)
                        waiting = deque(self._confirm.not_kept(error.code, str(error)))
                    else:
                        self._confirm.kept(record)
                case Live(version):
                    waiting.extendleft(reversed(await self._live(version.document, version.revision)))
                case Tell():
                    self.reporter.ask()

    async def _live(self, document: bytes, revision: int) -> list[Action]:
        trial = self._confirm.record.pending is not None
        self._beginning = False
        try:
            await self._applier.live(document, trial=trial, known=self._confirm.record.seen > 0)
        except MetarosError as error:
            LOG.warning("revision %d of the twin is refused: %s", revision, error)
            return self._confirm.failed(error.code, str(error))
        except Exception as error:
            LOG.exception("revision %d of the twin", revision)
            return self._confirm.failed("twin_failed", f"{type(error).__name__}: {error}")
        if revision:  # before anybody wrote a twin there is nothing to tell
            LOG.info("the robot lives by revision %d of its twin%s", revision, ", on trial" if trial else "")
        self._beginning = trial and not self._applier.handed_over
        return [] if self._beginning else self._confirm.lived()
