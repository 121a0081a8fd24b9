"""Seconds of three robots through the gateway, exported, and read by PyPI's `mcap` and by `rosbags`: the very bytes."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from gateway.api.rest.history.export import MEDIA_TYPE
from gateway.store.engines import open_engine
from gateway.store.objects import open_objects
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import message_class
from metaros.link import pack_batch
from tests.gateway.harness import EPOCH, ScriptedAgent, channel, client, running_gateway
from tests.gateway.history.source import compact_all

ROBOTS = ("sim_1", "sim_2", "sim_3")
SPAN_S = 8
DAY = {"start": "2026-09-21T00:00:00Z", "end": "2026-09-22T00:00:00Z"}
START_NS = 1_790_000_000 * 10**9
TOPICS = {  # name: type, rate in Hz
    "odom": ("nav_msgs/msg/Odometry", 20),
    "scan": ("sensor_msgs/msg/LaserScan", 5),
    "imu": ("sensor_msgs/msg/Imu", 25),
    "battery_state": ("sensor_msgs/msg/BatteryState", 1),
    "/diagnostics": ("std_msgs/msg/String", 2),  # one name, three robots
}
Published = dict[str, list[tuple[int, bytes]]]  # by topic in the file: stamp, bytes


def message(type_name: str, robot: int, number: int) -> Any:
    """A message whose bytes are its own."""
    made = message_class(type_name)()
    if type_name == "nav_msgs/msg/Odometry":
        made.header.frame_id, made.pose.pose.position.x = f"odom_{robot}", number / 7
    elif type_name == "sensor_msgs/msg/LaserScan":
        made.ranges, made.angle_increment = [robot + number / 9 + n / 100 for n in range(360)], 0.01
    elif type_name == "sensor_msgs/msg/Imu":
        made.angular_velocity.z = robot * 1000 + number / 3
    elif type_name == "sensor_msgs/msg/BatteryState":
        made.percentage, made.cell_voltage = number / 100, [3.7, 3.8, robot + 0.5]
    else:
        made.data = f"robot {robot} says {number}"
    return made


async def publish(agent: ScriptedAgent, robot: int) -> Published:
    """What one robot says, in batches of a second and more, as an agent sends what its outbox kept."""
    published: Published = {}
    for number, (name, (type_name, rate_hz)) in enumerate(TOPICS.items(), 1):
        full = name if name.startswith("/") else f"/{agent.robot}/{name}"
        await agent.announce(channel(number, full, type_name))
        encode = codec(type_name).encode
        step_ns = 10**9 // rate_hz
        samples = [
            (START_NS + n * step_ns + robot * 1000 + number, encode(message(type_name, robot, n)))
            for n in range(SPAN_S * rate_hz)
        ]
        for first in range(0, len(samples), 3 * rate_hz):
            some = samples[first : first + 3 * rate_hz]
            batch = pack_batch(number, EPOCH, first + 1, [stamp for stamp, _ in some], [data for _, data in some])
            await agent.send(batches=link_pb2.Batches(batches=[batch]))
        await agent.settled({number: len(samples)})
        published[f"/{agent.robot}{name}" if name.startswith("/") else full] = samples
    return published


async def saved(http: httpx.AsyncClient, path: Path, **query: Any) -> None:
    """Download an export."""
    async with http.stream("GET", "/api/v1/export.mcap", params=query, timeout=120) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"] == MEDIA_TYPE
        pieces: AsyncIterator[bytes] = answer.aiter_bytes()
        data = b"".join([piece async for piece in pieces])
    await asyncio.to_thread(path.write_bytes, data)


async def test_an_export_of_3_robots_is_what_was_published(tmp_path: Path) -> None:
    path = tmp_path / "export.mcap"
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        published: Published = {}
        for number, robot in enumerate(ROBOTS, 1):
            async with ScriptedAgent(ready, robot) as agent:
                published |= await publish(agent, number)
        await saved(http, path, robot=list(ROBOTS), **DAY)
    assert sum(len(samples) for samples in published.values()) == 3 * SPAN_S * 53
    assert with_mcap(path) == published
    await asyncio.to_thread(check_with_rosbags, path, published)
    assert await asyncio.to_thread(compacted, tmp_path / "data") > 0
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        await saved(http, path, robot=list(ROBOTS), **DAY)
    assert with_mcap(path) == published
    await asyncio.to_thread(check_with_rosbags, path, published)


def compacted(data_dir: Path) -> int:
    """All that is stored there becomes segments; how many."""
    engine, _ = open_engine("", data_dir)
    try:
        return compact_all(engine, open_objects("", data_dir))
    finally:
        engine.close()


def with_mcap(path: Path) -> Published:
    """What PyPI's reader finds, with every checksum looked at."""
    found: Published = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        last_ns = 0
        for schema, topic, entry in reader.iter_messages(log_time_order=False):
            assert schema is not None
            assert topic.metadata["robot"] in ROBOTS
            assert entry.log_time >= last_ns
            last_ns = entry.log_time
            found.setdefault(topic.topic, []).append((entry.log_time, entry.data))
    return found


@functools.cache
def typestore() -> Typestore:
    """What rosbags knows by itself; it reads all of it anew each time."""
    return get_typestore(Stores.ROS2_HUMBLE)


def check_with_rosbags(path: Path, published: Published) -> None:
    """rosbags opens it, reads the same bytes, and decodes them by the definitions in the file."""
    found: Published = {}
    with AnyReader([path], default_typestore=typestore()) as reader:
        assert reader.message_count == sum(len(samples) for samples in published.values())
        for connection, stamp_ns, data in reader.messages():
            found.setdefault(connection.topic, []).append((stamp_ns, bytes(data)))
            if len(found[connection.topic]) == 1:
                assert reader.deserialize(data, connection.msgtype) is not None
    assert found == published
