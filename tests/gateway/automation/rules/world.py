"""Rules on a real store and journal, driven as the gateway drives them, on a clock that is moved by hand."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from gateway.automation.events.journal import EventJournal
from gateway.automation.rules.service import Rules
from gateway.domain.automation.rule import Maker, StoredRule
from gateway.domain.channel import EVENT, Channel, Series
from gateway.domain.principal import Principal, Role
from gateway.domain.sample import Rows, Run
from gateway.fleet.ros.typed import encode
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.retention import Retention
from gateway.store.writes import StreamWrite
from metaros.clock import ManualClock
from metaros.idl import default_catalogue, schema_text, type_hash
from metaros.limits import LIMITS
from metaros.link import SampleColumns

NOW = 1_790_000_000 * 10**9
S = 10**9
ADMIN = Principal(kind="user", id="u1", name="ada", role=Role.ADMIN, robots=("*",))
LAB = Principal(kind="user", id="u2", name="lab", role=Role.ADMIN, robots=("lab_*",))
BATTERY = Series("battery_state.percentage", "/r1/battery_state", "percentage")
CALL: dict[str, Any] = {"id": "call", "kind": "function", "function": "react"}


def rule(name: str = "one", *targets: Mapping[str, Any], **fields: Any) -> dict[str, Any]:
    """A rule's document; a target calls a function where none is given."""
    return {"name": name, "targets": list(targets) or [CALL], **fields}


@dataclass
class World:
    """`commit` and `emit` return when what they gave is stored and judged."""

    store: Store
    journal: EventJournal
    rules: Rules
    clock: ManualClock
    seqs: dict[int, int] = field(default_factory=dict)

    async def put(self, document: Mapping[str, Any], maker: Principal = ADMIN) -> StoredRule:
        """Add a rule."""
        return (await self.rules.registry.put(document, maker=Maker.of(maker)))[0]

    async def emit(self, kind: str, robot: str = "r1", **data: Any) -> None:
        """An event of the journal."""
        self.journal.emit(kind, robot, data)
        await self.journal.store_some()

    async def rows(self, *values: float, robot: str = "r1", series: Series = BATTERY) -> None:
        """Values of a series, a second apart."""
        count = len(values)
        seq = self.seqs[0] = self.seqs.get(0, 0) + count
        stamps = self.clock.wall_ns() + np.arange(count, dtype=np.int64) * S
        rows = Rows((series,), np.zeros(count, np.uint32), stamps, np.array(values))
        self.store.submit(StreamWrite(robot=robot, stream_id=0, epoch=7, seq=seq, rows=rows))
        await self.store.flush()

    async def messages(self, channel: Channel, *messages: Mapping[str, Any], robot: str = "r1") -> None:
        """Messages of a topic, a second apart."""
        payloads = [encode(channel.schema_name, dict(item), default_catalogue()) for item in messages]
        await self.payloads(channel, *payloads, robot=robot)

    async def payloads(self, channel: Channel, *payloads: bytes, robot: str = "r1") -> None:
        """The same, as bytes."""
        stream = channel.channel_id
        first = self.seqs.get(stream, 0) + 1
        self.seqs[stream] = first + len(payloads) - 1
        count = len(payloads)
        columns = SampleColumns(
            stream_id=stream,
            epoch=7,
            first_seq=first,
            stamps_ns=self.clock.wall_ns() + np.arange(count, dtype=np.int64) * S,
            offsets=np.concatenate(([0], np.cumsum([len(item) for item in payloads]))).astype(np.int64),
            payload=b"".join(payloads),
        )
        run = Run(channel, columns, self.clock.wall_ns())
        self.store.submit(StreamWrite(robot=robot, stream_id=stream, epoch=7, seq=self.seqs[stream], run=run))
        await self.store.flush()

    async def step(self, seconds: float) -> None:
        """Time passes, and what is due is done."""
        self.clock.advance(seconds)
        while await self.rules.scheduler.step():
            pass

    async def deliveries(self) -> list[dict[str, Any]]:
        """What is in the queue, in the order in which it came: kind, target and payload."""

        def job(engine: StoreEngine) -> Sequence[Any]:
            with engine.transaction(write=False):
                return engine.fetch("SELECT kind, target, payload, robot, happening FROM deliveries ORDER BY happening")

        return [
            {
                "kind": row[0],
                "target": row[1],
                "payload": orjson.loads(bytes(row[2])),
                "robot": row[3],
                "happening": row[4],
            }
            for row in await self.store.read(job)
        ]

    async def fired(self) -> int:
        """How many deliveries there are."""
        return len(await self.deliveries())


def channel(
    number: int = 1, topic: str = "/r1/chatter", schema_name: str = "std_msgs/msg/String", *, encoding: str = "cdr"
) -> Channel:
    """A topic as its robot announced it."""
    return Channel(
        robot="r1",
        channel_id=number,
        topic=topic,
        schema_name=schema_name,
        type_hash=type_hash(schema_name),
        encoding=encoding,
        schema_encoding="ros2msg",
        schema=schema_text(schema_name).encode(),
        delivery=EVENT,
    )


@asynccontextmanager
async def open_world(
    folder: Path, *, url: str = "", clock: ManualClock | None = None, name: str = "data", **limits: Any
) -> AsyncIterator[World]:
    """Rules that were started, closed afterwards as the gateway closes them."""
    clock = clock or ManualClock(wall_ns=NOW)
    retention = Retention(age_s=1000.0, size_bytes=1 << 30)
    store = Store(folder / name, clock=clock, retention=retention, queue_bytes=1 << 24, url=url)
    rules = Rules(
        store,
        clock=clock,
        seal=lambda purpose, key, plain: b"sealed:" + plain,
        unseal=lambda purpose, key, sealed: sealed.removeprefix(b"sealed:"),
        limits=replace(LIMITS, **limits),
    )
    journal = EventJournal(store, clock=clock, within=rules.engine.on_events)
    store.start(commit_hook=rules.engine)
    try:
        await rules.start()
        await journal.start()
        yield World(store, journal, rules, clock)
    finally:
        await rules.close()
        await store.close()
