"""The agent program's only wiring: settings in, running parts, clean end on SIGINT or SIGTERM."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from edge_agent.answering import answering
from edge_agent.batch import Linger
from edge_agent.blackbox.saver import Saver
from edge_agent.blackbox.setup import open_box, open_shelf
from edge_agent.channels import Channels
from edge_agent.commands import Commands
from edge_agent.config import Settings
from edge_agent.drive_guard import DriveGuard
from edge_agent.host_turn import host_turn, turn_path
from edge_agent.identity.credentials import Credentials, check_addresses, enrolled_addresses
from edge_agent.identity.files import IdentityFiles
from edge_agent.identity.renewing import Renewing
from edge_agent.live import LiveQueue
from edge_agent.metrics import publish_host
from edge_agent.nodes.setup import open_nodes
from edge_agent.outbox import OutboxWriter
from edge_agent.pipeline import Pipeline
from edge_agent.publishers import Publishers
from edge_agent.scope import Scope
from edge_agent.sealing import open_sealing
from edge_agent.state import AgentState, open_state
from edge_agent.status import status_file
from edge_agent.tap import Tap
from edge_agent.teleop import Teleop
from edge_agent.update.setup import HANDOVER, open_updates
from edge_agent.uplink.address import GatewayAddress
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.budget import Budget
from edge_agent.uplink.keeper import SessionKeeper
from edge_agent.uplink.session import Identity, Queues
from edge_agent.uplink.uplink import Uplink, transports_with
from edge_agent.uplink_limit import UplinkLimit
from edge_agent.zenoh_profile import session_environ
from metaros.clock import Clock, SystemClock, system_rng
from metaros.errors import ConfigError
from metaros.node import Context, Node
from metaros.signals import on_stop

__all__ = ["run", "run_agent"]

NODE_NAME, HOST_NODE_NAME = "metaros_agent", "host"


def run(settings: Settings) -> None:
    """Run the agent until SIGINT or SIGTERM."""
    asyncio.run(run_until_signal(settings))
    HANDOVER.finish()


async def run_until_signal(settings: Settings) -> None:
    """Run the agent; the signals end it as a cancellation, so that every part closes what it opened."""
    agent = asyncio.ensure_future(run_agent(settings))
    on_stop(asyncio.get_running_loop(), agent.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await agent


async def run_agent(settings: Settings, *, clock: Clock | None = None) -> None:
    """Tap, queues, uplink, commands and host metrics around one Zenoh session; until cancelled."""
    clock = clock or SystemClock()
    with contextlib.ExitStack() as stack:
        state = await open_state(settings, clock, stack)
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
    path = turn_path(zenoh_port=settings.zenoh_port, domain=context.domain_id, namespace=settings.namespace)
    async with host_turn(path):
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
    outbox, scope = state.outbox, Scope(settings.namespace, settings.exclude)
    box_sealing = open_sealing(settings, state.directory, clock)  # its thread's own
    box = open_box(settings.black_box, state.directory, state.disk, clock, sealing=box_sealing)
    queues = open_queues(settings, state, clock)
    publishers = Publishers(node)
    teleop = Teleop(DriveGuard(clock, settings.actuators), publishers, scope)
    limit = UplinkLimit(state.disk, queues.budget, clock)
    saver = Saver(box, queues.shelf, clock, robot_id=settings.name, free=state.disk.free, changed=lambda: uplink.wake())
    who = identity(settings)
    credentials, addresses = door_of(settings, state.directory)
    renewing = Renewing(credentials, state.directory, clock, system_rng()) if credentials is not None else None
    updates = open_updates(settings, state.directory, credentials, clock, running=who.agent_version)
    bundles = updates.nodes if credentials is not None else None
    nodes = open_nodes(settings, state.directory, clock, domain=node.context.domain_id, bundles=bundles)
    commands = Commands(
        node,
        teleop,
        scope,
        clock,
        log=state.command_log,
        limit=limit,
        saver=saver,
        kept=state.kept_results,
        actions=nodes.actions,
    )
    twin, values = state.twin.build(
        node,
        scope,
        clock,
        channels=queues.channels,
        look_again=lambda: tap.reconcile(),
        limit=limit,
        nodes=nodes.desk,
        agent=updates.agent,
    )
    keeper = SessionKeeper(
        who,
        queues,
        teleop,
        commands,
        clock,
        store_id=state.store_id,
        compression=settings.compression,
        malformed=lambda: pipeline.malformed + tap.ingress.malformed.total(),
        wake=lambda: uplink.wake(),
        credentials=credentials,
        expired=renewing.now if renewing is not None else lambda: None,
        desks=[commands.durable, updates.agent, nodes, twin],
    )
    uplink = Uplink(addresses, keeper, Backoff(system_rng()), clock, transports=transports_with(credentials))
    writer = OutboxWriter(outbox, state.outbox_disk, on_flushed=uplink.wake)
    pipeline = Pipeline(outbox, queues.live, queues.linger, wake_writer=writer.wake, wake_uplink=uplink.wake)
    keeper.facts.black_box = box.describe if box is not None else None
    tap = Tap(node, queues.channels, scope, pipeline.take, uplink.wake, clock, record=box.take if box else None)
    writing = asyncio.create_task(writer.run())
    try:
        with (
            answering(node.context, settings, who, queues, keeper.facts, state.store_id),
            status_file(settings.status_file, name=settings.name, namespace=settings.namespace),
        ):
            await twin.start(state.twin.actions)  # what was on trial too long is taken back before there is a link
            async with asyncio.TaskGroup() as group:
                group.create_task(ended(writing))
                group.create_task(twin.run())
                group.create_task(values.run())
                group.create_task(uplink.run())
                group.create_task(teleop.run())
                group.create_task(updates.agent.run())
                group.create_task(nodes.run())
                if renewing is not None:
                    group.create_task(renewing.run())
                if settings.host_metrics:
                    group.create_task(run_host(settings, node.context, queues.channels, clock))
    finally:
        tap.close()
        await commands.close()
        if box is not None:
            await asyncio.to_thread(box.close)
        publishers.close()
        writing.cancel()  # it flushes what came until now
        await asyncio.wait({writing})


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
    return Queues(channels, outbox, live, Linger(), budget, open_shelf(state.directory))


def door_of(settings: Settings, directory: Path) -> tuple[Credentials | None, list[GatewayAddress]]:
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
    told = settings.gateways or settings.gateway
    addresses = settings.addresses() if told else enrolled_addresses(identity, settings.transport)
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
