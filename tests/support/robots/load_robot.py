"""A robot without ROS for fault campaigns: the agent's real outbox, writer, session and uplink, fed with numbers.

It is a process of its own and dies by kill -9. What it was given, what was accepted and how the link is stands in
files (`load_robot_samples`). SIGTERM ends it well: it stops feeding, waits until all is acknowledged,
and writes `final.json`.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import logging
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from edge_agent.config.gateway_address import parse_address
from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import METRIC_STREAM, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.link.budget import Budget
from edge_agent.outbox import CLASSES, OsDisk, Outbox, OutboxWriter
from edge_agent.outbox.outbox import FlushJob
from edge_agent.state.state import boot_id
from edge_agent.state.state_dir import locked
from edge_agent.state.store_id import StoreId
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import AgentSession, Identity
from edge_agent.uplink.session_manager import SessionManager
from edge_agent.uplink.uplink import Uplink
from metaros.clock import SystemClock, system_rng
from metaros.idl import type_hash
from tests.support.robots.load_robot_samples import KINDS, LOST, Counters, Entry, Journal, number_in, number_of, payload

__all__ = ["RobotConfig", "die_with_parent", "enter_network", "log_to", "run_robot"]

TOPICS = (
    TopicRule(match="**/events", delivery="event"),
    TopicRule(match="**/bulk", delivery="bulk"),
    TopicRule(match="**/metric", delivery="live", fields=("data",)),
)
PR_SET_PDEATHSIG = 1
CLONE_NEWNET = 0x40000000


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """A life of the robot. Journal and counters are in `folder`, the agent's own files in `state_dir`."""

    folder: Path
    state_dir: Path
    gateway: str
    life: int
    name: str = "robot"
    tick_s: float = 0.005
    bulk: int = 8  # samples a tick
    metrics: int = 3
    event_every: int = 2  # ticks
    network_of: int = 0  # a process in whose network namespace the robot lives
    drain_s: float = 60.0
    quotas: tuple[tuple[str, int], ...] = ()  # class, bytes
    floors: bool = True  # keep the free shares of the disk that the classes ask for
    reserve_bytes: int = 1024 * 1024


class LoadOutbox(Outbox):
    """Notes what was accepted the moment it was."""

    journal: Journal
    counters: Counters

    def flushed(self, job: FlushJob) -> None:
        """Its samples are accepted: into the journal."""
        super().flushed(job)
        epoch = self.epoch_of(job.append.segment.header.era)
        entries: list[Entry] = []
        for stream_id, items in job.streams.items():
            counts = [getattr(item, "count", 1) if not isinstance(item, tuple) else 1 for item in items]
            seq = self.logs[job.log].last[stream_id] - sum(counts) + 1
            for item, count in zip(items, counts, strict=True):
                number = sample_number(item)
                add_entry(entries, Entry(epoch, stream_id, seq, number, count))
                seq += count
        self.journal.write(entries)
        self.counters["accept_ns"] = time.monotonic_ns()

    def refused(self, job: FlushJob, reason: str) -> None:
        """It could not be written."""
        super().refused(job, reason)
        self.counters["refused"] += 1

    def acknowledge(self, stream_id: int, epoch: int, seq: int) -> None:
        """The gateway has it."""
        super().acknowledge(stream_id, epoch, seq)
        self.counters["ack_ns"] = time.monotonic_ns()


def sample_number(item: Any) -> int:
    """Which sample waits there, or LOST."""
    if not isinstance(item, tuple):
        return LOST
    data = item[1]
    return number_in(data) if isinstance(data, bytes) else int(data[1])


def add_entry(entries: list[Entry], more: Entry) -> None:
    """Join runs."""
    last = entries[-1] if entries else None
    if last is not None and last[:2] == more[:2] and last.first_seq + last.count == more.first_seq:
        follows = more.first_number == (LOST if last.first_number == LOST else last.first_number + last.count)
        if follows:
            entries[-1] = last._replace(count=last.count + more.count)
            return
    entries.append(more)


class Nobody:
    """Teleop and commands, of which there are none."""

    def link_lost(self) -> None:
        """Nothing moves."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *args: None


class LoadRobot:
    """All parts of one life."""

    outbox_type: type[Outbox] = LoadOutbox

    def __init__(self, config: RobotConfig) -> None:
        self.config = config
        clock, rng = SystemClock(), system_rng()
        self.counters = Counters(config.folder / "counters", life=config.life)
        disk = OsDisk(config.state_dir / "outbox")
        self.outbox = self.outbox_type(
            disk,
            clock,
            new_epoch=lambda: rng.getrandbits(64),
            writer=os.urandom(8).hex(),
            boot_id=boot_id(),
            classes=self.classes(),
            reserve_bytes=config.reserve_bytes,
        )
        if isinstance(self.outbox, LoadOutbox):
            self.outbox.journal, self.outbox.counters = Journal(config.folder / "journal"), self.counters
        channels = Channels(TopicTable(TOPICS), self.outbox.ids, namespace="/")
        text = ("std_msgs/msg/String", type_hash("std_msgs/msg/String"))
        number = ("std_msgs/msg/Float64", type_hash("std_msgs/msg/Float64"))
        bulk = channels.observe("/load/bulk", *text, qos="", keeps_all=True)
        event = channels.observe("/load/events", *text, qos="", keeps_all=True)
        channels.observe("/load/metric", *number, qos="", keeps_all=False)
        assert bulk is not None
        assert event is not None
        self.streams = {"bulk": bulk.channel_id, "event": event.channel_id, "metric": METRIC_STREAM}
        self.series = next(iter(self.outbox.ids.series.values())).series
        self.queues = queues = Queues(channels, self.outbox, LiveQueue(), Linger(), Budget(now_s=clock.monotonic_s()))
        identity = Identity(
            robot_id=config.name, session_id=os.urandom(16), agent_version="load", namespace="/", hostname="load"
        )
        nobody: Any = Nobody()
        self.keeper = LoadKeeper(
            identity,
            queues,
            nobody,
            nobody,
            clock,
            store_id=StoreId(OsDisk(config.state_dir)),
            malformed=int,
            wake=lambda: None,
        )
        self.keeper.counters = self.counters
        self.uplink = Uplink([parse_address(config.gateway)], self.keeper, Backoff(rng), clock)
        self.writer = OutboxWriter(self.outbox, disk, on_flushed=self.uplink.wake)
        self.given = dict.fromkeys(KINDS, 0)

    def classes(self) -> dict[str, Any]:
        """The outbox's classes, as configured."""
        quotas = dict(self.config.quotas)
        changed = {}
        for name, policy in CLASSES.items():
            policy = replace(policy, quota_bytes=quotas.get(name, policy.quota_bytes))
            changed[name] = policy if self.config.floors else replace(policy, floor_bytes=0, floor_share=0.0)
        return changed

    async def run(self, stop: asyncio.Event) -> None:
        """Until told to stop; then until everything is acknowledged."""
        tasks = [asyncio.create_task(self.writer.run()), asyncio.create_task(self.uplink.run())]
        try:
            feeding = asyncio.create_task(self.feed())
            stopping = asyncio.create_task(stop.wait())
            await asyncio.wait([*tasks, feeding, stopping], return_when="FIRST_COMPLETED")
            for task in (*tasks, feeding):  # none of them ends by itself
                if task.done():
                    await task
            feeding.cancel()
            await self.drain()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        self.finish()

    async def drain(self) -> None:
        """Until all is acknowledged; says what hangs when it takes too long."""
        try:
            async with asyncio.timeout(self.config.drain_s):
                while self.waiting():
                    self.writer.wake()
                    await asyncio.sleep(0.01)
        except TimeoutError:
            due = {name: self.outbox.due_s(name) for name in self.outbox.logs}
            depths = {kind: self.outbox.depth(kind) for kind in KINDS}
            logging.error("not drained: %s; due %s; writing %s", depths, due, self.outbox._writing)
            logging.error("budget: %s", {name: getattr(self.queues.budget, name) for name in vars(self.queues.budget)})
            raise

    async def feed(self) -> None:
        """Samples at a steady pace."""
        tick = 0
        while True:
            tick += 1
            self.give("bulk", self.config.bulk)
            self.give("metric", self.config.metrics)
            if tick % self.config.event_every == 0:
                self.give("event", 1)
            self.writer.wake()
            self.counters["held"] = sum(log.size_bytes for log in self.outbox.logs.values())
            await asyncio.sleep(self.config.tick_s)

    def give(self, kind: str, count: int) -> None:
        """Hand some samples to the outbox."""
        start = self.given[kind]
        self.given[kind] = self.counters[kind] = start + count
        stamp_ns, stream = time.time_ns(), self.streams[kind]  # noqa: TID251 - a stamp is what a publisher says
        for count_ in range(start + 1, start + count + 1):
            number = number_of(self.config.life, count_)
            data = (self.series, float(number)) if kind == "metric" else payload(KINDS.index(kind), number)
            self.outbox.append(stream, kind, stamp_ns, data)

    def waiting(self) -> bool:
        """Whether anything is not acknowledged yet."""
        outbox = self.outbox
        gathering = any(outbox.due_s(name) is not None or name in outbox._writing for name in outbox.logs)
        return gathering or any(outbox.depth(kind).samples for kind in KINDS)

    def finish(self) -> None:
        """Say what the outbox calls accepted."""
        ranges = [held._asdict() for held in self.outbox.ranges()]
        final = {"ranges": ranges, "lost": self.outbox.lost, "streams": self.streams}
        partial = self.config.folder / "final.partial"
        partial.write_text(json.dumps(final))
        partial.replace(self.config.folder / "final.json")


class LoadKeeper(SessionManager):
    """Counts what happens to the link."""

    counters: Counters

    def new_session(self) -> AgentSession:
        """The next session."""
        session = super().new_session()
        receive = session.receive

        def counted(lane: Any, frame: Any) -> Any:
            if frame.WhichOneof("frame") == "retry_later":
                self.counters["retry_later"] += 1
            return receive(lane, frame)

        session.receive = counted  # type: ignore[method-assign]
        return session

    def handle(self, session: AgentSession, event: Any) -> None:
        """Established, most of all."""
        super().handle(session, event)
        if type(event).__name__ == "Established":
            self.counters["online"] = 1
            self.counters["sessions"] += 1
            self.counters["session_number"] = session.number

    def session_ended(self, error: BaseException | None = None) -> None:
        """Offline."""
        super().session_ended(error)
        self.counters["online"] = 0


def run_robot(config: RobotConfig) -> None:
    """The process."""
    die_with_parent()
    log_to(config.folder / "robot.log")
    if config.network_of:
        enter_network(config.network_of)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s life %(message)s", force=True)
    with locked(config.state_dir):
        asyncio.run(_run(config))


async def _run(config: RobotConfig) -> None:
    stop = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.set)
    await LoadRobot(config).run(stop)


def die_with_parent() -> None:
    """Nothing is left behind when the campaign itself is killed."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def log_to(path: Path) -> None:
    """Everything printed goes to a file."""
    with open(path, "ab") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)


def enter_network(pid: int) -> None:
    """Live in the network namespace of another process; before the first socket or thread."""
    with open(f"/proc/{pid}/ns/net") as namespace:
        if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), "cannot enter the network namespace")
