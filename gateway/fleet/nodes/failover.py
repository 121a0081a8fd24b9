"""Failover of migratable nodes: each runs on one of the robots that have it in their table, and moves if that is lost.

A template's node is one unit, whoever lays more over it; a migratable node of a robot's own document is a unit of that
robot alone. This gateway leases only to robots that are linked to it. What is decided is in `domain.node_lease`; here
are the rows, the frames and the beat.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import Iterable, Mapping
from typing import Any, Final
from zlib import crc32

import orjson

from gateway.domain.fleet.node_lease import LeaseTerms, NodeLeases, Step, Unit, UnitLease
from gateway.domain.fleet.twin import Desired
from gateway.errors import RobotOfflineError, StoreError
from gateway.fleet.robots import SendFrame
from gateway.fleet.twins.feature import Twins
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.leases import read_leases, write_leases
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Failover", "can_run"]

log = logging.getLogger(__name__)

TERMS: Final = LeaseTerms(
    valid_s=LIMITS.node_lease_valid_s,
    margin_s=LIMITS.node_lease_margin_s,
    answer_s=LIMITS.node_lease_answer_s,
    shunned_s=LIMITS.node_shunned_s,
)
STEP_S: Final = 0.25
BEATS: Final = 4  # steps from one frame of a robot to its next: a part of the fleet hears with each
LOOK_S: Final = 1.0  # how often it is asked what other gateways did
UNABLE: Final = frozenset({"quarantined", "refused", "fetching"})


class Failover:
    """All methods on the event loop; `run` it beside the links."""

    def __init__(self, store: Store, twins: Twins, send: SendFrame, *, clock: Clock) -> None:
        self._store = store
        self._cache = twins.cache
        self._send = send
        self._clock = clock
        keeper = secrets.token_hex(8)  # no other gateway has that, nor this one in another life
        self._leases = NodeLeases(keeper, TERMS, shared=store.shared)
        self._able: dict[str, dict[str, bool]] = {}  # by robot: the nodes in its report
        self._units: dict[str, tuple[Desired, list[Unit]]] = {}  # by robot, as its desired state had them
        self._unsure = True
        self._looked_s = 0.0
        self._beat = 0
        self._failed = False
        self._writing: asyncio.Task[None] | None = None
        twins.manager.listen(self.on_report)

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link is whole, or ended."""
        self._leases.linked(robot)
        if not online:
            self._able.pop(robot, None)
            self._units.pop(robot, None)
            self._leases.offer(robot, {})

    def on_answer(self, robot: str, boot_ns: int) -> None:
        """A robot told a moment of its clock."""
        if robot in self._able:
            self._leases.answered(robot, boot_ns, now_s=self._clock.monotonic_s())

    def on_report(self, robot: str, values: Mapping[str, Any]) -> None:
        """A robot told how its nodes are. A report that was too long for that leaves things as they were."""
        left_out = values.get("left_out")
        if isinstance(left_out, list) and "nodes" in left_out:
            self._able.setdefault(robot, {})
            return
        nodes = values.get("nodes")
        rows = nodes.items() if isinstance(nodes, dict) else ()
        self._able[robot] = {name: can_run(row) for name, row in rows}
        self._offer(robot)

    def holder_of(self, robot: str, node: str) -> str | None:
        """The robot that may run this robot's migratable node now; None: nobody, or it is none."""
        held = self.lease_of(robot, node)
        return held.robot if held is not None else None

    def lease_of(self, robot: str, node: str) -> UnitLease | None:
        """The living lease of the unit that a robot's node is."""
        unit = next((unit for unit in self._units_of(robot) if unit.node == node), None)
        return self._leases.holder(unit, now_s=self._clock.monotonic_s()) if unit is not None else None

    async def run(self) -> None:
        """Renew leases, move nodes and notify robots. While the store fails nothing moves, nor is renewed if shared."""
        async with asyncio.TaskGroup() as group:
            while True:
                await asyncio.sleep(STEP_S)
                await self.step(group)

    async def step(self, group: asyncio.TaskGroup) -> None:
        """Once; what is to be written is written beside it, by a task of the group."""
        try:
            await self._look()
            self._plan(group)
            # A store that can be read may refuse the write that has just begun.
            self._failed = self._failed and (self._unsure or self._writing is not None)
        except StoreError as error:
            self._fail(error)
        self._report_some()

    async def _look(self) -> None:
        """Know the rows: at the start, after a write of unknown end, and what other gateways did."""
        due = self._store.shared and self._clock.monotonic_s() - self._looked_s >= LOOK_S
        if self._writing is None and (self._unsure or due):
            rows = await self._store.read(_read)
            self._learn(rows)

    def _learn(self, rows: list[UnitLease]) -> None:
        self._looked_s = self._clock.monotonic_s()
        self._leases.learn(rows, now_s=self._looked_s)
        self._unsure = False

    def _plan(self, group: asyncio.TaskGroup) -> None:
        for robot in self._able:
            if self._cache.desired.get(robot) is not self._units.get(robot, (None,))[0]:
                self._offer(robot)
        if self._unsure:
            return
        steps = self._leases.plan(now_s=self._clock.monotonic_s(), wall_ns=self._clock.wall_ns())
        self._leases.took(step for step in steps if not step.written)
        written = [step for step in steps if step.written]
        if written and self._writing is None:
            self._leases.begin(written)
            self._writing = group.create_task(self._write(written))

    async def _write(self, steps: list[Step]) -> None:
        """Beside the beat: a renewal that needs no write does not wait for a slow disk."""
        try:
            rows = await self._store.run(lambda engine: write_leases(engine, steps))
        except StoreError as error:
            self._unsure = True
            self._fail(error)
            return
        finally:
            self._writing = None
        taken = [step for step in steps if step.after in rows]
        self._leases.took(taken)
        self._learn(rows)
        for step in taken:
            if step.before is None or step.before.robot != step.after.robot:
                log.info("node %s of %s runs on %s now", step.after.unit.node, step.after.unit.scope, step.after.robot)
            self._report(step.after.robot)

    def _fail(self, error: StoreError) -> None:
        if not self._failed:
            log.warning("leases of migratable nodes cannot be stored or read now: %s", error)
        self._failed = True

    def _report_some(self) -> None:
        self._beat = (self._beat + 1) % BEATS
        for robot in [robot for robot in self._leases.robots if crc32(robot.encode()) % BEATS == self._beat]:
            self._report(robot)

    def _report(self, robot: str) -> None:
        since_ns, held = self._leases.frame(robot)
        valid_ms = round(TERMS.valid_s * 1000)
        leases = [
            link_pb2.NodeLease(node=one.unit.node, lease_id=one.lease_id, valid_ms=valid_ms, epoch=one.epoch)
            for one in held
        ]
        with contextlib.suppress(RobotOfflineError):
            frame = link_pb2.NodeLeases(leases=leases, since_ns=since_ns)
            self._send(robot, link_pb2.GatewayFrame(node_leases=frame))

    def _offer(self, robot: str) -> None:
        able, units, desired = self._able.get(robot, {}), self._units_of(robot), self._cache.desired.get(robot)
        self._leases.offer(robot, {unit: able.get(unit.node, False) for unit in units})
        if desired is None:
            self._units.pop(robot, None)
        elif robot in self._able:
            self._units[robot] = (desired, units)

    def _units_of(self, robot: str) -> list[Unit]:
        """The migratable nodes that a robot is to have, each with the template that made it one first.

        Whoever asks changes nothing: what `_units` has was offered.
        """
        desired = self._cache.desired.get(robot)
        if desired is None:
            return []
        known = self._units.get(robot)
        if known is not None and known[0] is desired:
            return known[1]
        return [Unit(self._scope(desired, node), node) for node in _migratable(desired)]

    def _scope(self, desired: Desired, node: str) -> str:
        for name in (mark.rpartition("@")[0] for mark in desired.templates):
            template = self._cache.templates.get(name)
            row = ((template.document.get("nodes") or {}).get(node) or {}) if template is not None else {}
            if row.get("migratable"):
                return name
        return f"robot/{desired.robot}"


def can_run(row: object) -> bool:
    """Whether a node, as its robot reports it, waits for nothing but a lease, or runs."""
    if not isinstance(row, dict) or row.get("quarantined") or str(row.get("state")) in UNABLE:
        return False
    return row.get("why", "") in ("", "no lease")


def _migratable(desired: Desired) -> Iterable[str]:
    nodes = orjson.loads(desired.document).get("nodes") or {}
    return [name for name, row in nodes.items() if row.get("migratable") and row.get("run", True)]


def _read(engine: StoreEngine) -> list[UnitLease]:
    with engine.transaction(write=False):
        return read_leases(engine)
