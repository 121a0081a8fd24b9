"""Wires anomalies and alerts: the inputs of the watch, what becomes of its findings, and who is notified.

Part of the wiring: it reads the living parts of other features, and belongs to none.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Collection, Mapping
from functools import partial
from typing import Any, Final, Protocol

from gateway.alerting.alerts.manager import AlertManager
from gateway.alerting.alerts.notices.routes import load_routes
from gateway.alerting.alerts.notices.service import Notices
from gateway.alerting.backtest import BacktestManager
from gateway.alerting.watch.clips import Clips
from gateway.alerting.watch.published import Published
from gateway.alerting.watch.remote_watch import ASK_S, RemoteWatch, answers
from gateway.alerting.watch.watch import Watch
from gateway.automation.events.recorder import EventRecorder
from gateway.cluster.ports import Mesh
from gateway.domain.alert import Alert
from gateway.domain.channel import METRIC_STREAM
from gateway.domain.fleet.twin import Reported
from gateway.errors import StoreError
from gateway.fleet.presence import Presence
from gateway.fleet.ros.feature import RosFeature
from gateway.fleet.twins.feature import Twins
from gateway.history.recordings.manager import RecordingManager
from gateway.identity.manager import IdentityManager
from gateway.ingest.registry import Registry, RobotRecord
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.writes import Committed, StreamWrite
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.link import CHANNEL_MASK

__all__ = ["Alerting", "Dependencies"]

log = logging.getLogger(__name__)

LOOK_S: Final = 1.0
PRESENCE_S: Final = 2.0
AT_ONCE: Final = 64  # robots that are looked at before others have their turn on the event loop
TOPICS_AT_ONCE: Final = 512
COHORT_LABELS: Final = ("cohort", "model")  # the first one that a robot has says with whom it is compared


class Dependencies(Protocol):
    """The parts of the gateway that this needs."""

    store: Store
    registry: Registry
    recordings: RecordingManager
    events: EventRecorder
    presence: Presence
    twins: Twins
    ros: RosFeature
    identities: IdentityManager


class Alerting:
    """Alerts, watch, notices, clips and backtests; lives on the event loop."""

    def __init__(self, settings: Settings, dependencies: Dependencies, *, clock: Clock) -> None:
        store = dependencies.store
        self._dependencies = dependencies
        self._clock = clock
        self._statistics: dict[str, link_pb2.TopicStatistics] = {}
        self._published = Published()
        self._gone: set[str] = set()  # robots that are not to be judged any more
        self._moving = store.shared and settings.alerts  # robots' detectors move between gateways
        self._looked_s = -PRESENCE_S
        self.manager = AlertManager(
            store, clock=clock, emit=dependencies.events.journal.emit, topics_of=self._published.topics_of
        )
        self.clips = Clips(self._request, self._attach, clock=clock)
        self.watch = Watch(
            settings.data_dir / "watch",
            store,
            clock=clock,
            report=self.manager.report,
            clip=self.clips.take,
            stream_name=self._stream_name,
            on=settings.alerts,
            where=RobotLocations(dependencies) if store.shared else None,
            gained=self._on_gained,
            lost=self._on_lost,
        )
        routes = load_routes(settings.notify) if settings.notify is not None else ()
        self.notices = Notices(self.manager, store, routes=routes, clock=clock)
        self.backtests = BacktestManager(store, clock=clock, checks=self.watch.table)
        self.manager.on_change(self._on_alerts)
        self.manager.listen(self.clips.on_alert)
        dependencies.twins.cache.watch(self._on_report)

    def join(self, mesh: Mesh) -> None:
        """Answer what other gateways ask about robots that are judged here, and ask them; before the mesh starts."""
        for verb, answer in answers(self.watch).items():
            mesh.on_request(verb, answer)
        self.watch.remote = RemoteWatch(self._dependencies.store, partial(mesh.request, timeout_s=ASK_S))

    async def start(self) -> None:
        """Before the first commit."""
        await self.manager.start(adopt=not self._moving)
        self.clips.resume(self.manager.known())
        await self.notices.start()
        await self.watch.start()
        alerted = {alert.robot for alert in self.manager.known()}
        await self.watch.ensure_evaluated([robot for robot in alerted if robot])

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            for part in (self.manager, self.notices, self.watch, self.clips):
                group.create_task(part.run())
            if self.watch.on:
                group.create_task(self._look_on())

    async def close(self) -> None:
        """Judge no more, and store what was found last."""
        await self.watch.close()
        self.backtests.close()
        await self.notices.close()
        await self.manager.close()

    def on_committed(self, done: Committed) -> None:
        """The store has more."""
        self.watch.on_committed(done)

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link to this gateway came or went."""
        if not self.watch.on:
            return
        self.watch.facts.add("link", robot, online, self._now_s())
        if online:
            self._gone.discard(robot)
            self._statistics.pop(robot, None)

    def describe(self, robot: str) -> Mapping[str, int]:
        """How many alerts a robot has that are not over."""
        return self.manager.robot_counts(robot)

    async def look(self) -> None:
        """Tell the watch who lives, how often topics come, and whom it has not to care for."""
        await self._look_elsewhere()
        for position, record in enumerate(self._dependencies.registry.all()):
            if position % AT_ONCE == AT_ONCE - 1:
                await asyncio.sleep(0)
            robot = record.robot.id
            if record.here:
                self.watch.facts.heartbeat(robot)
                self.watch.facts.cohort(robot, _cohort(self._dependencies.twins.labels_of(robot)))
                await self._look_at_graph(robot)
                await self._look_at_rates(record)
            elif not self._moving and robot not in self._gone and self._is_revoked(robot):
                self._gone.add(robot)
                self.watch.facts.forget(robot)
                self.manager.adopt(
                    robot
                )  # no gateway will report on it any more: its alerts end with their grace period

    async def _look_on(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            await self.look()

    async def _look_elsewhere(self) -> None:
        now_s = self._clock.monotonic_s()
        if not self._dependencies.store.shared or now_s - self._looked_s < PRESENCE_S:
            return
        self._looked_s = now_s
        try:
            await self._dependencies.presence.look()
        except StoreError as error:
            log.debug("where robots are is not known: %s", error)

    async def _look_at_rates(self, record: RobotRecord) -> None:
        """How often each topic is published, once for each time its agent says so."""
        statistics = record.statistics
        if self._statistics.get(record.robot.id) is statistics or not statistics.HasField("link"):
            return
        self._statistics[record.robot.id] = statistics
        rates: dict[str, float] = {}
        for position, rate in enumerate(statistics.topics):
            if position % TOPICS_AT_ONCE == TOPICS_AT_ONCE - 1:
                await asyncio.sleep(0)
            state = record.channels.get(rate.channel_id)
            if state is not None and not state.channel.history:
                rates[state.channel.topic] = max(rate.rate_hz, rates.get(state.channel.topic, 0.0))
        self.watch.facts.rates(record.robot.id, rates, self._now_s() - statistics.link.clock_offset_ns / 1e9)

    def _on_gained(self, robot: str) -> None:
        """From now on its detectors are this gateway's, and what is open of it is told again."""
        self.manager.adopt(robot)
        self._statistics.pop(robot, None)
        record = self._dependencies.registry.find(robot)
        if record is not None and record.here:
            self.watch.facts.add("link", robot, True, self._now_s())

    def _on_lost(self, robot: str) -> None:
        """From now on its detectors are another gateway's, or nobody's."""
        if self._is_revoked(robot):
            self.manager.adopt(robot)  # no gateway will report on it any more: its alerts end with their grace period
        else:
            self.manager.release(robot)

    def _is_revoked(self, robot: str) -> bool:
        return self._dependencies.identities.robots.enrolled_ns(robot) is None

    def _on_report(self, before: Reported | None, after: Reported) -> None:
        """A robot said what it is."""
        if self.watch.on:
            self.watch.facts.report(before, after, self._now_s())

    async def _look_at_graph(self, robot: str) -> None:
        """Who publishes what, where the graph is another than before; others have a turn after it, as it is large."""
        graph = self._dependencies.ros.graphs.of(robot)
        if not self._published.knows(robot, graph.revision):
            nodes = {topic: [end.node for end in ends] for topic, ends in graph.publishers.items()}
            self._published.learn(robot, graph.revision, nodes)
            await asyncio.sleep(0)

    def _on_alerts(self, robot: str) -> None:
        """Whoever looks at the robot sees another count."""
        record = self._dependencies.registry.find(robot)
        if record is not None:
            record.revision += 1

    async def _request(self, robot: str, span_ns: tuple[int, int]) -> Any:
        return await self._dependencies.recordings.request(robot, span_ns=span_ns)

    async def _attach(self, alert_id: str, recording_id: str) -> Alert:
        return await self.manager.attach_clip(alert_id, recording_id)

    def _stream_name(self, write: StreamWrite) -> str:
        """A stream as people call it: its topic."""
        number, record = write.stream_id & CHANNEL_MASK, self._dependencies.registry.find(write.robot)
        if number == METRIC_STREAM:
            return "metrics"
        state = record.channels.get(number) if record is not None else None
        return state.channel.topic if state is not None else f"stream {number}"

    def _now_s(self) -> float:
        return self._clock.wall_ns() / 1e9


class RobotLocations:
    """Which gateway robots are linked to, for those that move between gateways."""

    def __init__(self, dependencies: Dependencies) -> None:
        self._dependencies = dependencies

    def local(self) -> Collection[str]:
        """The robots that are linked to this gateway."""
        return {record.robot.id for record in self._dependencies.registry.all() if record.here}

    def is_remote(self, robot: str) -> bool:
        """Whether it is linked to another gateway of the store, as far as that is known here."""
        record = self._dependencies.registry.find(robot)
        if record is not None and record.here:
            return False
        return bool(record is not None and record.owner_gateway) or self._dependencies.presence.of(robot)[0]

    def expected(self, robot: str) -> bool:
        """Whether it may ever come: it was not revoked."""
        return self._dependencies.identities.robots.enrolled_ns(robot) is not None


def _cohort(labels: Mapping[str, str]) -> str:
    return next((f"{name}={labels[name]}" for name in COHORT_LABELS if labels.get(name)), "")
