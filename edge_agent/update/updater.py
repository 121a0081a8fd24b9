"""The agent's own version: fetched, checked, installed beside the one that runs, tried, kept or taken back.

Its state is in the slots alone, so that no crash can leave two opinions. A version that was taken back
is not tried again until another one was kept. Everything up to the switch may end at any instruction: what ran still
runs.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random  # noqa: TID251 - the type only; the generator is an argument
from collections.abc import Callable
from typing import Any

from edge_agent.link.frames import ControlFrame
from edge_agent.link.handler import SendFrame
from edge_agent.update.daemon import in_daemon
from edge_agent.update.environment import make_environment
from edge_agent.update.errors import SlotError, UpdateError, UpdateFetchError, UpdateOffError, UpdateUnhealthyError
from edge_agent.update.health import Health
from edge_agent.update.restart import LoaderInfo
from edge_agent.update.slots import BASE, Slots
from edge_agent.update.source import Source
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.fleet.bundle import AGENT, BundleError

__all__ = ["AgentUpdates"]

LOG = logging.getLogger("metaros.agent.update")
FIRST_RETRY_S, LAST_RETRY_S = 15.0, 3600.0
NO_LOADER = "its agent was started without metaros agent-slot: it cannot be updated"


class AgentUpdates:
    """`await want(version)` at any time; `reported()` is sent to the gateway, `changed` is called when it changes.

    `running` is the version of this very program; `restart()` ends it, so that the loader starts what is now wanted.
    """

    frames: frozenset[str] = frozenset()

    def __init__(
        self,
        slots: Slots,
        source: Source | None,
        clock: Clock,
        rng: random.Random,
        *,
        loader_info: LoaderInfo | None,
        running: str,
        restart: Callable[[], None],
    ) -> None:
        self.changed: Callable[[], None] = lambda: None
        self._slots = slots
        self._source = source
        self._clock = clock
        self._rng = rng
        self._loaded = loader_info
        self._restart = restart
        self._wanted = ""
        self._kick = asyncio.Event()
        self._moved = asyncio.Event()
        current = slots.read() if loader_info is not None else None
        self._running = (current.version if current is not None else "") or running
        self._slot = current.slot if current is not None else ""
        self._failed = current.failed_version if current is not None else ""
        self._health: Health | None = None
        if loader_info is None:
            self._reported_state = ("off", "", UpdateOffError.code, NO_LOADER)
        elif current is not None and current.probing:
            self._reported_state = ("trying", current.version, "", "")
            now_s = clock.monotonic_s()
            self._health = Health(now_s, window_s=loader_info.health_s, within_s=loader_info.link_s)
        elif current is not None and current.failed_version:
            self._reported_state = (
                "rolled_back",
                current.failed_version,
                UpdateUnhealthyError.code,
                current.failed_reason,
            )
        else:
            self._reported_state = (
                ("healthy", current.version, "", "") if current and current.version else ("idle", "", "", "")
            )

    def reported(self) -> dict[str, Any]:
        """Section `agent` of the twin's reported document."""
        update = dict(zip(("state", "version", "code", "message"), self._reported_state, strict=True))
        return {"version": self._running, "slot": self._slot, "update": update}

    async def want(self, version: str | None) -> None:
        """Be that version; None or "": whatever runs. What runs by its name: what was taken back may be tried again."""
        self._wanted = version or ""
        if self._wanted and self._loaded is None:
            off = self._wanted != self._running
            self._report("refused" if off else "off", self._wanted if off else "", UpdateOffError.code, NO_LOADER)
        elif self._wanted == self._running and self._reported_state[0] in ("refused", "downloading", "rolled_back"):
            self._failed = ""
            self._report("idle" if self._slot == BASE else "healthy", self._running)
        self._kick.set()

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """The gateway has welcomed all lanes of this robot, which is all that it confirms."""
        if self._source is not None and welcome.fetch_token:
            self._source.token = welcome.fetch_token
            self._kick.set()
        if self._health is not None:
            self._health.linked(self._clock.monotonic_s())
            self._health.confirmed()
            self._moved.set()

    def take(self, received: ControlFrame) -> None:
        """No frame is meant for it."""

    def link_down(self) -> None:
        """The link ended."""
        if self._health is not None:
            self._health.lost()
            self._moved.set()

    async def run(self) -> None:
        """Until cancelled."""
        if self._health is not None:
            await self._prove(self._health)
        retry_s = FIRST_RETRY_S
        while True:
            self._kick.clear()
            version = self._wanted
            if self._due(version) and not await self.attempt(version):
                wait_s, retry_s = retry_s * self._rng.uniform(0.8, 1.2), min(2 * retry_s, LAST_RETRY_S)
            else:
                wait_s, retry_s = None, FIRST_RETRY_S
            try:
                async with asyncio.timeout(wait_s):
                    await self._kick.wait()
            except TimeoutError:
                continue
            if self._wanted != version:
                retry_s = FIRST_RETRY_S

    async def attempt(self, version: str) -> bool:
        """Fetch, install and switch to that version; whether the loader is to start it now."""
        loop = asyncio.get_running_loop()

        def report(state: str) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._report, state, version)

        try:
            await in_daemon(lambda: self.install(version, report=report))
        except (UpdateError, BundleError) as error:
            waits = isinstance(error, UpdateFetchError)  # it is tried again, and nothing was wrong with it
            LOG.warning("version %s is not installed: %s", version, error)
            self._report("downloading" if waits else "refused", version, error.code, str(error))
            return False
        LOG.info("version %s is installed in slot %s; it starts now", version, self._slots.read().slot)
        self._restart()
        return True

    def install(
        self,
        version: str,
        step: Callable[[str], object] = lambda name: None,
        *,
        report: Callable[[str], None] = lambda state: None,
    ) -> None:
        """All of it, blocking, on any thread. Raises UpdateError, and has changed nothing that runs then."""
        source, what = self._source, {"kind": "agent", "name": AGENT, "version": version}
        if source is None:
            raise UpdateOffError("this robot is not enrolled, and takes no updates")
        report("downloading")
        step("downloading")
        with source.bundle(**what) as fetched:
            report("staged")
            step("verified")
            folder = self._slots.empty_one()
            step("emptied")
            manifest = source.unpack(fetched, folder, **what)
            step("unpacked")
            make_environment(folder)
            step("installed")
            facts = {"version": version, "min_version": manifest.min_version, "hashes": fetched.target.hashes}
            self._slots.seal(folder, facts)
        step("sealed")
        self._slots.switch(folder, version)
        step("switched")

    def _due(self, version: str) -> bool:
        if not version or self._loaded is None or version == self._running:
            return False
        return version != self._failed

    async def _prove(self, health: Health) -> None:
        """Until this version is kept; or is taken back, and the loader asked to start the other one."""
        while (verdict := health.verdict(self._clock.monotonic_s())) == "waiting":
            self._moved.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(health.wait_s(self._clock.monotonic_s())):
                    await self._moved.wait()
        self._health = None
        current = self._slots.read()
        if verdict == "healthy":
            await asyncio.to_thread(self._keep)
            self._report("healthy", self._running)
            LOG.info("version %s did well, and is kept", self._running)
            return
        LOG.error("version %s is taken back: %s", self._running, health.reason)
        self._report("rolled_back", self._running, UpdateUnhealthyError.code, health.reason)
        await asyncio.to_thread(self._slots.roll_back, current, health.reason)
        self._restart()

    def _keep(self) -> None:
        """Keep it, and its minimum version. A disk that refuses leaves it on trial: the next start tries again."""
        try:
            self._slots.mark_good()
            if self._source is not None:
                self._source.minimum.raise_to(AGENT, self._slots.minimum_of(self._slot))
        except SlotError as error:
            LOG.error("%s", error)

    def _report(self, state: str, version: str, code: str = "", message: str = "") -> None:
        new = (state, version, code, message[:500])
        if new != self._reported_state:
            self._reported_state = new
            self.changed()
