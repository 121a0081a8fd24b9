"""The newest message of each topic of a robot: what arrives within a moment, else what is stored.

A topic of the live class leaves its robot only while somebody looks: asking for a snapshot is a look, as long as it
takes. Nothing is decoded twice, and nothing for somebody else's snapshot again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import orjson

from gateway.domain.channel import LIVE, Channel
from gateway.domain.decoder import Decoder
from gateway.history.manager import HistoryManager
from gateway.history.messages import Message
from gateway.ingest.registry import RobotRecord
from gateway.live.encoding import Block, View
from gateway.live.hub import Hub
from gateway.live.json_view import json_view
from gateway.live.subscription import TopicSubscription
from metaros.limits import LIMITS

__all__ = ["Shown", "collect_live", "newest_stored"]

Shown = dict[str, Any]  # a message as the API shows it, by topic


@dataclass(frozen=True, slots=True)
class _Newest:
    """The newest sample of a block as a line of JSON; equal for everybody."""

    view: ClassVar[View[bytes] | None] = json_view

    def encode(self, block: Block) -> bytes:
        """The line."""
        made, record = block.views(json_view)[-1], block.records[-1]
        if made is not None:
            content: Shown = {"message": orjson.Fragment(made)}
        else:
            content = Decoder().view(block.channel, record.payload)  # once more, for what is wrong with it
        facts = _facts(block.channel, record.seq, record.stamp_ns, "live")
        return orjson.dumps({**facts, **content}) + b"\n"


class _Collected:
    """A sink that keeps the newest line of each topic, up to a bound in bytes."""

    def __init__(self, wanted: Collection[str]) -> None:
        self.on_full: Callable[[], None] | None = None
        self.on_drained: Callable[[], None] | None = None
        self.lines: dict[str, Shown] = {}
        self.whole = asyncio.Event()
        self._wanted = set(wanted)
        self._size_bytes = 0

    def ready(self) -> bool:
        """Until there is too much of it."""
        return self._size_bytes < LIMITS.history_instant_bytes

    def write(self, data: bytes, /) -> None:
        """Take lines in."""
        self._size_bytes += len(data)
        for line in data.splitlines():
            shown = orjson.loads(line)
            self.lines[shown["topic"]] = shown
        if not self.ready() and self.on_full is not None:
            self.on_full()
        if self._wanted <= self.lines.keys():
            self.whole.set()


async def collect_live(hub: Hub, record: RobotRecord, topics: Collection[str], *, wait_s: float) -> dict[str, Shown]:
    """What arrives on these topics within a moment; it ends early when each of the live ones had a message."""
    robot, chosen = record.robot.id, frozenset(topics)
    live = [state.channel for state in record.topics() if state.channel.topic in chosen and not state.channel.history]
    wanted = {channel.topic for channel in live if channel.delivery == LIVE and channel.forward}
    if not record.online or not wait_s or not wanted:
        return {}
    sink = _Collected(wanted)
    viewer = hub.join(sink)
    try:
        viewer.subscribe(
            TopicSubscription(
                1,
                lambda channel: channel.robot == robot and channel.topic in chosen,
                lambda channel: _Newest(),
                latest=True,
            )
        )
        async with asyncio.timeout(wait_s):
            await sink.whole.wait()
    except TimeoutError:
        pass
    finally:
        viewer.close()
    return sink.lines


async def newest_stored(
    history: HistoryManager, robot: str, topics: Collection[str], *, now_ns: int
) -> dict[str, Shown]:
    """The newest stored message of each of these topics that has one."""
    if not topics:
        return {}
    instant = await history.at(robot, tuple(topics), t_ns=now_ns, max_age_ns=now_ns)  # however old
    return await asyncio.to_thread(_shown, instant.messages)


def _shown(messages: Sequence[Message]) -> dict[str, Shown]:
    decoder = Decoder()
    return {
        item.channel.topic: {
            **_facts(item.channel, item.seq, item.stamp_ns, "stored"),
            **decoder.view(item.channel, item.payload),
        }
        for item in messages
    }


def _facts(channel: Channel, seq: int, stamp_ns: int, source: str) -> Shown:
    return {
        "topic": channel.topic,
        "type": channel.schema_name,
        "class": channel.delivery,
        "seq": seq,
        "stamp_ms": stamp_ns / 1e6,
        "source": source,
    }
