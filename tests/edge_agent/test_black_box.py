"""A running agent's black box: what a node published is in the recording, whether the link was up or not."""

from __future__ import annotations

import asyncio
import hashlib
from pathlib import Path

from mcap.reader import make_reader

import metaros
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS
from tests.edge_agent.conftest import Rig, Robot
from tests.support.gateways.fake_gateway import BACKFILL, FakeGateway
from tests.support.waiting import wait_until_async

ID = "01HZZZZZZZZZZZZZZZZZZZZZ01"
SECOND = 1_000_000_000


def save(agent: Rig, recording_id: str = ID, **more: int) -> bytes:
    """Ask for the last minute."""
    return agent.command(save_recording=link_pb2.SaveRecording(recording_id=recording_id, last_ns=60 * SECOND, **more))


def want(gateway: FakeGateway, offset: int = 0, *, stored: bool = False) -> None:
    wanted = link_pb2.RecordingWanted(recording_id=ID, offset=offset, stored=stored)
    gateway.say(link_pb2.GatewayFrame(recording_wanted=wanted), lane=BACKFILL)


async def pulled(gateway: FakeGateway, folder: Path) -> Path:
    """Pull the recording that is offered, until it is stored."""
    half = gateway.half
    await wait_until_async(lambda: half.offers)
    offer = half.offers[-1]
    half.parts.clear()
    want(gateway)
    size = 0
    while size < offer.size_bytes:
        await wait_until_async(lambda have=size: sum(len(part.data) for part in half.parts) > have)
        size = sum(len(part.data) for part in half.parts)
        want(gateway, size, stored=size == offer.size_bytes)
    data = b"".join(part.data for part in half.parts)
    assert (len(data), hashlib.sha256(data).digest()) == (offer.size_bytes, offer.sha256)
    path = folder / "pulled.mcap"
    path.write_bytes(data)
    return path


def words(path: Path, topic: str) -> list[str]:
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(topics=[topic], log_time_order=False)
        return [codec(String).decode(message.data).data for _schema, _channel, message in found]


async def test_every_sample_of_a_live_topic_that_nobody_watched_is_in_the_recording(
    agent: Rig, robot: Robot, tmp_path: Path
) -> None:
    latched = robot.node.create_publisher(String, "map", metaros.qos_transient_local)
    latched.publish(String(data="the map"))
    publisher = robot.node.create_publisher(String, "chat", metaros.qos_reliable_all)
    chat, kept = await agent.wait_channel("/sim_1/chat"), await agent.wait_channel("/sim_1/map")
    await wait_until_async(lambda: publisher.events.matched)
    await asyncio.to_thread(lambda: [publisher.publish(String(data=str(i))) for i in range(3000)])

    def seen(channel: link_pb2.Channel, count: int) -> bool:
        rates = [t for s in agent.half.statistics for t in s.topics if t.channel_id == channel.channel_id]
        return any(rate.messages == count for rate in rates)

    await wait_until_async(lambda: seen(chat, 3000) and seen(kept, 1))
    result = await agent.result(save(agent))
    assert (result.ok, result.code) == (True, "")
    path = await pulled(agent.gateway, tmp_path)
    assert words(path, "/sim_1/chat") == [str(i) for i in range(3000)]
    assert words(path, "/sim_1/map") == ["the map"]
    recordings = tmp_path / "agent" / "recordings"
    await wait_until_async(lambda: list(recordings.iterdir()) == [])
    await wait_until_async(lambda: agent.half.statistics[-1].link.black_box.size_bytes > 0)
    box = agent.half.statistics[-1].link.black_box
    assert (box.quota_bytes, box.lost) == (LIMITS.black_box_memory_bytes, 0)
    assert SystemClock().wall_ns() - 300 * SECOND < box.from_ns <= box.to_ns


async def test_one_id_is_cut_once_and_errors_have_codes(agent: Rig, robot: Robot) -> None:
    publisher = robot.node.create_publisher(String, "chat", 10)
    await agent.wait_channel("/sim_1/chat")
    await wait_until_async(lambda: publisher.publish(String(data="x")) or agent.half.statistics)
    nothing = agent.command(save_recording=link_pb2.SaveRecording(recording_id=ID, from_ns=1, to_ns=2))
    assert (await agent.result(nothing)).code == "nothing_there"
    wrong = agent.command(save_recording=link_pb2.SaveRecording(recording_id="../x", last_ns=1))
    assert (await agent.result(wrong)).code == "usage"
    backwards = agent.command(save_recording=link_pb2.SaveRecording(recording_id=ID, from_ns=2, to_ns=1))
    assert (await agent.result(backwards)).code == "usage"

    async def until_something_is_there() -> None:
        while not (await agent.result(save(agent))).ok:
            publisher.publish(String(data="x"))

    await asyncio.wait_for(until_something_is_there(), 60)
    results = [await agent.result(command) for command in [save(agent), save(agent)]]
    assert [result.ok for result in results] == [True, True]
    await wait_until_async(lambda: agent.half.offers)
    assert [offer.recording_id for offer in agent.half.offers] == [ID]


async def test_a_recording_waits_for_the_link_and_survives_the_agent(
    zenoh_router: str, gateway: FakeGateway, robot: Robot, tmp_path: Path
) -> None:
    port = int(zenoh_router.rpartition(":")[2])
    settings = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=port,
        host_metrics=False,
        state_dir=tmp_path / "agent",
    )
    publisher = robot.node.create_publisher(String, "chat", 10)
    rig = Rig(gateway)
    first = asyncio.create_task(run_agent(settings))
    try:
        await rig.wait_channel("/sim_1/chat")

        async def until_something_is_there() -> None:
            while not (await rig.result(save(rig))).ok:
                publisher.publish(String(data="before the restart"))

        await asyncio.wait_for(until_something_is_there(), 60)
        await wait_until_async(lambda: gateway.half.offers)
        await gateway.stop()
    finally:
        first.cancel()
        await asyncio.gather(first, return_exceptions=True)
    gateway.half.offers.clear()
    await gateway.start()
    second = asyncio.create_task(run_agent(settings))
    try:
        path = await pulled(gateway, tmp_path)
        assert set(words(path, "/sim_1/chat")) == {"before the restart"}
        other = "01HZZZZZZZZZZZZZZZZZZZZZ02"
        assert (await rig.result(save(rig, other))).ok, "the ring of the first process is still there"
    finally:
        second.cancel()
        await asyncio.gather(second, return_exceptions=True)


async def test_without_a_black_box_it_says_so(zenoh_router: str, gateway: FakeGateway, tmp_path: Path) -> None:
    settings = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=int(zenoh_router.rpartition(":")[2]),
        host_metrics=False,
        state_dir=tmp_path / "agent",
        black_box=BlackBoxSettings(enabled=False),
    )
    rig = Rig(gateway)
    task = asyncio.create_task(run_agent(settings))
    try:
        await wait_until_async(lambda: gateway.connected)
        assert (await rig.result(save(rig))).code == "black_box_off"
        assert not (tmp_path / "agent" / "black_box").exists()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
