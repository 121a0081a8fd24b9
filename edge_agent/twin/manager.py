"""The twin of a running agent: receives documents, executes the state machine's actions, and reports."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from typing import Final

from edge_agent.errors import DiskError
from edge_agent.link.frames import ControlFrame
from edge_agent.link.handler import SendFrame
from edge_agent.twin.apply import Applier
from edge_agent.twin.confirm import Action, Apply, CommitConfirm, Persist, Report
from edge_agent.twin.report import Reporter
from edge_agent.twin.state import TwinFile
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["TwinManager"]

LOG = logging.getLogger("metaros.agent.twin")
WAITING: Final = 64  # frames and changes of the link that wait; the oldest are dropped, and sent again by the gateway


class TwinManager:
    """A ControlHandler. `start` before the link, then `run`; all on the event loop, one thing after the other."""

    frames = frozenset({"twin", "twin_confirmed"})

    def __init__(
        self, confirm: CommitConfirm, file: TwinFile, applier: Applier, clock: Clock, *, limits: Limits = LIMITS
    ) -> None:
        self._confirm = confirm
        self._file = file
        self._applier = applier
        self._inbox: deque[Callable[[], list[Action]]] = deque(maxlen=WAITING)
        self._wake = asyncio.Event()
        self._beginning = False  # what is on trial: its time with the link counts from when its nodes have begun
        self.reporter = Reporter(confirm, applier.reported, clock, limits=limits)

    # -- the link ---------------------------------------------------------------------------------------------------

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """See ControlHandler. A gateway that does not know twins is sent nothing, and sends nothing."""
        self.reporter.link(send if welcome.twin else None)
        self._put(lambda: self._confirm.link(True))

    def link_down(self) -> None:
        """See ControlHandler."""
        self.reporter.link(None)
        self._put(lambda: self._confirm.link(False))

    def take(self, received: ControlFrame) -> None:
        """See ControlHandler."""
        if received.frame.HasField("twin"):
            wanted = received.frame.twin
            window_s = wanted.confirm_within_ms / 1000
            self._put(lambda: self._confirm.desired(wanted.revision, wanted.sha256, wanted.document, window_s))
        else:
            revision = received.frame.twin_confirmed.revision
            self._put(lambda: self._confirm.confirmed(revision))

    def mark_changed(self) -> None:
        """What is reported may have changed."""
        self.reporter.mark_changed()
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
                await self._do(self._confirm.applied())
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
                case Persist(record):
                    try:
                        await asyncio.to_thread(self._file.keep, record)
                    except DiskError as error:
                        LOG.error("the twin's record cannot be kept: %s", error)
                        waiting = deque(self._confirm.persist_failed(error.code, str(error)))
                    else:
                        self._confirm.persisted(record)
                case Apply(version):
                    waiting.extendleft(reversed(await self._live(version.document, version.revision)))
                case Report():
                    self.reporter.ask()

    async def _live(self, document: bytes, revision: int) -> list[Action]:
        trial = self._confirm.record.pending is not None
        self._beginning = False
        try:
            await self._applier.apply(document, trial=trial, known=self._confirm.record.seen > 0)
        except MetarosError as error:
            LOG.warning("revision %d of the twin is refused: %s", revision, error)
            return self._confirm.apply_failed(error.code, str(error))
        except Exception as error:
            LOG.exception("revision %d of the twin", revision)
            return self._confirm.apply_failed("twin_failed", f"{type(error).__name__}: {error}")
        if revision:  # before anybody wrote a twin there is nothing to log
            LOG.info("revision %d of the robot's twin is in force%s", revision, ", on trial" if trial else "")
        self._beginning = trial and not self._applier.handed_over
        return [] if self._beginning else self._confirm.applied()
