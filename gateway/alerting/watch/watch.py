"""The watch: once a second what came since is evaluated on a thread of its own, and findings are reported.

The event loop only notes watermarks and facts. Rows reach the evaluator through the log (`intake`), so that a gateway
that was killed goes on with the very same scores.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.feedback import sentence, teaches
from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.checking import Change, checked, merged, read_changes, row_of, write_change
from gateway.alerting.watch.database import Database
from gateway.alerting.watch.entries import Cycle, Mark
from gateway.alerting.watch.evaluation import EvaluationThread
from gateway.alerting.watch.facts import Facts, about
from gateway.alerting.watch.handover import Handover
from gateway.alerting.watch.intake import Intake
from gateway.alerting.watch.ownership import Ownership, RobotLocations
from gateway.alerting.watch.remote_watch import RemoteWatch
from gateway.alerting.watch.rows import BandPoint, CheckRow, SeriesWatch
from gateway.alerting.watch.state_machine import StateMachine
from gateway.alerting.watch.watch_files import WatchFiles
from gateway.domain.alert import Alert
from gateway.domain.channel import METRIC_STREAM
from gateway.domain.finding import Edge, Finding
from gateway.domain.fleet.recording import Recording
from gateway.errors import StoreError
from gateway.store.telemetry.query import read_metric_marks
from gateway.store.writes import Committed, StreamWrite
from metaros.clock import Clock
from metaros.link import CHANNEL_MASK

__all__ = ["Watch"]

log = logging.getLogger(__name__)

Result = TypeVar("Result")
CYCLE_S = 1.0
LOOK_S = 30.0  # at what other gateways changed in the table of checks
AT_ONCE = 32  # edges that are told before others have their turn on the event loop
CLOSE_S = 5.0
LEAVE_S = 10.0
NORMAL_S = 10.0


class Watch:
    """All methods on the event loop, but `ahead`, which the store's writer calls."""

    def __init__(
        self,
        folder: Path,
        database: Database,
        *,
        clock: Clock,
        report: Callable[[Sequence[Edge]], None],
        clip: Callable[[Alert], Awaitable[Recording]],
        stream_name: Callable[[StreamWrite], str] = lambda write: f"stream {write.stream_id & CHANNEL_MASK}",
        on: bool = True,
        make: Callable[[], StateMachine] = StateMachine,
        where: RobotLocations | None = None,
        gained: Callable[[str], None] = lambda robot: None,
        lost: Callable[[str], None] = lambda robot: None,
    ) -> None:
        """`report` takes what was found; `clip` asks for evidence; `stream_name` is how people call a stream; without
        `on` nothing is watched.

        With `where` other gateways write to the store too: then robots are judged here only between `gained` and
        `lost`, and what is learned of them is in the store, not in the folder.
        """
        self.on = on
        self.ready = False
        self.clip = clip
        self.remote: RemoteWatch | None = None  # asks the gateways that judge other robots
        self.facts = Facts()
        self._database = database
        self._clock = clock
        self._report = report
        self._stream_name = stream_name
        self._intake = Intake(WatchFiles(folder))
        self._intake.on = on
        self._bands = Bands()
        self._evaluation = EvaluationThread(self._intake, self._bands, clock=clock, make=make, kept=where is None)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gateway-watch")
        self._marks: dict[Mark, int] = {}
        self._stored: dict[Mark, int] = {}
        self._changes: dict[str, Change] = {}
        self._again: set[str] = set()
        self._cycle_done = asyncio.Condition()
        self._begun = self._ended = 0  # cycles
        self._looked_s = -math.inf
        self._cycle_s = 0.0
        self._handover = Handover(self._evaluation, self._intake)
        self._ownership: Ownership | None = None
        self._cycle_lock = asyncio.Lock()
        if where is not None and on:
            self._ownership = Ownership(
                database, self._handover, self._ask, clock=clock, where=where, gained=self._gain, lost=self._lose
            )
            self._cycle_lock = self._ownership.lock
        self._gained, self._lost = gained, lost

    @property
    def ahead(self) -> Callable[[Sequence[Any]], None]:
        """What the store's writer tells before each commit."""
        return self._intake.ahead

    async def start(self) -> None:
        """Before the first commit: know the store's watermarks, and log what comes from now on."""
        self._changes = await self._database.read(read_changes)
        if not self.on:
            return
        if self._ownership is None:
            self._stored = await self._database.read(read_metric_marks)
            try:
                await asyncio.to_thread(self._intake.files.begin)
            except OSError as error:
                log.error("what is watched will not outlive this gateway: %s", error)
        self._report_checks()

    async def run(self) -> None:
        """Restore, then run cycles, until cancelled."""
        if not self.on:
            return
        async with asyncio.TaskGroup() as group:
            await self.begin()
            if self._ownership is not None:
                group.create_task(self._ownership.run())
            await self._cycles()

    async def _cycles(self) -> None:
        while True:
            began_s = self._clock.monotonic_s()
            await self.run_cycle()
            self._cycle_s = self._clock.monotonic_s() - began_s
            await self._look()
            await asyncio.sleep(max(0.0, CYCLE_S - self._cycle_s))

    async def begin(self) -> None:
        """Be what the watch of the former run was; what is open is told again."""
        if self._ownership is not None:
            self.ready = True
            return
        self._marks = {**await self._ask(partial(self._evaluation.restore, self._stored)), **self._marks}
        self._stored = {}
        now_s = self._clock.wall_ns() / 1e9
        self.facts.add("heard", await self._ask(self._evaluation.robots), now_s)  # they have their time to come back
        await self.report_all(await self._ask(self._evaluation.open))
        self.ready = True

    async def run_cycle(self) -> None:
        """Judge what came since the last cycle, and tell what was found."""
        async with self._cycle_lock:
            if self._ownership is None or self._ownership.sure:
                await self._run_cycle()

    async def _run_cycle(self) -> None:
        now_s = self._clock.wall_ns() / 1e9
        again, self._again = self._again, set()
        cycle = self._next_cycle(now_s)
        self._begun += 1
        try:
            edges = await self._ask(partial(self._evaluation.run_cycle, cycle))
        except Exception:  # whatever is wrong with it, the gateway goes on
            log.exception("a cycle of the watch failed")
            edges = []
        await self._save(cycle, edges)
        for robot in sorted(again):
            await self.report_all(await self._ask(partial(self._evaluation.open, robot)))
        await self.report_all(edges)
        async with self._cycle_done:
            self._ended = self._begun
            self._cycle_done.notify_all()

    def _next_cycle(self, now_s: float) -> Cycle:
        """What is to be judged of what came; rows of robots that another gateway judges wait, facts do not."""
        facts, marks = self.facts.take(now_s), self._marks
        if self._ownership is None:
            self._marks = {}
            return Cycle(now_s=now_s, marks=marks, facts=facts)
        held = self._ownership.held
        mine = {mark: seq for mark, seq in marks.items() if mark[0] in held}
        self._marks = {mark: seq for mark, seq in marks.items() if mark[0] not in held}
        return Cycle(now_s=now_s, marks=mine, facts=list(about(facts, held)))

    async def _save(self, cycle: Cycle, edges: Sequence[Edge]) -> None:
        """Where robots may go to another gateway: what is told is saved before, so that nobody tells it again."""
        if self._ownership is None:
            return
        self._ownership.saves.changed({mark[0] for mark in cycle.marks})
        robots = list(dict.fromkeys(edge.finding.robot for edge in edges))
        self._ownership.saves.hurry(robots)
        try:
            await self._ownership.save(robots, locked=True)
        except StoreError as error:
            log.debug("what was found is told before it is saved: %s", error)

    def _gain(self, robot: str) -> None:
        """This gateway judges the robot from now on."""
        self.facts.reset(robot)
        self._again.add(robot)
        self._gained(robot)

    def _lose(self, robot: str) -> None:
        """Another gateway judges the robot from now on."""
        self._marks = {mark: seq for mark, seq in self._marks.items() if mark[0] != robot}
        self._again.discard(robot)
        self._lost(robot)

    async def snapshot(self) -> int:
        """Write a snapshot now; how many bytes it has, 0 where the disk takes none."""
        return await self._ask(self._evaluation.keep)

    async def close(self) -> None:
        """Judge no more; what was logged is gone through by the next gateway on this data directory.

        Where robots may go to another gateway, that one goes on from here.
        """
        if self._ownership is not None:
            try:
                async with asyncio.timeout(LEAVE_S):
                    await self._ownership.close()
            except (StoreError, TimeoutError) as error:
                log.warning("what was learned last is not saved: %s", error or "it takes too long")
        self._evaluation.stop = True
        ending = asyncio.create_task(asyncio.to_thread(self._thread.shutdown, cancel_futures=True))
        await asyncio.wait({ending}, timeout=CLOSE_S)
        await asyncio.to_thread(self._intake.close)

    def on_committed(self, done: Committed) -> None:
        """The store has more: note how far, and which losses were declared."""
        if not self.on:
            return
        for robot, stream_id, epoch, seq in done.marks:
            if stream_id & CHANNEL_MASK == METRIC_STREAM:
                self._marks[robot, stream_id, epoch] = seq
        for write in done.writes:
            if isinstance(write, StreamWrite) and write.gap is not None:
                now_s = self._clock.wall_ns() / 1e9
                self.facts.add("gap", write.robot, self._stream_name(write), write.gap.count, now_s)

    def judges(self, robot: str) -> bool:
        """Whether this gateway judges the robot."""
        return self.on and (self._ownership is None or robot in self._ownership.held)

    async def ensure_evaluated(self, robots: Collection[str]) -> None:
        """Somebody is to judge these robots, of which there are alerts. StoreError."""
        if self._ownership is not None:
            await self._ownership.begin(robots)

    async def learning(self, robot: str) -> list[SeriesWatch]:
        """How far each series of a robot is learned, by name."""
        if self.remote is not None and not self.judges(robot):
            return await self.remote.learning(robot)
        return await self.local_learning(robot)

    async def local_learning(self, robot: str) -> list[SeriesWatch]:
        """The same, of a robot that is judged here; none of others."""
        return await self._ask(partial(self._evaluation.learning, robot)) if self.ready else []

    async def band(self, robot: str, series: str, from_ns: int, to_ns: int) -> list[BandPoint]:
        """What a series was and was expected to be, oldest first; it is kept from when somebody first asked."""
        if self.remote is not None and not self.judges(robot):
            return await self.remote.band(robot, series, from_ns, to_ns)
        return self.local_band(robot, series, from_ns, to_ns)

    def local_band(self, robot: str, series: str, from_ns: int, to_ns: int) -> list[BandPoint]:
        """The same, of a robot that is judged here."""
        if self.on:
            self._bands.want(robot, series)
        return self._bands.read(robot, series, from_ns, to_ns)

    async def normal(self, alert: Alert) -> list[str]:
        """Teach what an alert is about. Says what was taught, once it was, and what learns nothing.

        Raises:
            GatewayError: the gateway that judges the robot cannot be taught now.
        """
        findings = [evidence.finding for evidence in alert.findings]
        if not self.on or self.judges(alert.robot):
            return await self.local_normal(findings)
        if self.remote is None:
            return [f"robot {alert.robot} is judged by another gateway, which learns nothing of this"]
        return await self.remote.normal(alert.robot, findings)

    async def local_normal(self, findings: Sequence[Finding]) -> list[str]:
        """The same, of a robot that is judged here."""
        if not self.ready:
            return []
        checks, said, taught = {check.id: check for check in self.table()}, [], False
        for finding in findings:
            check = checks.get(finding.kind)
            if check is not None and teaches(check) and math.isfinite(finding.value):
                self.facts.add("accept", finding.robot, finding.series, finding.kind, finding.value)
                taught = True
            said.append(sentence(finding, check))
        if taught:
            wanted = self._begun + 1
            with contextlib.suppress(TimeoutError):  # it is queued all the same
                async with asyncio.timeout(NORMAL_S), self._cycle_done:
                    await self._cycle_done.wait_for(lambda: self._ended >= wanted)
        return list(dict.fromkeys(said))

    def table(self) -> tuple[Check, ...]:
        """The checks in force."""
        return merged({check_id: change.values for check_id, change in self._changes.items()})

    def checks(self) -> list[CheckRow]:
        """The checks in force, for people."""
        return [row_of(check, self._changes.get(check.id)) for check in self.table()]

    async def set_check(self, check_id: str, changes: Mapping[str, Any], *, by: str) -> CheckRow:
        """Have a check otherwise.

        Raises:
            UnknownCheckError: there is no such check.
            InvalidRequestError: a value that it cannot have.
            StoreError: it cannot be stored now.
        """
        before = self._changes.get(check_id)
        values = checked(check_id, before.values if before is not None else {}, changes)
        return await self._put_check(check_id, values, by)

    async def reset_check(self, check_id: str, *, by: str) -> CheckRow:
        """Have a check as it comes; UnknownCheckError, StoreError."""
        checked(check_id, {}, {})
        return await self._put_check(check_id, {}, by)

    def describe(self) -> dict[str, Any]:
        """Numbers for whoever looks after the gateway."""
        files, pending, state_machine = self._intake.files, self._intake.pending, self._evaluation.state_machine
        return {
            "on": self.on,
            "ready": self.ready,
            "rows": state_machine.rows,
            "waiting_rows": pending.rows,
            "dropped_rows": pending.dropped,
            "skipped_facts": self.facts.skipped,
            "log_bytes": files.size_bytes,
            "snapshot_bytes": self._evaluation.snapshot_bytes,
            "snapshot_ns": self._evaluation.snapshot_ns,
            "turn_s": round(self._cycle_s, 4),
            "robots": len(self._ownership.held)
            if self._ownership is not None
            else len(state_machine.evaluator.robots()),
            "replayed_rows": self._handover.replayed,
            "skipped_replays": self._handover.skipped,
        }

    async def _put_check(self, check_id: str, values: Mapping[str, Any], by: str) -> CheckRow:
        change = Change(values=values, by=by, at_ns=self._clock.wall_ns())
        await self._database.run(lambda engine: write_change(engine, check_id, change))
        self._changes = {key: found for key, found in self._changes.items() if key != check_id}
        if values:
            self._changes[check_id] = change
        self._report_checks()
        return next(row for row in self.checks() if row.id == check_id)

    def _report_checks(self) -> None:
        self.facts.add("checks", {check_id: dict(change.values) for check_id, change in self._changes.items()})

    async def _look(self) -> None:
        """What other gateways of the store changed in the table of checks."""
        now_s = self._clock.monotonic_s()
        if not self._database.shared or now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        try:
            found = await self._database.read(read_changes)
        except StoreError as error:
            log.debug("the table of checks is not read again: %s", error)
            return
        if found != self._changes:
            self._changes = found
            self._report_checks()

    async def report_all(self, edges: Sequence[Edge]) -> None:
        """Tell what was found, a few at a time: others have their turns on the event loop meanwhile."""
        for start in range(0, len(edges), AT_ONCE):
            some = edges[start : start + AT_ONCE]
            self._report(some)
            for edge in some:
                if edge.change == "opened" and edge.finding.series:
                    self._bands.want(edge.finding.robot, edge.finding.series)
            await asyncio.sleep(0)

    async def _ask(self, job: Callable[[], Result]) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._thread, job)
