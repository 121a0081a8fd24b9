"""Resumes a viewer's subscription: what was stored since, then live, without a gap between and nothing twice.

While the stored samples go out, as fast as the client takes them, live ones wait beside them, bounded like any other
subscription's queue. What is not stored, and what the store knows to be lost, is said.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gateway.api.ws.send_queue import SendQueue
from gateway.domain.records import Record
from gateway.errors import InvalidRequestError
from gateway.history.cursor import read_cursor
from gateway.history.losses import Loss, merged_losses
from gateway.history.pages import Page, PageRequest
from gateway.live.encoding import Block, Encoding
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer
from metaros.errors import MetarosError

__all__ = ["MAX_RESUMED", "Resumed", "Resumption", "read_resume"]

MAX_RESUMED = 64  # topics of one subscription
PAGE = 256  # messages that are read and written at a time
COMMIT_S = 0.25  # what arrived before is stored by then
MAX_NS = 2**63 - 1

Read = Callable[[PageRequest], Awaitable[Page]]
Say = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Resumed:
    """A topic of a robot, and the stamp of the last sample that the client has of it."""

    robot: str
    topic: str
    after_ns: int


class _Closed:
    """A sink that accepts nothing."""

    on_full: Callable[[], None] | None = None
    on_drained: Callable[[], None] | None = None

    def ready(self) -> bool:
        """Never."""
        return False

    def write(self, data: bytes) -> None:
        """Not called."""


def read_resume(request: Mapping[str, Any]) -> list[Resumed]:
    """The field `resume` of a request: `{robot: {topic: nanoseconds}}`, as numbers or as texts of digits."""
    value = request.get("resume")
    if value is None:
        return []
    problem = f"resume is an object of robots, each an object of at most {MAX_RESUMED} topics with stamps in ns"
    if not isinstance(value, dict) or not all(isinstance(topics, dict) for topics in value.values()):
        raise InvalidRequestError(problem)
    found = [
        Resumed(robot, topic, _stamp(at, problem)) for robot, topics in value.items() for topic, at in topics.items()
    ]
    if len(found) > MAX_RESUMED:
        raise InvalidRequestError(problem)
    if request.get("mode") != "queue":
        raise InvalidRequestError('resume is for the mode "queue"')
    return found


def _stamp(value: Any, problem: str) -> int:
    if isinstance(value, str) and value.isascii() and value.isdigit() and len(value) <= 19:
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < MAX_NS:
        raise InvalidRequestError(problem)
    return value


class Resumption:
    """One subscription that goes on; `run` is a task, and ends with the subscription as any other on the viewer."""

    def __init__(
        self, hub: Hub, viewer: Viewer, send_queue: SendQueue, live: TopicSubscription, *, read: Read, say: Say
    ) -> None:
        self._viewer = viewer
        self._send_queue = send_queue
        self._live = live
        self._read = read
        self._say = say
        self._beside = hub.join(_Closed())
        self._waiting = TopicSubscription(
            live.number, live.wants, live.encoding, max_rate_hz=live.max_rate_hz, queue_bytes=live.queue_bytes
        )
        self._beside.subscribe(self._waiting)
        self._last_ns: dict[tuple[str, str], int] = {}

    async def run(self, resumed: list[Resumed], now_ns: Callable[[], int]) -> None:
        """Write what is stored, topic by topic, then what came meanwhile, and be live."""
        try:
            await asyncio.sleep(COMMIT_S)
            for item in resumed:
                self._last_ns[item.robot, item.topic] = item.after_ns
                await self._fill(item, now_ns)
            self._go_live()
        finally:
            self._beside.close()

    async def _fill(self, item: Resumed, now_ns: Callable[[], int]) -> None:
        count, losses, cursor = 0, list[Loss](), ""
        try:
            while True:
                page = await self._read(
                    PageRequest(
                        robot_id=item.robot,
                        topics=(item.topic,),
                        start_ns=item.after_ns + 1,
                        end_ns=now_ns(),
                        limit=PAGE,
                        after=read_cursor(cursor, newest_first=False) if cursor else None,
                    )
                )
                losses = [*losses, *page.losses]
                count += await self._write(item, page)
                if page.next is None:
                    break
                cursor = page.next
        except MetarosError as error:
            losses.append(Loss(from_ns=item.after_ns, to_ns=now_ns(), count=0, reason=error.code, topic=item.topic))
        if not count and not losses:
            end_ns = now_ns()  # whether there was nothing, or it is not kept, the store cannot tell
            losses.append(Loss(from_ns=item.after_ns, to_ns=end_ns, count=0, reason="nothing_stored", topic=item.topic))
        self._say(
            {
                "op": "resumed",
                "id": self._live.number,
                "robot": item.robot,
                "topic": item.topic,
                "count": count,
                "gaps": [_gap(loss) for loss in merged_losses(losses)],
            }
        )

    async def _write(self, item: Resumed, page: Page) -> int:
        count = 0
        for message in page.messages:
            channel = message.channel
            if not self._live.wants(channel):
                continue
            record = Record(message.seq, message.stamp_ns, message.receive_ns, message.payload)
            data = await _encoded(self._live.encoding(channel), Block(channel, [record]))
            await self._send_queue.drain()
            self._send_queue.write(data)
            self._last_ns[item.robot, item.topic] = message.stamp_ns
            count += 1
        return count

    def _go_live(self) -> None:
        """From here on as any other: first what came meanwhile and is not stored among the rest."""
        self._beside.close()
        waiting = []
        while (found := self._waiting.take()) is not None:
            waiting.append(found)
        self._live.dropped = self._waiting.dropped
        self._viewer.subscribe(self._live)
        for block, encoding in waiting:
            last_ns = self._last_ns.get((block.channel.robot, block.channel.topic), -1)
            new = [record for record in block.records if record.stamp_ns > last_ns]
            if new:
                self._viewer.hold(self._live, block.only(new), encoding)
        self._viewer.drain()


def _gap(loss: Loss) -> dict[str, Any]:
    return {"from_ns": loss.from_ns, "to_ns": loss.to_ns, "count": loss.count, "reason": loss.reason}


async def _encoded(encoding: Encoding, block: Block) -> bytes:
    if type(encoding).view is None:
        return block.encoded(encoding)
    return await asyncio.to_thread(block.encoded, encoding)
