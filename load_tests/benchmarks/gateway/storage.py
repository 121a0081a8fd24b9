"""What an hour of one robot costs on the gateway's disk, beside the raw CDR and a rosbags MCAP file with zstd.

    python -m load_tests storage [--seconds 60] [--sources sim,intel] [--intel FILE] [--quick]

Two robots: one of the simulator, recorded from the wire at its full rate, and the Intel lab log of a real one (laser,
odometry, transforms). Their messages go through the agent's own topic table and the store's own steps (commits of a
second, the merge of metric rows, compaction into segments), in a store of its own each:

- `as by default`: the durable part of the default topic table: metric series, copies of some samples, events;
- `every message`: a table that keeps all of them, which is what the two files hold.

Disk is what SQLite's pages in use and the objects occupy, less an empty store. Bytes an hour are scaled from the
recorded time.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

import metaros
from edge_agent.config.topic_table import DEFAULT_TOPICS, TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel as AgentChannel
from edge_agent.forwarding.channels import Channels
from edge_agent.outbox import OsDisk
from edge_agent.outbox.ids import IdLog
from gateway.domain.channel import METRIC_STREAM, Channel, Series
from gateway.domain.sample import Rows, Run
from gateway.store import StreamWrite
from gateway.store.commit import Committer
from gateway.store.engines import open_engine
from gateway.store.ledger import in_transaction
from gateway.store.objects import DirectoryStore
from gateway.store.telemetry.compact import Compaction
from gateway.store.telemetry.merge import merge_step
from load_tests.figures import note
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.idl import schema_text, type_hash
from metaros.link import SampleColumns
from metaros.record import Recorder, open_bag
from metaros.record.carmen import LaserLine, LogCount, in_ipc_order, open_log, read_log
from metaros.record.carmen_messages import odometry_message, scan_message, tf_message
from metaros.sim.main import run_sim
from tests.support.ports import free_port

__all__ = ["Message", "Sizes", "intel_messages", "main", "measure", "sim_messages"]

INTEL = Path(os.environ.get("METAROS_DATA") or "../shared/data") / "robots" / "intel.clf.bz2"
EVERYTHING = (TopicRule(match="**", delivery="bulk"),)
TABLES = {"as by default": DEFAULT_TOPICS, "every message": EVERYTHING}
EPOCH, COMMIT_NS, MERGE_COMMITS = 1, 10**9, 30


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a robot, as it was published."""

    topic: str
    type_name: str
    type_hash: str
    schema: str
    stamp_ns: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Sizes:
    """What a store holds of a robot: rows and messages, and bytes of database and objects."""

    rows: int
    messages: int
    database: int
    objects: int


def sim_messages(folder: Path, *, seconds: float) -> list[Message]:
    """A simulated robot, from the wire."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stop = threading.Event()
    with metaros.Context(domain_id=0, connect=[], listen=endpoint) as listening:
        with Recorder(listening, folder / "sim.mcap", topics=["/**"]) as recorder:
            robot = metaros.Context(domain_id=0, connect=endpoint, listen=[])
            thread = threading.Thread(target=run_sim, kwargs={"robots": 1, "context": robot, "stop": stop})
            thread.start()
            try:
                while not recorder.report().received:
                    time.sleep(0.05)
                time.sleep(seconds)
            finally:
                stop.set()
                thread.join(30)
                robot.close()
    found = open_bag(folder / "sim.mcap").messages()
    return [
        Message(t.name, t.type_name, t.type_hash, t.schema, item.publish_ns, item.data)
        for item in found
        for t in (item.topic,)
    ]


def intel_messages(path: Path, *, most_s: float = float("inf")) -> Iterator[Message]:
    """The log as `metaros play` publishes it."""
    count = LogCount()
    first_s: float | None = None
    with open_log(path) as source:
        for line in in_ipc_order(read_log(source, count), count):
            first_s = line.stamp_s if first_s is None else first_s
            if line.stamp_s - first_s > most_s:
                return
            made: dict[str, Any] = {}
            if isinstance(line, LaserLine):
                made["scan"] = scan_message("intel", line)
            else:
                made["odom"] = odometry_message("intel", line)
                made["tf"] = tf_message("intel", line, laser_x_m=0.1)
            for name, message in made.items():
                kind = str(message.__metaros_name__)
                payload = bytes(codec(kind).encode(message))
                stamp_ns = round(line.stamp_s * 1e6) * 1000
                yield Message(f"/intel/{name}", kind, type_hash(kind), schema_text(kind), stamp_ns, payload)


@dataclass
class _Robot:
    """The durable part of an agent: what the topic table keeps of a robot's messages, a commit at a time."""

    channels: Channels
    series: dict[int, Series] = field(default_factory=dict)
    rows: list[tuple[int, int, float]] = field(default_factory=list)
    held: dict[int, list[Message]] = field(default_factory=dict)
    seqs: dict[int, int] = field(default_factory=dict)

    def take(self, message: Message) -> None:
        """What of one message is kept."""
        channel = self.channels.observe(message.topic, message.type_name, message.type_hash, qos="", keeps_all=False)
        assert channel is not None
        now_s = message.stamp_ns / 1e9
        if channel.metrics is not None and channel.metrics.due(now_s):
            self.rows += [
                (number, message.stamp_ns, value) for number, value in channel.metrics.rows(message.payload, now_s)
            ]
        for each in (channel.copy, channel):
            if each is not None and each.delivery != "live" and each.selector.admit(now_s):
                self.held.setdefault(each.channel_id, []).append(message)

    def writes(self) -> list[StreamWrite]:
        """What was kept since the last call."""
        made = [self._run(number, messages) for number, messages in self.held.items()]
        if self.rows:
            made.append(self._rows())
        self.rows, self.held = [], {}
        return made

    def _next(self, stream: int, count: int) -> tuple[int, int]:
        last = self.seqs[stream] = self.seqs.get(stream, 0) + count
        return last - count + 1, last

    def _run(self, number: int, messages: Sequence[Message]) -> StreamWrite:
        first, last = self._next(number, len(messages))
        columns = SampleColumns(
            stream_id=number,
            epoch=EPOCH,
            first_seq=first,
            stamps_ns=np.array([message.stamp_ns for message in messages], np.int64),
            offsets=np.cumsum([0, *(len(message.payload) for message in messages)], dtype=np.int64),
            payload=b"".join(message.payload for message in messages),
        )
        agents = self.channels.by_id(number)
        assert agents is not None
        run = Run(_channel(agents, messages[0]), columns, messages[-1].stamp_ns)
        return StreamWrite(robot="robot", stream_id=number, epoch=EPOCH, seq=last, run=run)

    def _rows(self) -> StreamWrite:
        announced = {item.series_id: item for frame in self.channels.announcements(0) for item in frame.series}
        numbers = sorted({row[0] for row in self.rows})
        series = tuple(Series(announced[n].name, announced[n].topic, announced[n].field) for n in numbers)
        places, stamps, values = zip(*self.rows, strict=True)
        index = np.searchsorted(numbers, places).astype(np.uint32)
        rows = Rows(series, index, np.array(stamps, np.int64), np.array(values, np.float64))
        _, last = self._next(METRIC_STREAM, len(rows))
        return StreamWrite(robot="robot", stream_id=METRIC_STREAM, epoch=EPOCH, seq=last, rows=rows)


def _channel(agents: AgentChannel, message: Message) -> Channel:
    return Channel(
        robot="robot",
        channel_id=agents.channel_id,
        topic=agents.topic,
        schema_name=agents.type_name,
        type_hash=agents.type_hash,
        schema_encoding="ros2msg",
        schema=message.schema.encode(),
        delivery=agents.delivery,
    )


def measure(messages: Sequence[Message], folder: Path, rules: Sequence[TopicRule]) -> Sizes:
    """The messages through a topic table into a store of their own."""
    robot = _Robot(Channels(TopicTable(rules), IdLog(OsDisk(folder / "agent")), namespace="/"))
    engine = open_engine("", folder)[0]
    empty = engine.used_bytes()
    objects = DirectoryStore(folder / "objects")
    committer = Committer(engine)
    commits = 0
    for number, message in enumerate(messages):
        robot.take(message)
        due = number + 1 == len(messages) or messages[number + 1].stamp_ns // COMMIT_NS != message.stamp_ns // COMMIT_NS
        if due and (writes := robot.writes()):
            committer.commit(writes, now_ns=message.stamp_ns)
            commits += 1
            if commits % MERGE_COMMITS == 0:
                merge_step(engine, max_batches=1 << 20)
    merge_step(engine, max_batches=1 << 20)
    work = Compaction(engine, in_transaction(engine), objects, clock=SystemClock())
    while sum(work.compact(due) for due in work.due(everything=True)):
        pass
    database = engine.used_bytes() - empty
    engine.close()
    kept = sum(info.size_bytes for info in objects.names())
    rows = robot.seqs.pop(METRIC_STREAM, 0)
    return Sizes(rows, sum(robot.seqs.values()), database, kept)


def rosbags_bytes(messages: Sequence[Message], folder: Path) -> int:
    """What rosbags' MCAP writer makes of them, with chunks compressed by zstd."""
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    connections = {}
    with writer:
        for message in messages:
            key = message.topic, message.type_name
            if key not in connections:
                connections[key] = writer.add_connection(*key, msgdef=message.schema, rihs01=message.type_hash)
            writer.write(connections[key], message.stamp_ns, message.payload)
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def report(name: str, messages: Sequence[Message], folder: Path) -> None:
    """One robot's table."""
    stamps = [message.stamp_ns for message in messages]
    span_s = (max(stamps) - min(stamps)) / 1e9
    hour = 3600 / span_s / 1e6
    raw = sum(len(message.payload) for message in messages)
    print(f"\n{name}: {span_s:,.0f} s, {len(messages):,} messages, {raw / 1e6:,.1f} MB of CDR")
    print(f"{'':<28}{'MB an hour':>12}{'of raw CDR':>12}{'messages':>12}{'rows':>10}{'database':>12}{'objects':>12}")
    bag = rosbags_bytes(messages, folder / f"{name}-bag")
    for title, size in (("raw CDR", raw), ("rosbags MCAP, zstd", bag)):
        print(f"{title:<28}{size * hour:>12,.1f}{size / raw:>12.3f}{len(messages):>12,}")
    for title, rules in TABLES.items():
        place = folder / f"{name}-store"
        place.mkdir()
        found = measure(messages, place, rules)
        size = found.database + found.objects
        note(f"{title}, {name}, of raw CDR", [size / raw], peer=[bag / raw])
        note(f"{title}, {name}, of the MCAP file", [size / bag])
        print(
            f"{'store, ' + title:<28}{size * hour:>12,.1f}{size / raw:>12.3f}{found.messages:>12,}{found.rows:>10,}"
            f"{found.database * hour:>9,.1f} MB{found.objects * hour:>9,.1f} MB",
            flush=True,
        )
        shutil.rmtree(place)


def main(argv: Sequence[str] = ()) -> int:
    """Print a table a robot; 2 when the log is not there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long the simulated robot is recorded")
    parser.add_argument("--sources", default="sim,intel")
    parser.add_argument("--intel", type=Path, default=INTEL, help="the CARMEN log")
    parser.add_argument("--quick", action="store_true", help="a few seconds of each: that it works")
    options = parser.parse_args(list(argv))
    sources = options.sources.split(",")
    if "intel" in sources and not options.intel.exists():
        print(f"no log at {options.intel}; name it with --intel, or --sources sim", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "sim" in sources:
            report("sim", sim_messages(folder, seconds=3.0 if options.quick else options.seconds), folder)
        if "intel" in sources:
            most_s = 60.0 if options.quick else float("inf")
            report("intel", list(intel_messages(options.intel, most_s=most_s)), folder)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
