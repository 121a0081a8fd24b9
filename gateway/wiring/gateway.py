"""Wires the gateway: the only place where features are connected to each other."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.api.open_connections import OpenConnections
from gateway.api.views.robots import robot_view
from gateway.automation.events.recorder import EventRecorder
from gateway.domain.channel import Channel
from gateway.domain.fleet.lease import LeaseTable
from gateway.domain.sample import Run
from gateway.errors import StoreError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.command_manager import CommandManager
from gateway.fleet.manager import FleetManager
from gateway.fleet.nodes.failover import Failover
from gateway.fleet.nodes.feature import Nodes
from gateway.fleet.presence import Presence
from gateway.fleet.rollouts.manager import RolloutManager
from gateway.fleet.rollouts.twin_backend import TwinBackend
from gateway.fleet.ros.feature import RosFeature
from gateway.fleet.talk import TalkManager
from gateway.fleet.teleop import TeleopManager
from gateway.fleet.twins.feature import Twins
from gateway.fleet.updates.repository import Repository
from gateway.fleet.updates.tokens import FetchTokens
from gateway.history.manager import HistoryManager
from gateway.history.recordings.manager import RecordingManager
from gateway.identity.accounts import Accounts
from gateway.identity.audit import AuditLog
from gateway.identity.authenticator import Authenticator
from gateway.identity.local_key import AuthenticatorChain, LocalKey
from gateway.identity.manager import IdentityManager
from gateway.identity.master import MasterKey
from gateway.identity.master_key_check import check_master
from gateway.identity.oidc.client import OidcClient
from gateway.identity.oidc.settings import OidcSettings
from gateway.identity.passwords import Passwords
from gateway.identity.store_authenticator import StoreAuthenticator
from gateway.identity.tickets import Tickets
from gateway.ingest.links import LinkHooks, Links
from gateway.ingest.quota import Quota
from gateway.ingest.registry import Registry
from gateway.live.demand_manager import DemandManager
from gateway.live.hub import Hub
from gateway.server.bind_address import can_sign_in, check_binding
from gateway.server.tls import HttpTls, http_tls
from gateway.settings import Settings, is_loopback
from gateway.store import Store
from gateway.store.fleet.updates import give_duties
from gateway.store.objects import open_objects
from gateway.store.private_dir import make_private
from gateway.store.retention import retention_of
from gateway.store.storage import Storage, StorageManager
from gateway.store.writes import Committed
from gateway.wiring.alerting import Alerting
from gateway.wiring.automation import Automation
from gateway.wiring.cluster import Cluster
from gateway.wiring.ops import Operations, Parts
from gateway.wiring.options import identity_choices, rates_of
from gateway.wiring.recordings import robot_link
from gateway.wiring.stored_robots import load_robots
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Gateway"]

TICK_S = 0.25


class Gateway:
    """Everything but the listening sockets: start, run beside the servers, stop."""

    def __init__(
        self,
        settings: Settings,
        *,
        clock: Clock,
        authenticator: Authenticator | None = None,
        passwords: Passwords | None = None,
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
        self.storage = StorageManager(self.store, account, clock=clock)
        self.history = HistoryManager(self.store)
        self.registry = Registry()
        self.hub = Hub(clock=clock, tick_s=settings.tick_s)
        self._master = master = MasterKey.load_or_make(settings.data_dir, settings.master_key)
        self.automation = Automation(settings, self.store, self.objects, master, emit=self._emit, clock=clock)
        self.events = EventRecorder(self.store, clock=clock, within=self.automation.rules.engine.on_events)
        self.leases = LeaseTable(valid_s=LIMITS.lease_s, listener=self.events.on_lease)
        self.talks = LeaseTable(valid_s=LIMITS.lease_s, endpoint="talk", doing="is talking through")
        beat_s = settings.heartbeat_s
        limits = replace(LIMITS, heartbeat_s=beat_s, dead_after_s=3 * beat_s)
        self.identities = IdentityManager(self.store, settings.data_dir, identity_choices(settings), clock=clock)
        self._make_robots(limits)
        self.local_key = LocalKey(settings.data_dir)
        stored = StoreAuthenticator(self.store, clock=clock)
        self.accounts = Accounts(self.store, stored, master, clock=clock, passwords=passwords)
        self.audit = AuditLog(self.store, self.objects, clock=clock, seal=master)
        provider = OidcSettings.load(settings.oidc) if settings.oidc is not None else None
        self.oidc = OidcClient(provider, master, clock=clock) if provider is not None else None
        self._make_updates(master)
        self.alerting = Alerting(settings, self, clock=clock)
        self.tickets = Tickets(self.store, clock=clock)
        self.authenticator = AuthenticatorChain(
            self.local_key, self.fetch_tokens, self.tickets, stored, *filter(None, [authenticator])
        )
        self.open_connections = OpenConnections(self.authenticator)
        self.rates = rates_of(settings, clock)
        self.demand = DemandManager(
            self.hub, online=self._online, channels_of=self._channels_of, send=self.links.send, clock=clock
        )
        self.cluster = Cluster(settings, self, master, clock=clock)
        self.tls: HttpTls | None = None  # of the HTTP port, once started
        self.operations = self._make_operations()
        self._extra_authenticator = authenticator is not None
        self.grpc_port = self.programs_port = 0  # where robots and programs connect, once the servers are bound

    def _make_robots(self, limits: Limits) -> None:
        quota = Quota(messages_per_s=self.settings.robot_messages_per_s, bytes_per_s=self.settings.robot_bytes_per_s)
        self.links = Links(
            self.registry,
            self.store,
            self._hooks(),
            clock=self.clock,
            quota=quota,
            authenticator=self.identities.robots,
            limits=limits,
        )
        self.commands = CommandDispatcher(self._send, clock=self.clock)
        self.teleop = TeleopManager(self.registry.get, self.commands, self.leases, self._send, clock=self.clock)
        self.talk = TalkManager(self.registry.get, self.commands, self.talks, self._send, clock=self.clock)
        self.fleet = FleetManager(
            self.registry.get,
            self.commands,
            self.leases,
            self.talks,
            clock=self.clock,
            actuator_topics=self.settings.actuator_topics,
        )
        self.ros = RosFeature(self.registry.get, self.commands, self.fleet, self._send, clock=self.clock)
        self.teleop.use_graphs(self.ros.graphs.of)
        self.command_manager = CommandManager(
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
        self.twins.cache.watch(self.events.on_twin)
        self.failover = Failover(self.store, self.twins, self.links.send, clock=self.clock)
        parts = (self.twins, self.registry.get, self.commands, self.fleet, self.command_manager)
        self.nodes = Nodes(*parts, clock=self.clock, holder_of=self.failover.holder_of, emit=self._emit)
        side, folder = robot_link(self.registry, self.links, self.commands), self.settings.data_dir / "incoming"
        self.recordings = RecordingManager(self.store, self.objects, folder, side, clock=self.clock, limits=limits)
        self.recordings.listen(self.events.on_recording)

    def _make_updates(self, master: MasterKey) -> None:
        folder, clock = self.settings.data_dir / "updates", self.clock
        self.updates = Repository(self.store, self.objects, master, folder, clock=clock)
        self.fetch_tokens = FetchTokens(self.store, clock=clock, enrolled_ns=self.identities.robots.enrolled_ns)
        self.presence = Presence(self.store, self._presence, clock=clock)
        side = TwinBackend(self.store, self.twins, self.presence, self._every_robot, self.updates.available)
        self.rollouts = RolloutManager(self.store, side, clock=clock, changed=self.events.on_rollout)

    def _make_operations(self) -> Operations:
        parts = Parts(
            registry=self.registry,
            store=self.store,
            storage=self.storage,
            hub=self.hub,
            audit=self.audit,
            leases=self.leases,
            checks=self.checks,
            automation=self.automation.measure,
            cluster=self.cluster.measure,
        )
        return Operations(self.settings, parts, clock=self.clock)

    async def start(self) -> None:
        """Load the stored robots; start the store."""
        commit_hook = self.automation.commit_hook()
        self.store.start(self._on_committed, self.links.refused, self.alerting.watch.ahead, commit_hook)
        await check_master(self.store, self._master, required=bool(self.settings.cluster))
        await self._check_binding()
        self.local_key.write()
        await self.identities.start()
        await self._start_tls()
        await self.twins.start()
        await self.events.start()
        await self.alerting.start()
        self.updates.uploads.clean()
        await self.fetch_tokens.load()
        await self.tickets.load()
        await load_robots(self.store, self.registry)
        await self.automation.start(self)
        self.cluster.start()

    async def _check_binding(self) -> None:
        if is_loopback(self.settings.host):
            return
        now_ns = self.clock.wall_ns()
        known = self._extra_authenticator or await self.store.read(lambda engine: can_sign_in(engine, now_ns=now_ns))
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
            for service in (
                self.rollouts,
                self.presence,
                self.command_manager,
                self.open_connections,
                self.audit,
                self.operations,
            ):
                group.create_task(service.run())
            group.create_task(self.alerting.run())
            group.create_task(self.automation.run())
            group.create_task(self.cluster.run())
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
        await self.cluster.close()
        with contextlib.suppress(StoreError):
            await self.automation.close()
            await self.alerting.close()
        with contextlib.suppress(StoreError):
            await self.twins.close()
            if self.store.shared:
                await self.store.run(lambda engine: give_duties(engine, self.store.gateway_id))
            await self.presence.close()
        await self.command_manager.close()
        await self.events.close()
        await self.audit.close()
        await self.store.close()
        await asyncio.to_thread(self.objects.close)

    def describe(self, robot_id: str) -> dict[str, Any]:
        """A robot as the API shows it."""
        now_s = self.clock.monotonic_s()
        lease = self.leases.holder_of(robot_id, now_s=now_s)
        view = robot_view(self.registry.get(robot_id), lease, now_s=now_s, alerts=self.alerting.describe(robot_id))
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
            on_ros=lambda robot, frame: self.cluster.on_ros(robot, frame),
            fetch_token=lambda robot: self.fetch_tokens.make(robot),
        )

    def _emit(self, kind: str, robot: str, data: Mapping[str, Any]) -> None:
        self.events.journal.emit(kind, robot, data)

    def _send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        self.cluster.send(robot_id, frame)

    def _on_values(self, robot_id: str, values: dict[str, tuple[int, float]]) -> None:
        self.hub.values(robot_id, values)
        self.cluster.on_values(robot_id, values)

    def _on_channels(self, robot_id: str) -> None:
        self.demand.channels_changed(robot_id)
        self.cluster.on_channels(robot_id)

    def _on_samples(self, run: Run) -> None:
        self.hub.publish(run)
        self.cluster.on_samples(run)
        self.operations.on_samples(run)

    def _on_committed(self, done: Committed) -> None:
        self.links.committed(done)
        self.operations.on_committed(done)
        self.alerting.on_committed(done)
        self.automation.on_committed(done)

    def _on_result(self, robot_id: str, result: link_pb2.CommandResult) -> None:
        if self.cluster.on_result(robot_id, result):
            return
        if result.running or not self.commands.on_result(robot_id, result):
            self.command_manager.delivery.on_result(robot_id, result)

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
        self.alerting.on_online(robot_id, online)
        self.command_manager.delivery.on_online(robot_id, online)
        self.demand.link_changed(robot_id)
        self.cluster.on_online(robot_id, online)

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK_S)
            self.links.tick()
            self.leases.expire(now_s=self.clock.monotonic_s())
            self.talks.expire(now_s=self.clock.monotonic_s())
