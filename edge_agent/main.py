"""The agent program's only wiring: settings in, running parts, clean end on SIGINT or SIGTERM."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from edge_agent.batch import Linger
from edge_agent.channels import Channels
from edge_agent.commands import Commands
from edge_agent.config import Settings
from edge_agent.drive_guard import DriveGuard
from edge_agent.host_turn import host_turn, turn_path
from edge_agent.live import LiveQueue
from edge_agent.metrics import publish_host
from edge_agent.outbox import OsDisk, Outbox, OutboxWriter
from edge_agent.pipeline import Pipeline
from edge_agent.publishers import Publishers
from edge_agent.scope import Scope
from edge_agent.state_dir import default_state_dir, locked
from edge_agent.status import status_file
from edge_agent.store_id import StoreId
from edge_agent.tap import Tap
from edge_agent.teleop import Teleop
from edge_agent.topics import TopicTable
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.budget import Budget
from edge_agent.uplink.keeper import SessionKeeper
from edge_agent.uplink.session import Identity, Queues
from edge_agent.uplink.uplink import Uplink
from metaros.clock import Clock, SystemClock, system_rng
from metaros.node import Context, Node
from metaros.signals import on_stop

__all__ = ["run", "run_agent"]

NODE_NAME, HOST_NODE_NAME = "metaros_agent", "host"


def run(settings: Settings) -> None:
    """Run the agent until SIGINT or SIGTERM."""
    asyncio.run(run_until_signal(settings))


async def run_until_signal(settings: Settings) -> None:
    """Run the agent; the signals end it as a cancellation, so that every part closes what it opened."""
    agent = asyncio.ensure_future(run_agent(settings))
    on_stop(asyncio.get_running_loop(), agent.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await agent


async def run_agent(settings: Settings, *, clock: Clock | None = None) -> None:
    """Tap, queues, uplink, commands and host metrics around one Zenoh session; until cancelled."""
    clock = clock or SystemClock()
    state_dir = settings.state_dir or default_state_dir(settings.name)
    with (
        locked(state_dir),
        Context(connect=[f"tcp/127.0.0.1:{settings.zenoh_port}"], clock=clock, shared_memory="off") as context,
    ):
        with contextlib.ExitStack() as stack:
            node = stack.enter_context(
                Node(NODE_NAME, namespace=settings.namespace, context=context, enable_parameters=False)
            )
            await run_parts(settings, state_dir, node, clock)


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


async def run_parts(settings: Settings, state_dir: Path, node: Node, clock: Clock) -> None:
    """Build the parts on their node and run them in one task group."""
    rng = system_rng()
    scope = Scope(settings.namespace, settings.exclude)
    disk = OsDisk(state_dir / "outbox")
    outbox = Outbox(
        disk,
        clock,
        new_epoch=lambda: rng.getrandbits(64),
        writer=os.urandom(8).hex(),
        boot_id=boot_id(),
        classes=settings.outbox.classes(),
        reserve_bytes=settings.outbox.reserve_bytes,
    )
    queues = Queues(
        Channels(TopicTable(settings.topics), outbox.ids, namespace=settings.namespace),
        outbox,
        LiveQueue(max_bytes=settings.outbox.live_bytes),
        Linger(),
        Budget(now_s=clock.monotonic_s()),
    )
    publishers = Publishers(node)
    teleop = Teleop(DriveGuard(clock, settings.actuators), publishers, scope)
    commands = Commands(node, teleop, scope, clock)
    keeper = SessionKeeper(
        identity(settings),
        queues,
        teleop,
        commands,
        clock,
        store_id=StoreId(OsDisk(state_dir)),
        compression=settings.compression,
        malformed=lambda: pipeline.malformed + tap.ingress.malformed.total(),
        wake=lambda: uplink.wake(),
    )
    uplink = Uplink(settings.addresses(), keeper, Backoff(rng), clock)
    writer = OutboxWriter(outbox, disk, on_flushed=uplink.wake)
    pipeline = Pipeline(outbox, queues.live, queues.linger, wake_writer=writer.wake, wake_uplink=uplink.wake)
    tap = Tap(node, queues.channels, scope, pipeline.take, uplink.wake, clock)
    try:
        with status_file(settings.status_file, name=settings.name, namespace=settings.namespace):
            async with asyncio.TaskGroup() as group:
                group.create_task(writer.run())
                group.create_task(uplink.run())
                group.create_task(teleop.run())
                if settings.host_metrics:
                    group.create_task(run_host(settings, node.context, queues.channels, clock))
    finally:
        tap.close()
        await commands.close()
        publishers.close()


def boot_id() -> str:
    """Which run of the operating system this is; empty where it does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


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
