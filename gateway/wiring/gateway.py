"""The gateway's only wiring: features meet here and nowhere else."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from starlette.types import ASGIApp

from gateway.api import create_api
from gateway.api.attendance import Attendance
from gateway.api.services import Services
from gateway.api.views import robot_view
from gateway.binding import can_sign_in, check_binding
from gateway.choices import identity_choices, rates_of
from gateway.clustering import Clustering
from gateway.domain.channel import Channel
from gateway.domain.lease import LeaseTable
from gateway.domain.sample import Run
from gateway.errors import StoreError
from gateway.events.feature import Events
from gateway.fleet.commands import CommandDesk
from gateway.fleet.desk import FleetDesk
from gateway.fleet.failover import Failover
from gateway.fleet.node_feature import Nodes
from gateway.fleet.orders import OrderDesk
from gateway.fleet.presence import Presence
from gateway.fleet.rollout_side import TwinSide
from gateway.fleet.rollouts import RolloutDesk
from gateway.fleet.ros_side import RosSide
from gateway.fleet.talk import TalkDesk
from gateway.fleet.teleop import TeleopDesk
from gateway.fleet.twin_feature import Twins
from gateway.history.desk import HistoryDesk
from gateway.identity.accounts import Accounts
from gateway.identity.audit import AuditLog
from gateway.identity.desk import IdentityDesk
from gateway.identity.door import Door
from gateway.identity.local import Doors, LocalKey
from gateway.identity.master import MasterKey
from gateway.identity.oidc import OidcClient
from gateway.identity.oidc_settings import OidcSettings
from gateway.identity.passwords import Passwords
from gateway.identity.shared_key import check_master
from gateway.identity.store_door import StoreDoor
from gateway.identity.tickets import Tickets
from gateway.ingest.links import LinkHooks, Links
from gateway.ingest.quota import Quota
from gateway.ingest.registry import Registry
from gateway.known_robots import load_robots
from gateway.live.demand_desk import DemandDesk
from gateway.live.hub import Hub
from gateway.objects import open_objects
from gateway.operations import Operations, Parts
from gateway.private_dir import make_private
from gateway.reacting import Reacting
from gateway.recordings.desk import RecordingDesk
from gateway.robot_side import robot_side
from gateway.services_of import services_of
from gateway.settings import Settings, is_loopback
from gateway.store import Store
from gateway.store.retention import retention_of
from gateway.store.storage import Storage, StorageDesk
from gateway.store.updates import give_duties
from gateway.store.writes import Committed
from gateway.tls import HttpTls, http_tls
from gateway.updates.repository import Repository
from gateway.updates.tokens import FetchTokens
from gateway.watching import Watching
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Gateway"]

TICK_S = 0.25


class Gateway:
    """Everything but the listening sockets: start, run beside the servers, stop."""

    def __init__(
        self, settings: Settings, *, clock: Clock, door: Door | None = None, passwords: Passwords | None = None
    ) -> None:
        self.settings = settings
        self.clock = clock
        retention = retention_of(settings)
        make_private(settings.data_dir)
        self.objects = open_objects(settings.objects_url, settings.data_dir)
        self.store = Store(
            settings.data_dir,
            clock=clock,
            retention=retention,
            queue_bytes=settings.store_queue_bytes,
            url=settings.store_url,
            objects=self.objects,
        )
        account = Storage(retention=retention, objects=self.objects, data_dir=settings.data_dir)
        self.storage = StorageDesk(self.store, account, clock=clock)
        self.history = HistoryDesk(self.store)
        self.registry = Registry()
        self.hub = Hub(clock=clock, tick_s=settings.tick_s)
        self._master = master = MasterKey.load_or_make(settings.data_dir, settings.master_key)
        self.reacting = Reacting(settings, self.store, self.objects, master, emit=self._emit, clock=clock)
        self.events = Events(self.store, clock=clock, within=self.reacting.rules.engine.on_events)
        self.leases = LeaseTable(valid_s=LIMITS.lease_s, listener=self.events.on_lease)
        self.talks = LeaseTable(valid_s=LIMITS.lease_s, door="talk", doing="is talking through")
        beat_s = settings.heartbeat_s
        limits = replace(LIMITS, heartbeat_s=beat_s, dead_after_s=3 * beat_s)
        self.identities = IdentityDesk(self.store, settings.data_dir, identity_choices(settings), clock=clock)
        self._make_robots(limits)
        self.local_key = LocalKey(settings.data_dir)
        stored = StoreDoor(self.store, clock=clock)
        self.accounts = Accounts(self.store, stored, master, clock=clock, passwords=passwords)
        self.audit = AuditLog(self.store, self.objects, clock=clock, seal=master)
        provider = OidcSettings.load(settings.oidc) if settings.oidc is not None else None
        self.oidc = OidcClient(provider, master, clock=clock) if provider is not None else None
        self._make_updates(master)
        self.watching = Watching(settings, self, clock=clock)
        self.tickets = Tickets(self.store, clock=clock)
        self.door = Doors(self.local_key, self.fetch_tokens, self.tickets, stored, *filter(None, [door]))
        self.attendance = Attendance(self.door)
        self.rates = rates_of(settings, clock)
        self.demand = DemandDesk(
            self.hub, online=self._online, channels_of=self._channels_of, send=self.links.send, clock=clock
        )
        self.clustering = Clustering(settings, self, master, clock=clock)
        self.tls: HttpTls | None = None  # of the HTTP port, once started
        self.operations = self._make_operations()
        self._guests = door is not None
        self.grpc_port = self.programs_port = 0  # where robots and programs connect, once the servers are bound

    @property
    def api(self) -> ASGIApp:
        """The HTTP and WebSocket application."""
        return create_api(self.services)

    def _make_robots(self, limits: Limits) -> None:
        quota = Quota(messages_per_s=self.settings.robot_messages_per_s, bytes_per_s=self.settings.robot_bytes_per_s)
        self.links = Links(
            self.registry,
            self.store,
            self._hooks(),
            clock=self.clock,
            quota=quota,
            gate=self.identities.robots,
            limits=limits,
        )
        self.commands = CommandDesk(self._send, clock=self.clock)
        self.teleop = TeleopDesk(self.registry.get, self.commands, self.leases, self._send, clock=self.clock)
        self.talk = TalkDesk(self.registry.get, self.commands, self.talks, self._send, clock=self.clock)
        self.fleet = FleetDesk(
            self.registry.get,
            self.commands,
            self.leases,
            self.talks,
            clock=self.clock,
            actuator_topics=self.settings.actuator_topics,
        )
        self.ros = RosSide(self.registry.get, self.commands, self.fleet, self._send, clock=self.clock)
        self.orders = OrderDesk(
            self.store,
            self.commands,
            self.fleet,
            self.registry.get,
            self.links.send,
            clock=self.clock,
            local={"save_recording": self._save_recording},
            ended=self.events.on_command,
            limits=limits,
        )
        self.twins = Twins(self.store, self.links.send, self._labels_said, clock=self.clock)
        self.twins.book.watch(self.events.on_twin)
        self.failover = Failover(self.store, self.twins, self.links.send, clock=self.clock)
        parts = (self.twins, self.registry.get, self.commands, self.fleet, self.orders)
        self.nodes = Nodes(*parts, clock=self.clock, holder_of=self.failover.holder_of, emit=self._emit)
        side, folder = robot_side(self.registry, self.links, self.commands), self.settings.data_dir / "incoming"
        self.recordings = RecordingDesk(self.store, self.objects, folder, side, clock=self.clock, limits=limits)
        self.recordings.listen(self.events.on_recording)

    def _make_updates(self, master: MasterKey) -> None:
        folder, clock = self.settings.data_dir / "updates", self.clock
        self.updates = Repository(self.store, self.objects, master, folder, clock=clock)
        self.fetch_tokens = FetchTokens(self.store, clock=clock, enrolled_ns=self.identities.robots.enrolled_ns)
        self.presence = Presence(self.store, self._presence, clock=clock)
        side = TwinSide(self.store, self.twins, self.presence, self._every_robot, self.updates.available)
        self.rollouts = RolloutDesk(self.store, side, clock=clock, changed=self.events.on_rollout)

    def _make_operations(self) -> Operations:
        parts = Parts(
            registry=self.registry,
            store=self.store,
            storage=self.storage,
            hub=self.hub,
            audit=self.audit,
            leases=self.leases,
            checks=self.checks,
            reacting=self.reacting.measure,
            clustering=self.clustering.measure,
        )
        return Operations(self.settings, parts, clock=self.clock)

    @cached_property
    def services(self) -> Services:
        """Every feature behind a route or an RPC."""
        return services_of(self)

    async def start(self) -> None:
        """Know the robots of earlier days; start the store."""
        within = self.reacting.within()
        self.store.start(self._on_committed, self.links.refused, self.watching.watch.ahead, within)
        await check_master(self.store, self._master, required=bool(self.settings.cluster))
        await self._check_binding()
        self.local_key.write()
        await self.identities.start()
        await self._start_tls()
        await self.twins.start()
        await self.events.start()
        await self.watching.start()
        self.updates.shelf.clean()
        await self.fetch_tokens.load()
        await self.tickets.load()
        await load_robots(self.store, self.registry)
        await self.reacting.start(self)
        self.clustering.start()

    async def _check_binding(self) -> None:
        if is_loopback(self.settings.host):
            return
        now_ns = self.clock.wall_ns()
        known = self._guests or await self.store.read(lambda engine: can_sign_in(engine, now_ns=now_ns))
        check_binding(self.settings, somebody=known)

    async def _start_tls(self) -> None:
        own = self.settings
        if own.robots_tls:
            await self.identities.serve_as(own.server_names)
        if own.tls_on:
            self.tls = http_tls(
                lambda: self.identities.pair,
                lambda: self.identities.authorities.roots_pem,
                cert=own.tls_cert,
                key=own.tls_key,
                folder=own.data_dir,
                clock=self.clock,
            )

    async def run(self) -> None:
        """Heartbeats and demand, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._tick())
            group.create_task(self.demand.run())
            for part in (self.recordings, self.twins, self.failover, self.updates, self.events, self.ros):
                group.create_task(part.run())
            for desk in (self.rollouts, self.presence, self.orders, self.attendance, self.audit, self.operations):
                group.create_task(desk.run())
            group.create_task(self.watching.run())
            group.create_task(self.reacting.run())
            group.create_task(self.clustering.run())
            group.create_task(self.identities.run(self.links.recheck))

    async def stop(self) -> None:
        """Commit what is queued and close the store; the servers are down by now."""
        self.local_key.remove()
        self.accounts.close()
        self.hub.close()
        await self.operations.close()
        self.history.close()
        self.updates.close()
        await self.recordings.close()
        await self.clustering.close()
        with contextlib.suppress(StoreError):
            await self.reacting.close()
            await self.watching.close()
        with contextlib.suppress(StoreError):
            await self.twins.close()
            if self.store.shared:
                await self.store.run(lambda engine: give_duties(engine, self.store.gateway_id))
            await self.presence.close()
        await self.orders.close()
        await self.events.close()
        await self.audit.close()
        await self.store.close()
        await asyncio.to_thread(self.objects.close)

    def describe(self, robot_id: str) -> dict[str, Any]:
        """A robot as the API shows it."""
        now_s = self.clock.monotonic_s()
        lease = self.leases.holder_of(robot_id, now_s=now_s)
        view = robot_view(self.registry.get(robot_id), lease, now_s=now_s, alerts=self.watching.describe(robot_id))
        return {**view, "labels": self.twins.labels_of(robot_id)}

    def checks(self) -> dict[str, str]:
        """What `/readyz` says: "ok" or what is wrong, by part."""
        return {"store": self.store.error or "ok", **self.operations.checks()}

    def _hooks(self) -> LinkHooks:
        return LinkHooks(
            on_samples=self._on_samples,
            on_values=self._on_values,
            on_channels=self._on_channels,
            on_online=self._on_online,
            on_result=self._on_result,
            on_recording=lambda robot, part: self.recordings.on_part(robot, part),
            on_twin=lambda robot, report: self.twins.on_report(robot, report),
            on_leases=lambda robot, boot_ns: self.failover.on_answer(robot, boot_ns),
            on_ros=lambda robot, frame: self.clustering.on_ros(robot, frame),
            fetch_token=lambda robot: self.fetch_tokens.make(robot),
        )

    def _emit(self, kind: str, robot: str, data: Mapping[str, Any]) -> None:
        self.events.journal.emit(kind, robot, data)

    def _send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        self.clustering.send(robot_id, frame)

    def _on_values(self, robot_id: str, values: dict[str, tuple[int, float]]) -> None:
        self.hub.values(robot_id, values)
        self.clustering.on_values(robot_id, values)

    def _on_channels(self, robot_id: str) -> None:
        self.demand.channels_changed(robot_id)
        self.clustering.on_channels(robot_id)

    def _on_samples(self, run: Run) -> None:
        self.hub.publish(run)
        self.clustering.on_samples(run)
        self.operations.on_samples(run)

    def _on_committed(self, done: Committed) -> None:
        self.links.committed(done)
        self.operations.on_committed(done)
        self.watching.on_committed(done)
        self.reacting.on_committed(done)

    def _on_result(self, robot_id: str, result: link_pb2.CommandResult) -> None:
        if self.clustering.on_result(robot_id, result):
            return
        if result.running or not self.commands.on_result(robot_id, result):
            self.orders.delivery.on_result(robot_id, result)

    def _every_robot(self) -> list[str]:
        return [record.robot.id for record in self.registry.all()]

    def _presence(self, robot_id: str) -> tuple[bool, int]:
        record = self.registry.find(robot_id)
        return (record.here, record.since_ns) if record is not None else (False, 0)

    def _labels_said(self, robot_id: str) -> dict[str, str]:
        record = self.registry.find(robot_id)
        return dict(record.robot.labels) if record is not None else {}

    async def _save_recording(self, robot_id: str, request: Mapping[str, Any]) -> dict[str, str]:
        asked = await self.recordings.request(
            robot_id, last_s=float(request["last_s"]), topics=tuple(request.get("topics", ()))
        )
        return {"recording": asked.id}

    def _online(self) -> list[str]:
        return [record.robot.id for record in self.registry.all() if record.here]

    def _channels_of(self, robot_id: str) -> list[Channel] | None:
        record = self.registry.get(robot_id)
        return [state.channel for state in record.channels.values()] if record.here else None

    def _on_online(self, robot_id: str, online: bool) -> None:
        record = self.registry.get(robot_id)
        if online or not record.online:  # else it is at another gateway by now
            self.events.on_online(record.robot, online)
        if not online:
            self.commands.on_offline(robot_id)
            self.teleop.on_offline(robot_id)
            self.talk.on_offline(robot_id)
        self.recordings.on_online(robot_id, online)
        self.ros.on_online(robot_id, online)
        self.twins.on_online(robot_id, online)
        self.failover.on_online(robot_id, online)
        self.presence.on_online(robot_id)
        self.watching.on_online(robot_id, online)
        self.orders.delivery.on_online(robot_id, online)
        self.demand.link_changed(robot_id)
        self.clustering.on_online(robot_id, online)

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK_S)
            self.links.tick()
            self.leases.expire(now_s=self.clock.monotonic_s())
            self.talks.expire(now_s=self.clock.monotonic_s())
