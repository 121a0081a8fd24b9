"""What a dry run looks at: events, samples and values of the past, by their time."""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np

from gateway.automation.rules.metric_event import metric_event
from gateway.automation.rules.rule import Rule
from gateway.automation.sample_events import SampleReader
from gateway.domain.automation.gateway_event import SCHEDULE, GatewayEvent, Span
from gateway.domain.automation.shapes import moment
from gateway.domain.sample import Sample
from gateway.store.automation.gateway_events import Cursor, read_gateway_events
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.query import SeriesFacts, StoredRobot
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun
from gateway.store.telemetry.series import Method, SeriesRange
from metaros.idl.globs import Glob
from metaros.limits import Limits

__all__ = ["History", "gateway_events", "samples", "schedule", "values"]

Result = TypeVar("Result")
PAGE = 1000
MOST_ROBOTS = 256
MOST_TIMES = 10_000


class History(Protocol):
    """What is needed of the store."""

    async def read_slowly(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""

    async def robots(self) -> list[StoredRobot]:
        """Every robot that ever connected."""

    async def runs(self, robot_id: str, wanted: SampleFilter | None = None, *, limit: int) -> list[StoredRun]:
        """Runs of the robot's messages, by their lowest stamps."""

    async def load(self, run: StoredRun) -> StoredBatch:
        """A run's samples."""

    async def series(self, robot_id: str) -> list[SeriesFacts]:
        """The robot's series."""

    async def range(
        self,
        robot_id: str,
        names: Sequence[str],
        *,
        start_ns: int,
        end_ns: int,
        points: int,
        method: Method,
    ) -> list[SeriesRange]:
        """Series between two stamps."""


async def gateway_events(history: History, from_ns: int, until_ns: int) -> AsyncIterator[GatewayEvent]:
    """What the journal has, and what was kept besides."""
    after: Cursor | None = None
    span = Span(from_ns=from_ns, to_ns=until_ns)
    while True:
        cursor = after

        def job(engine: StoreEngine, cursor: Cursor | None = cursor) -> list[tuple[Cursor, GatewayEvent]]:
            with engine.transaction(write=False):
                return read_gateway_events(engine, span, after=cursor, limit=PAGE)

        page = await history.read_slowly(job)
        for _, gateway_event in page:
            yield gateway_event
        if len(page) < PAGE:
            return
        after = page[-1][0]


async def schedule(rule: Rule, from_ns: int, until_ns: int) -> AsyncIterator[GatewayEvent]:
    """The times of a rule's schedule."""
    assert rule.schedule is not None
    at_ns = rule.schedule.schedule.next_after(from_ns - 1)
    for _ in range(MOST_TIMES):
        if at_ns is None or at_ns >= until_ns:
            return
        yield GatewayEvent(
            id=f"{rule.name}/{moment(at_ns, 'seconds')}", type=SCHEDULE, source="metaros.schedule", at_ns=at_ns
        )
        at_ns = rule.schedule.schedule.next_after(at_ns)


async def samples(
    history: History, rule: Rule, from_ns: int, until_ns: int, limits: Limits
) -> AsyncIterator[GatewayEvent]:
    """The messages of a rule's topic, of all its robots together."""
    assert rule.topic is not None
    glob, reader = Glob(rule.topic.topic), SampleReader(limits=limits)
    sources = [
        _robot_samples(history, robot, glob, reader, from_ns, until_ns) for robot in await _robots(history, rule)
    ]
    heap: list[tuple[int, int, GatewayEvent]] = []
    for number, source in enumerate(sources):
        async for first in source:
            heap.append((first.at_ns, number, first))
            break
    heapq.heapify(heap)
    while heap:
        _, number, gateway_event = heap[0]
        yield gateway_event
        following = await anext(sources[number], None)
        if following is None:
            heapq.heappop(heap)
        else:
            heapq.heapreplace(heap, (following.at_ns, number, following))


async def values(
    history: History, rule: Rule, from_ns: int, until_ns: int, limits: Limits
) -> AsyncIterator[GatewayEvent]:
    """The values of a rule's series, of all its robots together."""
    assert rule.metric is not None
    glob = Glob(rule.metric.series, separator=".")
    found: list[tuple[str, SeriesRange]] = []
    room = limits.rule_dry_rows
    for robot in await _robots(history, rule):
        names = [one.series.name for one in await history.series(robot) if glob.matches(one.series.name)]
        for name in names:
            span = {"start_ns": from_ns, "end_ns": until_ns - 1, "points": max(2, room)}
            found += [(robot, one) for one in await history.range(robot, [name], **span, method="lttb")]
            room -= len(found[-1][1].mean)
            if room <= 0:
                break
    if not found:
        return
    stamps = np.concatenate([np.round(one.stamp_ms * 1e6).astype(np.int64) for _, one in found])
    numbers = np.concatenate([one.mean for _, one in found])
    owners = np.concatenate([np.full(len(one.mean), place) for place, (_, one) in enumerate(found)])
    for place in np.argsort(stamps, kind="stable"):
        robot, one = found[int(owners[place])]
        yield metric_event(rule, robot, one.name, int(stamps[place]), float(numbers[place]))


async def _robots(history: History, rule: Rule) -> list[str]:
    known = [one.robot.id for one in await history.robots()]
    return [robot for robot in known if rule.about(robot)][:MOST_ROBOTS]


async def _robot_samples(
    history: History, robot: str, glob: Glob, reader: SampleReader, from_ns: int, until_ns: int
) -> AsyncIterator[GatewayEvent]:
    after = None
    while True:
        wanted = SampleFilter(start_ns=from_ns, end_ns=until_ns - 1, after=after)
        page = await history.runs(robot, wanted, limit=PAGE)
        for run in page:
            if glob.matches(run.channel.topic):
                batch = await history.load(run)
                for gateway_event in await asyncio.to_thread(_read, robot, batch, reader, from_ns, until_ns):
                    yield gateway_event
        if len(page) < PAGE:
            return
        after = page[-1].key()


def _read(robot: str, batch: StoredBatch, reader: SampleReader, from_ns: int, until_ns: int) -> list[GatewayEvent]:
    reader.begin()
    return [
        reader.read(
            robot,
            batch.stream_id,
            batch.epoch,
            Sample(batch.channel, seq, stamp_ns, batch.receive_ns, payload),
        )
        for seq, stamp_ns, payload in batch.samples()
        if from_ns <= stamp_ns < until_ns
    ]
