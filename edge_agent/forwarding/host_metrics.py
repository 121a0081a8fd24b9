"""This host as ROS topics: CPU, memory, disk, temperature and network at 1 Hz, and what the agent's tap sees.

The topics are those of a node `host` in the agent's namespace (`/host/cpu` for the host's own agent), so that the
agent taps them like any other and ROS tools see them too.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

from edge_agent.forwarding.channels import Channel
from metaros.clock import Clock
from metaros.drivers.host_metrics.reader import HOST_TOPICS, HostReader, read_all
from metaros.idl import message_class
from metaros.node import Node
from metaros.wire import qos_default

__all__ = ["publish_host"]

PERIOD_S = 1.0


RATES_TOPIC, RATES_TYPE, RATE_TYPE = "host/topics", "metaros_msgs/msg/TopicRates", "metaros_msgs/msg/TopicRate"


async def publish_host(node: Node, channels: Iterable[Channel], clock: Clock) -> None:
    """Publish every host topic once a second until cancelled."""
    reader = HostReader(clock)
    publishers = {
        topic: node.create_publisher(message_class(type_name), topic, qos_default)
        for topic, type_name in [*((item.topic, item.type_name) for item in HOST_TOPICS), (RATES_TOPIC, RATES_TYPE)]
    }
    before: dict[int, tuple[int, int]] = {}
    unreadable: set[str] = set()
    while True:
        await asyncio.sleep(PERIOD_S)
        for item, fields in await asyncio.to_thread(read_all, reader, HOST_TOPICS, unreadable):
            publishers[item.topic].publish(message_class(item.type_name)(stamp=stamp(clock), **fields))
        rates = message_class(RATES_TYPE)(stamp=stamp(clock), topics=topic_rates(channels, before))
        publishers[RATES_TOPIC].publish(rates)


def topic_rates(channels: Iterable[Channel], before: dict[int, tuple[int, int]]) -> list[Any]:
    """A TopicRate for each channel, over the period since `before`, which is brought up to date."""
    make = message_class(RATE_TYPE)
    rows = []
    for channel in channels:
        messages, size_bytes = before.get(channel.channel_id, (0, 0))
        before[channel.channel_id] = (channel.messages, channel.size_bytes)
        rows.append(
            make(
                topic=channel.topic,
                type=channel.type_name,
                rate_hz=(channel.messages - messages) / PERIOD_S,
                bytes_per_s=(channel.size_bytes - size_bytes) / PERIOD_S,
                messages=channel.messages,
                dropped=channel.dropped,
            )
        )
    return rows


def stamp(clock: Clock) -> Any:
    """Now, as builtin_interfaces/Time."""
    seconds, nanoseconds = divmod(clock.wall_ns(), 1_000_000_000)
    return message_class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)
