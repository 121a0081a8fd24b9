"""The watch on the event loop: what it is told reaches the evaluator, and what the evaluator finds is told."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.alerting.watch.errors import UnknownCheckError
from gateway.alerting.watch.watch import Watch
from gateway.domain.alert import Alert, Evidence
from gateway.domain.finding import Edge, Finding
from gateway.domain.sample import Gap
from gateway.errors import InvalidRequestError
from gateway.store import Store
from gateway.store.retention import Retention
from gateway.store.writes import Committed, Mark, StreamWrite
from metaros.clock import ManualClock, SystemClock
from tests.gateway.alerting.watch.made import START_S, write

NAN = float("nan")


@dataclass
class Rig:
    """A watch on a real store; `cycle` is a second later."""

    watch: Watch
    clock: ManualClock
    edges: list[Edge] = field(default_factory=list)
    longest: int = 0

    def report(self, edges: Sequence[Edge]) -> None:
        self.edges += edges
        self.longest = max(self.longest, len(edges))

    async def run_cycle(self, seconds: float = 1.0) -> list[Edge]:
        self.edges.clear()
        self.clock.advance(seconds)
        await self.watch.run_cycle()
        return list(self.edges)

    def commit(self, *writes: StreamWrite) -> None:
        self.watch.ahead(writes)
        marks = [Mark(each.robot, each.stream_id, each.epoch, each.seq) for each in writes]
        self.watch.on_committed(Committed(writes, marks))

    @property
    def now_s(self) -> float:
        return self.clock.wall_ns() / 1e9


@asynccontextmanager
async def store_in(folder: Path) -> AsyncIterator[Store]:
    store = Store(folder, clock=SystemClock(), retention=Retention(age_s=1e9, size_bytes=1 << 40), queue_bytes=1 << 20)
    store.start()
    try:
        yield store
    finally:
        await store.close()


@asynccontextmanager
async def watching(store: Store, folder: Path, *, on: bool = True, later_s: float = 60.0) -> AsyncIterator[Rig]:
    async def no_clip(alert: Alert) -> Any:
        raise AssertionError("nobody asks for a clip")

    clock = ManualClock(wall_ns=round((START_S + later_s) * 1e9))
    rig: Rig
    watch = Watch(folder / "watch", store, clock=clock, report=lambda edges: rig.report(edges), clip=no_clip, on=on)
    rig = Rig(watch, clock)
    await watch.start()
    if on:
        await watch.begin()
    try:
        yield rig
    finally:
        await watch.close()


def finding(**more: Any) -> Finding:
    facts: dict[str, Any] = {
        "robot": "r1", "series": "a.x", "kind": "level", "cause": "change", "severity": "warning", "score": 0.8,
        "value": 7.0, "low": 0.0, "high": 1.0, "reason": "It is so.", "since_s": START_S,
    }  # fmt: skip
    return Finding(**{**facts, **more})


def alert(*findings: Finding) -> Alert:
    return Alert(
        id="A", robot="r1", cause="change", state="open", severity="warning", title="Level changed",
        findings=tuple(Evidence(finding=each, told_ns=0) for each in findings),
        opened_ns=0, first_ns=0, changed_ns=0, seen_ns=0,
    )  # fmt: skip


async def test_committed_rows_are_judged_and_shown(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        assert await rig.watch.learning("r1") == []
        assert await rig.watch.band("r1", "a.x", 0, 1 << 62) == []
        rig.commit(write(1, 60))
        await rig.run_cycle()
        (row,) = await rig.watch.learning("r1")
        assert (row.series, row.seen > 50, row.of > 60) == ("a.x", True, True)
        (point,) = await rig.watch.band("r1", "a.x", 0, 1 << 62)
        assert (point.stamp_ns, point.value) == ((START_S + 60) * 10**9, 60.0)
        assert rig.watch.describe()["rows"] == 60


async def test_a_robot_whose_link_ends_is_offline_after_half_a_minute_and_once_it_is_back_that_is_over(
    tmp_path: Path,
) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        rig.watch.facts.add("link", "r1", True, rig.now_s)
        rig.watch.facts.heartbeat("r1")
        assert await rig.run_cycle() == []
        rig.watch.facts.add("link", "r1", False, rig.now_s)
        assert await rig.run_cycle(20.0) == []
        (edge,) = await rig.run_cycle(15.0)
        assert (edge.change, edge.finding.cause, edge.finding.severity) == ("opened", "offline", "error")
        rig.watch.facts.add("link", "r1", True, rig.now_s)
        rig.watch.facts.heartbeat("r1")
        edges = await rig.run_cycle()
        for _ in range(10):
            rig.watch.facts.heartbeat("r1")
            edges += await rig.run_cycle()
        assert [edge.change for edge in edges] == ["cleared"]


async def test_after_a_restart_robots_have_their_time_to_come_back_and_what_is_open_is_reported_again(
    tmp_path: Path,
) -> None:
    async with store_in(tmp_path) as store:
        async with watching(store, tmp_path) as rig:
            for robot in ("r1", "gone"):
                rig.watch.facts.add("link", robot, True, rig.now_s)
            await rig.run_cycle()
            for _ in range(40):
                rig.watch.facts.heartbeat("r1")
                await rig.run_cycle()
        async with watching(store, tmp_path, later_s=3600.0) as rig:
            (edge,) = rig.edges
            assert (edge.change, edge.finding.robot, edge.finding.cause) == ("opened", "gone", "offline")
            for _ in range(20):  # neither is offline who had no time yet, nor is it over for who was gone before
                assert await rig.run_cycle() == []
            (edge,) = await rig.run_cycle(20.0)
            assert (edge.change, edge.finding.robot) == ("opened", "r1")


async def test_declared_losses_are_reported_by_the_name_of_their_stream(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        lost = Gap(from_seq=1, to_seq=9, reason="quota", from_ns=0, to_ns=1)
        rig.commit(StreamWrite(robot="r1", stream_id=3, epoch=7, seq=9, gap=lost))
        (edge,) = [edge for edge in await rig.run_cycle() if edge.finding.cause == "sequence"]
        assert edge.finding.series == "stream 3"


async def test_many_findings_are_reported_a_few_at_a_time(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        evaluation = 0

        async def others() -> None:
            nonlocal evaluation
            while True:
                evaluation += 1
                await asyncio.sleep(0)

        other = asyncio.create_task(others())
        await rig.watch.report_all([Edge("opened", finding(robot=f"r{n}"), START_S) for n in range(3_000)])
        other.cancel()
        assert len(rig.edges) == 3_000
        assert rig.longest <= 64
        assert evaluation > 90


async def test_this_is_normal_teaches_what_has_a_value(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        rig.commit(write(1, 60))
        await rig.run_cycle()
        found = alert(finding(), finding(kind="step"), finding(kind="vibration"), finding(kind="motor_hot"))
        teaching = asyncio.create_task(rig.watch.normal(found))
        await asyncio.sleep(0)
        await rig.run_cycle()
        assert await teaching == [
            "a.x: 7 counts as normal",
            "a.x: that it shakes so much counts as normal",
            "motor_hot has a fixed bound and learns nothing: change the check, or silence the alert",
        ]


async def test_checks_are_set_stored_and_set_back(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store:
        async with watching(store, tmp_path) as rig:
            row = await rig.watch.set_check("motor_hot", {"high": 60.0}, by="ann")
            assert (row.high, row.by, row.changed) == (60.0, "ann", ("high",))
            with pytest.raises(UnknownCheckError):
                await rig.watch.set_check("nonsense", {}, by="ann")
            with pytest.raises(UnknownCheckError):
                await rig.watch.reset_check("nonsense", by="ann")
            with pytest.raises(InvalidRequestError):
                await rig.watch.set_check("motor_hot", {"high": NAN}, by="ann")
            with pytest.raises(InvalidRequestError, match="check silence has no high: of it you may set enabled"):
                await rig.watch.set_check("silence", {"high": 3.0}, by="ann")
        async with watching(store, tmp_path) as rig:
            (row,) = [row for row in rig.watch.checks() if row.id == "motor_hot"]
            assert (row.high, row.by) == (60.0, "ann")
            hot = write(1, 40, series=("motor.temperature",))
            assert hot.rows is not None
            hot.rows.values[:] = 70.0
            rig.commit(hot)
            assert [edge.finding.kind for edge in await rig.run_cycle()] == ["motor_hot"]
            row = await rig.watch.reset_check("motor_hot", by="bob")
            assert row.changed == ()
            assert [edge.change for edge in await rig.run_cycle()] == ["cleared"]


async def test_a_watch_that_is_off_keeps_nothing_and_shows_the_table(tmp_path: Path) -> None:
    async with store_in(tmp_path) as store, watching(store, tmp_path, on=False) as rig:
        rig.commit(write(1, 60))
        await rig.watch.run()
        assert not rig.watch.ready
        assert not (tmp_path / "watch").exists()
        assert await rig.watch.learning("r1") == []
        assert await rig.watch.normal(alert(finding())) == []
        assert rig.watch.checks()


async def test_odd_values_jumping_clocks_and_years_of_nothing_are_no_storm(tmp_path: Path) -> None:
    years = 10 * 365 * 86_400
    async with store_in(tmp_path) as store, watching(store, tmp_path) as rig:
        first, opened = 1, list[Edge]()
        for shift_s, odd in [(0, None), (-3600, None), (0, NAN), (years, None), (years, math.inf), (0, -math.inf)]:
            made = write(first, 200, series=("a.x", "b.temperature"))
            assert made.rows is not None
            at_s = np.arange(200) // 2
            made.rows.stamps[:] = (START_S + at_s + first // 2 + shift_s) * 10**9
            made.rows.values[:] = 20.0 + np.sin(at_s)
            if odd is not None:
                made.rows.values[::3] = odd
            rig.commit(made)
            rig.watch.facts.heartbeat("r1")
            opened += [edge for edge in await rig.run_cycle() if edge.change == "opened"]
            first += 200
        assert opened == []
        assert rig.watch.describe()["rows"] == first - 1
