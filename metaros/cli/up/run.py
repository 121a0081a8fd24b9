"""`metaros up` at work: decide, start in stages, wait until all answers, watch, stop.

One event loop; the supervisor's events and the signals arrive on it. Every wait ends early when the user asks to stop
or when a process cannot be kept alive.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from metaros.cli.shared import instances
from metaros.cli.shared.instances import Instance, StateFile
from metaros.cli.up import local_access, ready
from metaros.cli.up.enrol import enrol_robots
from metaros.cli.up.launch_table import GATEWAY, Plan, launches
from metaros.cli.up.planning import UpOptions, claim, lost_ports, make_plan
from metaros.cli.up.viewer_links import foxglove_page, make_ticket, viewer_ports
from metaros.clock import Clock
from metaros.concurrency.signals import on_stop
from metaros.errors import PeerError, UnavailableError
from metaros.supervise import Event, EventKind, Exit, Supervisor

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

    from metaros.cli.up.screen import Screen

__all__ = ["run"]

STARTS = 3  # a port that was free may be somebody else's by the time that our process opens it
START_TIMEOUT_S = 60.0
STOP_GRACE_S = 4.4  # all is over within 5 s
REPLICAS_GRACE_S = 15.0  # several gateways hand over what they have, at once and on one machine
WRONG = Exit(code=2).reason  # what a program says that was started wrongly: the next start would be as wrong
GIVE_UP_AFTER = 3  # a process that dies so often before all is ready will not get there


class StopRequestedError(PeerError):
    """The user asked to stop before all was ready."""

    code = "stopped"


class PortLostError(PeerError):
    """A port that we chose was taken before our process had it: others will do."""

    code = "port_lost"

    def __init__(self, ports: list[int]) -> None:
        taken = " and ".join(f"port {port}" for port in ports)
        super().__init__(f"{taken} was taken meanwhile: starting again with others")
        self.ports = ports


async def run(options: UpOptions, screen: Screen, *, clock: Clock, rng: Random) -> None:
    """Start everything, stay until asked to stop, leave nothing behind."""
    data = instances.open_data_dir(options.data_dir)
    if data.note:
        screen.note(data.note)
    state = StateFile()
    try:
        lost: list[int] = []
        for starts_left in reversed(range(STARTS)):
            with instances.claim_lock():
                state.withdraw()
                plan = make_plan(options, data, screen, lost=lost)
                claimed = claim(plan, clock)
                state.write(claimed)
            look = partial(lost_ports, options, plan) if starts_left else None
            again = await _Up(plan, claimed, state, screen, clock=clock, rng=rng, lost=look).run()
            if not again:
                break
            lost += again
    finally:
        state.close()
        data.lock.close()


class _Up:
    """One run: its supervisor, what it has shown, and what went wrong."""

    def __init__(
        self,
        plan: Plan,
        claim: Instance,
        state: StateFile,
        screen: Screen,
        *,
        clock: Clock,
        rng: Random,
        lost: Callable[[str, Sequence[str]], list[int]] | None,
    ) -> None:
        """`lost` says which ports a process, by its last words, did not get although we chose them; None: that is an
        error as any other.
        """
        self._plan = plan
        self._claim = claim
        self._state = state
        self._screen = screen
        self._clock = clock
        self._lost = lost
        self._rows = launches(plan)
        self._stop = asyncio.Event()
        self._broken = asyncio.Event()
        self._broken_name = ""
        self._ready = False
        self._deaths: Counter[str] = Counter()
        self._supervisor = Supervisor(clock=clock, rng=rng, on_event=self._on_event)

    async def run(self) -> list[int]:
        """The whole life; the ports that were lost before all was ready, where it is to start again with others."""
        on_stop(asyncio.get_running_loop(), self._ask_stop, hangup=True)
        began, lost = self._clock.monotonic_s(), list[int]()
        try:
            await self._start()
            self._ready = True
            foxglove, rosbridge = viewer_ports(self._plan.status_file("gateway"))
            self._claim = replace(self._claim, foxglove_port=foxglove, rosbridge_port=rosbridge)
            self._save("ready")
            link = await asyncio.to_thread(local_access.sign_in_link, self._plan)
            page = await asyncio.to_thread(self._viewer_page, foxglove)
            self._screen.ready(self._plan, self._clock.monotonic_s() - began, link, page)
            await self._stop.wait()
        except StopRequestedError:
            pass
        except PortLostError as error:
            self._screen.note(str(error))
            lost = error.ports
        finally:
            await self._end(again=bool(lost))
        return [] if self._stop.is_set() else lost

    def _viewer_page(self, port: int) -> str:
        """The link that opens Foxglove here; "" where it has no port."""
        url, ca = self._plan.url, self._plan.root_file
        ticket = make_ticket(url, key=local_access.local_key(self._plan), ca=ca) if port else ""
        return foxglove_page(url, port, ticket) if port else ""

    def _ask_stop(self) -> None:
        """The first request ends all in order, a second one at once."""
        if self._stop.is_set():
            self._supervisor.kill()
        self._stop.set()

    async def _end(self, *, again: bool) -> None:
        self._ready = False
        if not again:
            self._save("stopping")
            self._screen.stopping()
        await self._supervisor.stop(grace_s=REPLICAS_GRACE_S if self._plan.replicas else STOP_GRACE_S)
        local_access.revoke_access(self._plan)
        if not again or self._stop.is_set():
            self._screen.stopped()

    async def _start(self) -> None:
        plan = self._plan
        plan.run_dir.mkdir(parents=True, exist_ok=True)
        for path in plan.run_dir.glob("*.json"):  # of an earlier life
            path.unlink()
        rows = self._rows
        self._supervisor.start(row for row in rows if row.stage <= GATEWAY)
        if plan.own_router:
            await self._step("router", lambda: ready.ready_file(plan.status_file("router")))
        await self._step("gateway", self._gateway_ready)
        if fault := local_access.grant_access(plan):
            self._screen.note(fault)
        if plan.tls:
            self._screen.progress("gateway", "enrolling this instance's robots")
            await self._first(enrol_robots(plan))
        self._supervisor.start(row for row in rows if row.stage > GATEWAY)
        if plan.robots:
            await self._step("simulator", lambda: ready.ready_file(plan.status_file("sim")))
        if plan.robot_names:
            await self._step("robots", self._all_online)

    def _gateway_ready(self) -> bool:
        urls = (self._plan.url, *self._plan.replica_urls)
        return all(ready.get_json(url, "/readyz", ca=self._plan.root_file)[0] == 200 for url in urls)

    def _all_online(self) -> bool:
        key = local_access.local_key(self._plan)
        found = ready.robots_online(self._plan.url, key=key, ca=self._plan.root_file)
        online = found & set(self._plan.robot_names)
        self._screen.progress("robots", f"{len(online)} of {len(self._plan.robot_names)} online")
        return len(online) == len(self._plan.robot_names)

    async def _step(self, what: str, condition: Callable[[], bool]) -> None:
        """Wait for one thing; a stop request or a broken process ends the wait."""
        self._screen.begin(what)
        try:
            await self._first(ready.wait_for(condition, timeout_s=START_TIMEOUT_S))
        except TimeoutError:
            raise UnavailableError(f"{what} not ready after {START_TIMEOUT_S:.0f} s\n{self._log_hint()}") from None
        self._screen.done(what)

    async def _first(self, wait: Coroutine[Any, Any, Any]) -> None:
        tasks = [asyncio.create_task(task) for task in (wait, self._stop.wait(), self._broken.wait())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks[1:]:
                task.cancel()
            if not tasks[0].done():
                tasks[0].cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        if self._stop.is_set():
            raise StopRequestedError("asked to stop")
        if self._broken.is_set():
            said = self._supervisor.tail(self._broken_name)[-8:]
            if self._lost is not None and (lost := self._lost(self._broken_name, said)):
                raise PortLostError(lost)
            tail = "\n".join(f"  {line}" for line in said)
            raise UnavailableError(f"{self._broken_name} does not stay up\n{tail}\n{self._log_hint()}")
        tasks[0].result()

    def _log_hint(self) -> str:
        return f"logs: {self._plan.log_dir}"

    def _on_event(self, event: Event) -> None:
        if event.kind is EventKind.EXITED and not self._ready:
            self._deaths[event.name] += 1
        given_up = self._deaths[event.name] >= GIVE_UP_AFTER or event.detail == WRONG
        gone = event.kind is EventKind.ENDED or given_up
        if gone and not self._ready and not self._broken.is_set():
            self._broken_name = event.name
            self._broken.set()
        self._screen.event(event, ready=self._ready)
        if self._ready:
            self._save("ready")

    def _save(self, state: str) -> None:
        rows: tuple[dict[str, object], ...] = tuple(
            {"name": row.name, "state": row.state, "pid": row.pid, "restarts": row.restarts, "last_exit": row.last_exit}
            for row in self._supervisor.status()
        )
        self._state.write(replace(self._claim, state=state, processes=rows))
