"""The supervisor as a service: its table, which may change at any time, and what may be asked of it.

One event loop owns everything. What changes the table, and what changes one node, takes turns by locks; the end of a
lease waits for nobody: the node is killed, and a last word before each start keeps it down.
"""

from __future__ import annotations

import asyncio
import logging
import os
import secrets
import sys
from collections.abc import Callable, Coroutine, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from metaros.clock import Clock
from metaros.errors import ConfigError, MetarosError, UnavailableError
from metaros.supervise.child import ProcessStatus
from metaros.supervise.crashes import Crashes, core_of
from metaros.supervise.events import Event, EventKind
from metaros.supervise.lease import LeaseAction, Leases
from metaros.supervise.node_table_file import Row, TableFile
from metaros.supervise.process import Launch
from metaros.supervise.safe_stop import SafeStops
from metaros.supervise.supervisor import Supervisor

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

__all__ = ["NodeService"]

LOG = logging.getLogger("metaros.supervisor")
TABLE: Final = "supervisor.json"
LEASE_EPOCH: Final = "METAROS_LEASE_EPOCH"  # the fencing number, for a migratable node to give to what it writes to
LEASE_STEP_S: Final = 0.1  # leases are looked at so often, however late a timer is after a suspended machine
_TOLD_CRASHES = (EventKind.EXITED, EventKind.KILLED)


class NodeService:
    """`start`, then any of the verbs, then `stop`. `lease_s` reads the clock of leases."""

    def __init__(self, directory: Path, *, clock: Clock, rng: Random, lease_s: Callable[[], float]) -> None:
        """Raises ConfigError where the table on disk is damaged."""
        self.directory = directory
        self.life = secrets.token_hex(8)  # of this process: a `since` of another one means nothing here
        self.revision = 0  # grows whenever `list_` would say something else
        self.changed = asyncio.Event()
        self._clock, self.lease_s = clock, lease_s
        self._file = TableFile(directory / TABLE)
        self._leases = Leases()
        self._crashes = Crashes(directory / "crashes")
        self._safe_stops = SafeStops(directory, changed=self._say_changed)
        self._supervisor = Supervisor(clock=clock, rng=rng, on_event=self._on_event, may_run=self._wanted)
        self._rows: dict[str, Row] = {}
        self._stages: dict[str, int] = {}
        self._table_lock = asyncio.Lock()
        self._locks: dict[str, asyncio.Lock] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._on_the_way: set[str] = set()  # whose lease began or ends: it is being started or stopped
        self._stopping = False
        self._started_ns: dict[str, int] = {}
        self._exits: dict[str, int] = {}  # that nobody asked for, in this life of the supervisor
        self._applied: dict[str, Row] = {}  # what each process last ran with
        self._take_rows()

    # -- life ------------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Run what the table says; nothing that needs a lease before it has one."""
        for row in self._rows.values():
            self._supervisor.add(self._launch(row))
            self._applied[row.name] = row
        for name in self._rows:
            if self._wanted(name):
                self._supervisor.restart(name)
        self._spawn(self._watch_leases())

    async def stop(self, *, grace_s: float) -> None:
        """Stop all in order."""
        self._stopping = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._supervisor.stop(grace_s=grace_s)
        await self._safe_stops.close()
        await self._crashes.close()

    def kill(self) -> None:
        """Kill all at once."""
        self._supervisor.kill()

    async def do(self, work: Coroutine[Any, Any, None]) -> None:
        """Do it to its end, also when who asked for it goes away meanwhile: a restart has two halves."""
        await asyncio.shield(self._spawn(work))

    # -- what is so ------------------------------------------------------------------------------------------------

    def list_(self) -> dict[str, Any]:
        """The table and its nodes as they are now."""
        table = self._file.table
        known = {status.name: status for status in self._supervisor.status()}
        nodes = [self._shown(row, known[row.name]) for row in table.rows if row.name in known]
        return {
            "pid": os.getpid(),
            "life": self.life,
            "revision": self.revision,
            "table": table.version,
            "tag": table.tag,
            "python": sys.executable,
            "nodes": nodes,
        }

    def crashes(self, name: str) -> list[dict[str, Any]]:
        """How a node ended the last times."""
        return self._crashes.of(self._row(name).name)

    def log_path(self, name: str) -> Path:
        """Where a node's log is."""
        return self._log_path(self._row(name).name)

    # -- what is asked ---------------------------------------------------------------------------------------------

    async def set_table(self, rows: tuple[Row, ...], *, tag: str = "") -> None:
        """Other rows: who is gone ends, who is new starts, whose program changed starts again, the rest goes on.
        A row that is to run again frees its node from a stop by hand: it is the later word.

        Raises OSError where the table cannot be kept on disk; nothing has changed then.
        """
        async with self._table_lock:
            before = self._rows
            again = {row.name for row in rows if row.run and row.name in before and not before[row.name].run}
            await self._keep(rows, self._file.table.stopped - again, tag)
            for row in rows:  # all of them first: they wait for each other
                if not self._supervisor.knows(row.name):
                    self._supervisor.add(self._launch(row))
                    self._applied[row.name] = row
        self._say_changed()
        await asyncio.gather(*(self._settle(name) for name in {**before, **self._rows}))

    async def start_node(self, name: str) -> None:
        """Run it, also after a `stop_node`, and where it has ended or rests."""
        await self._by_hand(name, stopped=False)
        await self._settle(name, wake=True)

    async def stop_node(self, name: str) -> None:
        """End it, until `start_node` or `restart_node`, also over a restart of the machine."""
        await self._by_hand(name, stopped=True)
        await self._settle(name)

    async def restart_node(self, name: str) -> None:
        """End it and start it again, or end its rest; its past is forgotten."""
        await self._by_hand(name, stopped=False)
        await self._settle(name, wake=True, again=True)

    async def retry_node(self, name: str) -> None:
        """End its quarantine, or its pause, now; nothing happens to one that runs."""
        if self._row(name).name in self._file.table.stopped:
            raise ConfigError(f"{name} is stopped; start it")
        await self._settle(name, wake=True)

    def signal_node(self, name: str, number: int) -> None:
        """Send it a signal. Raises UnavailableError where it does not run."""
        if not self._supervisor.send(self._row(name).name, number):
            raise UnavailableError(f"{name} does not run")

    def set_leases(
        self, given: Iterable[tuple[str, str, float]], *, age_s: float, epochs: Mapping[str, int] | None = None
    ) -> None:
        """The leases that are held now, as they were given `age_s` ago; all others are taken back."""
        self._leases.replace(given, age_s=age_s, now_s=self.lease_s(), epochs=epochs)
        for name in self._rows:
            self._on_duty(name)
        self._say_changed()

    # -- one node --------------------------------------------------------------------------------------------------

    async def _by_hand(self, name: str, *, stopped: bool) -> None:
        """Note on disk whether somebody has stopped it."""
        async with self._table_lock:
            row, table = self._row(name), self._file.table
            if not row.run and not stopped:
                raise ConfigError(f"{name} is not to run: its row says run = false")
            wanted = table.stopped | {name} if stopped else table.stopped - {name}
            if wanted != table.stopped:
                await self._keep(table.rows, wanted, table.tag)

    async def _keep(self, rows: tuple[Row, ...], stopped: frozenset[str], tag: str) -> None:
        await asyncio.to_thread(self._file.replace, rows, stopped, tag=tag)
        self._take_rows()

    def _take_rows(self) -> None:
        self._rows = {row.name: row for row in self._file.table.rows}
        self._stages = {}
        for row in self._rows.values():  # each comes after those that it needs
            self._stages[row.name] = max((self._stages[name] + 1 for name in row.after), default=0)

    async def _settle(self, name: str, *, wake: bool = False, again: bool = False) -> None:
        """Bring a node to where the table wants it now. `wake`: also one that has ended or rests; `again`: anew."""
        async with self._locks.setdefault(name, asyncio.Lock()):
            row = self._rows.get(name)
            if row is None:
                await self._forget(name)
                return
            if self._supervisor.knows(name):
                self._supervisor.change(self._launch(row))
            else:
                self._supervisor.add(self._launch(row))
            changed = self._applied.get(name, row).program != row.program
            self._applied[name] = row
            status = self._supervisor.status_of(name)
            if not self._wanted(name) or (status.pid is not None and (changed or again)):
                await self._supervisor.stop_one(name)
            elif not (status.state == "stopped" or (status.pid is None and (changed or wake))):
                return
            if self._wanted(name):
                self._supervisor.restart(name)
        self._say_changed()

    async def _forget(self, name: str) -> None:
        if self._supervisor.knows(name):
            await self._supervisor.remove(name)
            self._crashes.forget(name)
            self._safe_stops.forget(name)
            self._applied.pop(name, None)
            self._exits.pop(name, None)
            self._started_ns.pop(name, None)
            self._say_changed()

    def _wanted(self, name: str) -> bool:
        """Whether it is to run now: its row, nobody's hand, its lease."""
        row = self._rows.get(name)
        if row is None or not row.run or name in self._file.table.stopped or self._stopping:
            return False
        return not row.migratable or self._duty(row) is LeaseAction.RUN

    # -- leases ----------------------------------------------------------------------------------------------------

    def _duty(self, row: Row) -> LeaseAction:
        return self._leases.duty(row.name, row.stop_grace_s, self.lease_s())

    async def _watch_leases(self) -> None:
        while True:
            graces = {row.name: row.stop_grace_s for row in self._rows.values() if row.migratable}
            now_s = self.lease_s()
            next_s = self._leases.next_s(graces, now_s)
            await asyncio.sleep(min(LEASE_STEP_S, max(next_s - now_s, 0.001)) if next_s else LEASE_STEP_S)
            for name in graces:
                self._on_duty(name)

    def _on_duty(self, name: str) -> None:
        """Start it under its lease, stop it before the end, kill it at the end."""
        row = self._rows.get(name)
        if row is None or not row.migratable or not self._supervisor.knows(name):
            return
        duty, state = self._duty(row), self._supervisor.status_of(name).state
        if duty is LeaseAction.KILL:
            self._supervisor.kill_one(name)
        amiss = (state == "stopped") is self._wanted(name)
        if amiss and name not in self._on_the_way:
            self._on_the_way.add(name)
            self._spawn(self._come_to_duty(name))

    async def _come_to_duty(self, name: str) -> None:
        try:
            await self._settle(name)
        finally:
            self._on_the_way.discard(name)

    # -- words -----------------------------------------------------------------------------------------------------

    def _on_event(self, event: Event) -> None:
        if event.kind is EventKind.STARTED:
            self._started_ns[event.name] = self._clock.wall_ns()
        if event.kind in _TOLD_CRASHES:
            self._exits[event.name] = self._exits.get(event.name, 0) + 1
            row = self._applied.get(event.name)
            now = self._clock.wall_ns()
            self._crashes.add(
                event.name,
                at_ns=now,
                reason=event.detail[:1000],
                pid=event.pid,
                ran_s=round((now - self._started_ns.get(event.name, now)) / 1e9, 3),
                version=row.version if row else "",
                argv=[word[:500] for word in row.argv[:32]] if row else [],
                env=core_of({**os.environ, **(row.env if row else {})}),
                lines=self._supervisor.tail(event.name),
            )
        if event.kind is EventKind.SAFE_STOP and (row := self._rows.get(event.name)) is not None:
            self._safe_stops.ask(row.name, row.safe_stop, row.env)
        level = logging.INFO if event.kind in (EventKind.STARTED, EventKind.READY) else logging.WARNING
        LOG.log(level, "%s: %s%s", event.name, event.kind.value, f" ({event.detail})" if event.detail else "")
        self._say_changed()

    def _shown(self, row: Row, status: ProcessStatus) -> dict[str, Any]:
        lease = self._leases.get(row.name)
        held = lease is not None and self._duty(row) is LeaseAction.RUN
        why = ""
        if status.state == "stopped" and not self._wanted(row.name):
            by_hand = row.name in self._file.table.stopped
            why = "by hand" if by_hand else "not to run" if not row.run else "no lease"
        return {
            "name": row.name,
            "state": status.state,
            "why": why,
            "pid": status.pid,
            "restarts": status.restarts,
            "last_exit": status.last_exit,
            "since_ns": self._started_ns.get(row.name, 0) if status.pid else 0,
            "waits_for": status.waits_for,
            "version": row.version,
            "critical": row.critical,
            "nice": row.nice,
            "migratable": row.migratable,
            "lease_id": lease.lease_id if lease is not None and held else "",
            "safe_stop": self._safe_stops.outcome(row.name),
            "crashes": len(self._crashes.of(row.name)),
            "crashes_total": self._exits.get(row.name, 0),
        }

    def _say_changed(self) -> None:
        self.revision += 1
        self.changed.set()
        self.changed = asyncio.Event()

    # -- parts -----------------------------------------------------------------------------------------------------

    def _launch(self, row: Row) -> Launch:
        lease = self._leases.get(row.name) if row.migratable else None
        fencing = {LEASE_EPOCH: str(lease.epoch)} if lease is not None else {}
        return Launch(
            name=row.name,
            argv=row.argv,
            log_path=self._log_path(row.name),
            log_bytes=row.log_bytes,
            log_stamped=True,
            stage=self._stages[row.name],
            env={**row.env, **fencing},
            cwd=Path(row.cwd) if row.cwd else self.directory,
            policy=row.policy,
            clean_up=row.clean_up,
            after=row.after,
            rest_for_one=row.rest_for_one,
            heartbeat_s=row.heartbeat_s,
            stop_grace_s=row.stop_grace_s,
            nice=row.nice,
            own_guard=row.own_guard,
        )

    def _log_path(self, name: str) -> Path:
        return self.directory / "logs" / f"{name}.log"

    def _row(self, name: object) -> Row:
        row = self._rows.get(name) if isinstance(name, str) else None
        if row is None:
            there = ", ".join(self._rows) or "none"
            raise UnavailableError(f"no node {str(name)[:64]!r} here; there are: {there}"[:500])
        return row

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)
        return task

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None and not isinstance(error, MetarosError):
            LOG.error("a task of the supervisor failed", exc_info=error)
