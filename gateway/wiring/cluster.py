"""Wires this gateway to the others of its store: the mesh, remote robots, live data, requests.

Part of the wiring. Without `--cluster` there is no mesh, and every robot is here or nowhere.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Protocol

from gateway.automation.events.recorder import EventRecorder
from gateway.cluster.live import Live
from gateway.cluster.mesh import ZenohMesh
from gateway.cluster.mirror.mirror import Mirror
from gateway.cluster.relay.relays import LocalParts, Relays
from gateway.domain.sample import Run
from gateway.identity.master import MasterKey
from gateway.ingest.registry import Registry
from gateway.live.demand_manager import DemandManager
from gateway.live.hub import Hub
from gateway.ops.meters import Families
from gateway.settings import Settings
from gateway.store import Store
from gateway.wiring.alerting import Alerting
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Cluster", "Parts"]


class Parts(LocalParts, Protocol):
    """The parts of the gateway that take part in the cluster."""

    store: Store
    registry: Registry
    hub: Hub
    events: EventRecorder
    demand: DemandManager
    alerting: Alerting


class Cluster:
    """Lives on the event loop; made when the parts are, before any robot is let in."""

    def __init__(self, settings: Settings, parts: Parts, master: MasterKey, *, clock: Clock) -> None:
        self._parts = parts
        self.mesh: ZenohMesh | None = None
        if not settings.cluster:
            return
        store = parts.store
        self.mesh = mesh = ZenohMesh(
            settings.cluster, gateway_id=store.gateway_id, store_id=store.store_id, master=master, clock=clock
        )
        self._mirror = Mirror(mesh, parts.registry, parts.hub, clock=clock)
        self._live = Live(mesh, parts.registry, parts.hub, clock=clock, tick_s=settings.tick_s)
        self._relays = Relays(mesh, parts, owner_of=self._owner_of, clock=clock)
        parts.alerting.join(mesh)
        self._mirror.watch(self._live.on_owner)
        self._mirror.watch(self._relays.on_owner)
        self._mirror.on_remote_session(self._relays.on_remote_session)
        self._mirror.on_orphan(self._orphaned)
        self._live.on_wanted(parts.demand.wants_changed)
        self._live.on_key_wanted(parts.demand.key_wanted)
        parts.demand.others = self._live.wanted

    @property
    def owed(self) -> int:
        """How many results of robots that are linked here other gateways wait for."""
        return self._relays.owed if self.mesh is not None else 0

    def start(self) -> None:
        """Meet the others, in the background."""
        if self.mesh is not None:
            self.mesh.start()

    async def run(self) -> None:
        """Until cancelled."""
        if self.mesh is None:
            return
        async with asyncio.TaskGroup() as group:
            for part in (self.mesh, self._mirror, self._live, self._relays):
                group.create_task(part.run())

    async def close(self) -> None:
        """Leave the others."""
        if self.mesh is not None:
            await self.mesh.close()

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        """To a robot's control lane, wherever its link is; RobotOfflineError when it has none."""
        if self.mesh is None:
            self._parts.links.send(robot_id, frame)
        else:
            self._relays.send(robot_id, frame)

    def on_samples(self, run: Run) -> None:
        """Samples arrived here."""
        if self.mesh is not None:
            self._live.publish(run)

    def on_values(self, robot_id: str, values: Mapping[str, tuple[int, float]]) -> None:
        """Newest values of series arrived here."""
        if self.mesh is not None:
            self._mirror.on_values(robot_id, values)

    def on_channels(self, robot_id: str) -> None:
        """A robot that is linked here announced something."""
        if self.mesh is not None:
            self._mirror.on_channels(robot_id)

    def on_online(self, robot_id: str, online: bool) -> None:
        """A link here began or ended; the gateway's own features were notified before."""
        if self.mesh is not None:
            self._mirror.on_online(robot_id, online)
            self._relays.on_online(robot_id, online)

    def on_result(self, robot_id: str, result: link_pb2.CommandResult) -> bool:
        """A robot that is linked here answers; whether that was for another gateway."""
        return self.mesh is not None and self._relays.on_result(robot_id, result)

    def on_ros(self, robot_id: str, frame: link_pb2.AgentFrame) -> None:
        """A robot that is linked here tells of its graph, of goals or of offers."""
        if self.mesh is None:
            self._parts.ros.on_frame(robot_id, frame)
        else:
            self._relays.on_ros(robot_id, frame)

    def measure(self, found: Families) -> None:
        """What there is to count."""
        if (mesh := self.mesh) is None:
            return
        found.put("metaros_cluster_peers", len(mesh.peers()))
        found.put("metaros_cluster_robots", self._mirror.mirrored)
        found.put("metaros_cluster_sent_messages", mesh.counts.sent)
        found.put("metaros_cluster_sent_bytes", mesh.counts.sent_bytes)
        found.put("metaros_cluster_received_messages", mesh.counts.received)
        found.put("metaros_cluster_received_bytes", mesh.counts.received_bytes)
        found.put("metaros_cluster_asks", mesh.counts.asks)
        found.put("metaros_cluster_dropped_messages", mesh.counts.dropped)
        found.put("metaros_cluster_refused_messages", mesh.counts.refused)
        found.put("metaros_cluster_meetings_lost", mesh.counts.lost)
        found.put("metaros_cluster_live_samples", self._live.sent_samples)
        found.put("metaros_cluster_live_bytes", self._live.sent_bytes)
        found.put("metaros_cluster_live_dropped_samples", self._live.dropped_samples)
        found.put("metaros_queue_bytes", mesh.queued_bytes, "cluster")

    def _owner_of(self, robot_id: str) -> str:
        record = self._parts.registry.find(robot_id)
        return record.owner_gateway if record is not None else ""

    def _orphaned(self, robot_id: str) -> None:
        """A robot's gateway died, and it is nowhere else yet; one of the gateways that live says so."""
        self._parts.events.on_online(self._parts.registry.get(robot_id).robot, False)
