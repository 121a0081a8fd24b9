"""The agent program's only wiring: settings in, running parts, clean end on SIGINT or SIGTERM."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Coroutine, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from edge_agent.blackbox.saver import Saver
from edge_agent.blackbox.setup import open_box, open_recordings
from edge_agent.commands.dispatcher import CommandDispatcher
from edge_agent.commands.drive_watchdog import DriveGuard
from edge_agent.commands.publishers import Publishers
from edge_agent.commands.talk_watchdog import TalkGuard
from edge_agent.commands.teleop import Teleop
from edge_agent.config.gateway_address import GatewayAddress
from edge_agent.config.settings import Settings
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.host_metrics import publish_host
from edge_agent.forwarding.host_metrics_election import election_lock, hold_leadership
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Pipeline
from edge_agent.forwarding.sample_trace import Tracer
from edge_agent.forwarding.scope import Scope
from edge_agent.forwarding.sealing import open_sealing
from edge_agent.forwarding.tap import Tap
from edge_agent.identity.credentials import Credentials, check_addresses, enrolled_addresses
from edge_agent.identity.files import IdentityFiles
from edge_agent.identity.renewal_task import RenewalTask
from edge_agent.link.budget import Budget
from edge_agent.link.byte_budget_override import UplinkLimit
from edge_agent.nodes.setup import open_nodes
from edge_agent.outbox import OutboxWriter
from edge_agent.ros.manager import RosManager
from edge_agent.ros.zenoh_profile import session_environ
from edge_agent.state.state import AgentState, open_state
from edge_agent.status.query import answering
from edge_agent.status.status_file import status_file
from edge_agent.twin.services import RosServices
from edge_agent.update.restart import RESTART
from edge_agent.update.setup import open_updates
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import DATA, Identity
from edge_agent.uplink.session_manager import SessionManager
from edge_agent.uplink.uplink import Uplink, transports_with
from edge_agent.video.manager import VideoManager
from metaros.clock import Clock, SystemClock, system_rng
from metaros.concurrency.signals import on_stop
from metaros.errors import ConfigError
from metaros.executor.switch_interval import SWITCH_INTERVAL_S, shorten_switch_interval
from metaros.limits import LIMITS, Limits
from metaros.node import Context, Node

__all__ = ["run", "run_agent"]

NODE_NAME, HOST_NODE_NAME = "metaros_agent", "host"


def run(settings: Settings) -> None:
    """Run the agent until SIGINT or SIGTERM."""
    shorten_switch_interval(SWITCH_INTERVAL_S)  # else live samples wait whenever the outbox's threads compute
    asyncio.run(run_until_signal(settings))
    RESTART.finish()


async def run_until_signal(settings: Settings) -> None:
    """Run the agent; the signals end it as a cancellation, so that every part closes what it opened."""
    agent = asyncio.ensure_future(run_agent(settings))
    on_stop(asyncio.get_running_loop(), agent.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await agent


async def run_agent(settings: Settings, *, clock: Clock | None = None, limits: Limits = LIMITS) -> None:
    """Tap, queues, uplink, commands and host metrics around one Zenoh session; until cancelled."""
    clock = clock or SystemClock()
    with contextlib.ExitStack() as stack:
        state = await open_state(settings, clock, stack, limits=limits)
        context = stack.enter_context(
            Context(
                connect=[f"tcp/127.0.0.1:{settings.zenoh_port}"],
                clock=clock,
                shared_memory="off",
                environ=session_environ(settings, enrolled=IdentityFiles(state.directory).exists()),
            )
        )
        node = stack.enter_context(
            Node(NODE_NAME, namespace=settings.namespace, context=context, enable_parameters=False)
        )
        await run_parts(settings, state, node, clock)


async def run_host(settings: Settings, context: Context, channels: Channels, clock: Clock) -> None:
    """Publish this host's metrics, when it is our turn, as a node of their own."""
    path = election_lock(zenoh_port=settings.zenoh_port, domain=context.domain_id, namespace=settings.namespace)
    async with hold_leadership(path):
        with Node(
            HOST_NODE_NAME,
            namespace=settings.namespace,
            context=context,
            enable_rosout=False,
            enable_parameters=False,
        ) as host:
            await publish_host(host, channels, clock)


async def run_parts(settings: Settings, state: AgentState, node: Node, clock: Clock) -> None:
    """Build the parts on their node and run them; what was gathered when they end is flushed last."""
    parts = AgentParts(settings, state, node, clock)
    writing = asyncio.create_task(parts.writer.run())
    try:
        with (
            answering(node.context, settings, parts.who, parts.queues, parts.session_manager.facts, state.store_id),
            status_file(settings.status_file, name=settings.name, namespace=settings.namespace),
        ):
            await parts.twin.start(
                state.twin.actions
            )  # what was on trial too long is taken back before there is a link
            async with asyncio.TaskGroup() as group:
                group.create_task(ended(writing))
                for run in parts.runs():
                    group.create_task(run)
    finally:
        await parts.close()
        writing.cancel()  # it flushes what came until now
        await asyncio.wait({writing})


class AgentParts:
    """What a running agent is made of, each part knowing those that it needs."""

    def __init__(self, settings: Settings, state: AgentState, node: Node, clock: Clock) -> None:
        self.settings, self.state, self.node, self.clock = settings, state, node, clock
        self.scope = Scope(settings.namespace, settings.exclude)
        box_sealing = open_sealing(settings, state.directory, clock)  # its thread's own
        self.box = open_box(settings.black_box, state.directory, state.disk, clock, sealing=box_sealing)
        self.queues = open_queues(settings, state, clock)
        self.publishers = Publishers(node)
        talk = TalkGuard(clock, on=settings.talk)
        self.teleop = Teleop(DriveGuard(clock, settings.actuators), talk, self.publishers, self.scope)
        self.limit = UplinkLimit(state.disk, self.queues.budget, clock)
        self.who = identity(settings)
        self.credentials, self.addresses = resolve_gateways(settings, state.directory)
        known = self.credentials
        self.renewing = RenewalTask(known, state.directory, clock, system_rng()) if known is not None else None
        self.updates = open_updates(settings, state.directory, known, clock, running=self.who.agent_version)
        bundles = self.updates.nodes if known is not None else None
        self.nodes = open_nodes(settings, state.directory, clock, domain=node.context.domain_id, bundles=bundles)
        self.ros = RosManager(node, self.scope, clock)
        self.video = VideoManager(self.queues.channels, self.scope, self.queues.budget, self.publishers.publish, clock)
        self.commands = self._commands()
        self.twin, self.values = state.twin.build(
            RosServices(node, self.scope),
            self.scope,
            clock,
            channels=self.queues.channels,
            look_again=lambda: self.tap.reconcile(),
            limit=self.limit,
            nodes=self.nodes.manager,
            agent=self.updates.agent,
        )
        self.session_manager = self._session_manager()
        self._link()

    def runs(self) -> Iterator[Coroutine[Any, Any, None]]:
        """What runs beside each other until the agent ends."""
        yield from (self.twin.run(), self.values.run(), self.uplink.run(), self.teleop.run())
        yield from (self.updates.agent.run(), self.nodes.run(), self.ros.run(), self.video.run())
        if self.renewing is not None:
            yield self.renewing.run()
        if self.settings.host_metrics:
            yield run_host(self.settings, self.node.context, self.queues.channels, self.clock)

    async def close(self) -> None:
        """Nothing comes in any more."""
        self.tap.close()
        await self.commands.close()
        if self.box is not None:
            await asyncio.to_thread(self.box.close)
        self.publishers.close()

    def _commands(self) -> CommandDispatcher:
        state = self.state
        saver = Saver(
            self.box,
            self.queues.recordings,
            self.clock,
            robot_id=self.settings.name,
            free=state.disk.free,
            changed=lambda: self.uplink.wake(),
        )
        return CommandDispatcher(
            self.node,
            self.teleop,
            self.scope,
            self.clock,
            log=state.command_log,
            limit=self.limit,
            saver=saver,
            kept=state.kept_results,
            actions={**self.nodes.actions, **self.ros.actions},
        )

    def _session_manager(self) -> SessionManager:
        return SessionManager(
            self.who,
            self.queues,
            self.teleop,
            self.commands,
            self.clock,
            store_id=self.state.store_id,
            compression=self.settings.compression,
            malformed=lambda: self.pipeline.malformed + self.tap.ingress.malformed.total(),
            wake=lambda: self.uplink.wake(),
            credentials=self.credentials,
            expired=self.renewing.now if self.renewing is not None else lambda: None,
            handlers=[self.commands.durable, self.updates.agent, self.nodes, self.twin, self.ros, self.video],
        )

    def _link(self) -> None:
        """The way of a sample: from the tap through the pipeline to the outbox and up."""
        queues, transports = self.queues, transports_with(self.credentials)
        self.uplink = Uplink(
            self.addresses, self.session_manager, Backoff(system_rng()), self.clock, transports=transports
        )
        wake = self.uplink.wake
        self.writer = OutboxWriter(self.state.outbox, self.state.outbox_disk, on_flushed=wake)
        self.pipeline = Pipeline(
            self.state.outbox,
            queues.live,
            queues.linger,
            wake_writer=self.writer.wake,
            wake_uplink=lambda: wake(DATA),
            tracer=queues.tracer,
            watched=lambda: queues.channels.watched,
            patience_s=self.settings.outbox.patience_s,
        )
        self.session_manager.facts.black_box = self.box.describe if self.box is not None else None
        record = self.box.take if self.box is not None else None
        self.tap = Tap(self.node, queues.channels, self.scope, self.pipeline.take, wake, self.clock, record=record)


def open_queues(settings: Settings, state: AgentState, clock: Clock) -> Queues:
    """Where samples wait for the link; what the topic table seals is sealed before it waits.

    Raises:
        ConfigError: something is to be sealed, and there is no usable keyring.
    """
    outbox, sealing = state.outbox, open_sealing(settings, state.directory, clock)
    channels = Channels(state.twin.table, outbox.ids, namespace=settings.namespace)
    live = LiveQueue(max_bytes=settings.outbox.live_bytes)
    if sealing is not None:
        outbox.seal = sealing.accepted(channels.by_id)
        live.seal = sealing.live(lambda: outbox.live_epoch)
    budget = Budget(limit_bytes_per_s=state.limit_bytes_per_s, now_s=clock.monotonic_s())
    tracer = Tracer(clock, system_rng(), every=settings.trace_every)
    outbox.on_accepted = tracer.accepted
    return Queues(channels, outbox, live, Linger(), budget, open_recordings(state.directory), tracer)


def resolve_gateways(settings: Settings, directory: Path) -> tuple[Credentials | None, list[GatewayAddress]]:
    """Who the robot is and where its gateways are: what the settings say, else the gateway that enrolled it.

    Raises:
        ConfigError: an address; the enrolment is another robot's.
        InsecureGatewayError: an enrolled robot is sent beyond this machine without TLS.
        IdentityFileError: there is an identity, and it cannot be used.
    """
    identity = IdentityFiles(directory).load()
    if identity is None:
        return None, settings.addresses()
    if identity.robot != settings.name:
        raise ConfigError(f"{directory} is enrolled as {identity.robot}: start it with --name {identity.robot}")
    configured = settings.gateways or settings.gateway
    addresses = settings.addresses() if configured else enrolled_addresses(identity, settings.transport)
    check_addresses(addresses)
    return Credentials(identity), addresses


async def ended(task: asyncio.Task[None]) -> None:
    """Until a task has ended; with its error."""
    await asyncio.shield(task)


def identity(settings: Settings) -> Identity:
    """Who this agent says it is; the session id is new in every process."""
    try:
        agent_version = version("metaros")
    except PackageNotFoundError:
        agent_version = "unpacked"
    return Identity(
        robot_id=settings.name,
        session_id=os.urandom(16),
        agent_version=agent_version,
        namespace=settings.namespace,
        hostname=socket.gethostname(),
        labels=dict(settings.labels),
    )
