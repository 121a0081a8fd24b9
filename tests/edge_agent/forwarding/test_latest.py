"""latest_only: while the outbox is behind, one sample a topic waits, the newest; it goes as soon as that is over."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from edge_agent.config.topic_table import TopicRule
from edge_agent.forwarding.channels import Channel
from edge_agent.forwarding.latest import LatestOnly
from tests.support.waiting import wait_until_async


@dataclass
class Log:
    waiting_bytes: int = 0


@dataclass
class Box:
    """As much of an outbox as matters here."""

    online: bool = True
    logs: dict[str, Log] = field(default_factory=lambda: {"bulk": Log()})
    taken: list[bytes] = field(default_factory=list)

    def append(self, stream_id: int, delivery: str, stamp_ns: int, data: bytes) -> None:
        self.taken.append(data)


def channel(number: int = 1) -> Channel:
    rule = TopicRule(match="**", delivery="bulk", latest_only=True)
    return Channel(
        channel_id=number,
        topic=f"/t{number}",
        type_name="std_msgs/msg/String",
        type_hash="",
        rule=rule,
        delivery="bulk",
        max_rate_hz=0.0,
        metrics=None,
        schema=b"",
    )


async def test_nothing_waits_while_the_outbox_keeps_up() -> None:
    box, woken = Box(), []
    latest, one = LatestOnly(box, lambda: woken.append(1)), channel()  # type: ignore[arg-type]
    for data in (b"a", b"b"):
        latest.put(one, 0, data)
    assert (box.taken, one.thinned, len(latest)) == ([b"a", b"b"], 0, 0)


async def test_the_newest_waits_and_goes_when_the_link_is_back() -> None:
    box, woken = Box(online=False), []
    latest, one, two = LatestOnly(box, lambda: woken.append(1)), channel(1), channel(2)  # type: ignore[arg-type]
    for data in (b"a", b"b", b"c"):
        latest.put(one, 0, data)
    latest.put(two, 0, b"x")
    assert (box.taken, one.thinned, two.thinned, len(latest)) == ([], 2, 0, 2)
    await asyncio.sleep(0)
    box.online, box.logs["bulk"].waiting_bytes = True, 1 << 30
    latest.put(two, 0, b"y")
    assert two.thinned == 1
    box.logs["bulk"].waiting_bytes = 0
    await wait_until_async(lambda: sorted(box.taken) == [b"c", b"y"])
    assert woken
    assert len(latest) == 0
