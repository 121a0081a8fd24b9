"""The tap on a real router: what is published on the robot arrives at a gateway as the same bytes."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
import zenoh

import metaros
from edge_agent.config.settings import Settings
from edge_agent.forwarding.tap import matching_qos, topic_of
from edge_agent.main import run_agent
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.interfaces.sensor_msgs.msg import BatteryState
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import Durability, History, QoSProfile, Reliability, open_router
from tests.edge_agent.conftest import Rig, Robot
from tests.support.gateways.fake_gateway import FakeGateway
from tests.support.ports import free_port
from tests.support.waiting import wait_until_async


def words(payloads: list[bytes]) -> list[str]:
    return [codec(String).decode(payload).data for payload in payloads]


async def test_bulk_arrives_complete_in_order_and_unchanged(agent: Rig, robot: Robot) -> None:
    publisher = robot.node.create_publisher(String, "log", metaros.qos_reliable_all)
    channel = await agent.wait_channel("/sim_1/log")
    assert getattr(channel, "class") == link_pb2.DELIVERY_CLASS_BULK
    assert channel.schema_name == "std_msgs/msg/String"
    await wait_until_async(lambda: publisher.events.matched)
    await asyncio.to_thread(lambda: [publisher.publish(String(data=str(i))) for i in range(2000)])
    await wait_until_async(lambda: len(agent.half.all_rows(channel.channel_id)) == 2000)
    rows = agent.half.all_rows(channel.channel_id)
    assert words([row for row in rows if isinstance(row, bytes)]) == [str(i) for i in range(2000)]


async def test_live_leaves_the_robot_only_on_demand(agent: Rig, robot: Robot) -> None:
    publisher = robot.node.create_publisher(String, "chat", 10)
    channel = await agent.wait_channel("/sim_1/chat")
    live = agent.half.live[channel.channel_id]
    stop = asyncio.Event()

    async def talk() -> None:
        while not stop.is_set():
            publisher.publish(String(data="hello"))
            await asyncio.sleep(0.01)

    talking = asyncio.create_task(talk())
    await wait_until_async(
        lambda: any(
            t.messages > 20 for s in agent.half.statistics for t in s.topics if t.channel_id == channel.channel_id
        )
    )
    assert not live
    agent.demand(channel, 20.0)
    await wait_until_async(lambda: len(live) >= 5)
    stop.set()
    await talking
    assert set(words([payload for _, payload in live])) == {"hello"}


async def test_series_are_read_from_cdr(agent: Rig, robot: Robot) -> None:
    publisher = robot.node.create_publisher(BatteryState, "battery_state", 10)
    await agent.wait_channel("/sim_1/battery_state")

    async def until_there() -> None:
        while not agent.half.all_rows(0):
            publisher.publish(BatteryState(percentage=0.25, voltage=24.5))
            await asyncio.sleep(0.05)

    await asyncio.wait_for(until_there(), 60)
    names = {series.series_id: series.name for series in agent.half.series.values()}
    values = {names[row[0]]: row[2] for row in agent.half.all_rows(0) if isinstance(row, tuple)}
    assert values["battery_state.percentage"] == 0.25
    assert values["battery_state.voltage"] == 24.5


async def test_other_namespaces_and_their_log_lines_stay_out(agent: Rig, robot: Robot) -> None:
    stranger = robot.other("base", "/sim_2")
    stranger.create_publisher(String, "chat", 10)
    stranger.get_logger().info("not ours")
    robot.node.create_publisher(String, "chat", 10)
    robot.node.get_logger().info("ours")
    rosout = await agent.wait_channel("/rosout")
    await agent.wait_channel("/sim_1/chat")
    stranger.get_logger().info("not ours either")
    robot.node.get_logger().info("ours again")
    decode = codec("rcl_interfaces/msg/Log").decode

    def lines() -> list[bytes]:
        return [row for row in agent.half.all_rows(rosout.channel_id) if isinstance(row, bytes)]

    await wait_until_async(lambda: any(b"ours again" in line for line in lines()))
    assert all(decode(line).name.startswith("sim_1") for line in lines())
    assert agent.channel("/sim_2/chat") is None


async def test_a_topic_with_subscribers_only_is_listed(agent: Rig, robot: Robot) -> None:
    robot.node.create_subscription(String, "orders", lambda message: None, 10)
    channel = await agent.wait_channel("/sim_1/orders")
    await wait_until_async(
        lambda: any(
            (rate.publishers, rate.subscribers) == (0, 1)
            for statistics in agent.half.statistics
            for rate in statistics.topics
            if rate.channel_id == channel.channel_id
        )
    )


async def test_latched_messages_from_before_the_agent_arrive(
    zenoh_router: str, gateway: FakeGateway, robot: Robot, tmp_path: Path
) -> None:
    publisher = robot.node.create_publisher(String, "map_name", metaros.qos_transient_local)
    publisher.publish(String(data="hall 3"))
    port = int(zenoh_router.rpartition(":")[2])
    from edge_agent.config.topic_table import TopicRule

    topics = (TopicRule(match="**", delivery="bulk"),)
    settings = Settings(
        name="a",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=port,
        host_metrics=False,
        topics=topics,
        state_dir=tmp_path / "agent",
    )
    task = asyncio.create_task(run_agent(settings))
    rig = Rig(gateway)
    try:
        channel = await rig.wait_channel("/sim_1/map_name")
        await wait_until_async(lambda: rig.half.all_rows(channel.channel_id))
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert words([row for row in rig.half.all_rows(channel.channel_id) if isinstance(row, bytes)]) == ["hall 3"]


async def test_samples_without_a_valid_attachment_are_counted(agent: Rig, robot: Robot, zenoh_router: str) -> None:
    publisher = robot.node.create_publisher(String, "log", metaros.qos_reliable_all)
    channel = await agent.wait_channel("/sim_1/log")
    await wait_until_async(lambda: publisher.events.matched)
    publisher.publish(String(data="good"))
    await wait_until_async(lambda: agent.half.all_rows(channel.channel_id))
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", f'["{zenoh_router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    key = f"0/sim_1/log/std_msgs::msg::dds_::String_/{channel.type_hash}"
    with zenoh.open(config) as session:
        foreign = session.declare_publisher(key)
        await wait_until_async(lambda: foreign.matching_status.matching)
        foreign.put(b"no attachment")
        foreign.put(b"short", attachment=b"abc")
    await wait_until_async(lambda: agent.half.statistics and agent.half.statistics[-1].malformed == 2)
    assert len(agent.half.all_rows(channel.channel_id)) == 1


async def test_host_metrics_of_the_hosts_agent(zenoh_router: str, gateway: FakeGateway, tmp_path: Path) -> None:
    port = int(zenoh_router.rpartition(":")[2])
    settings = Settings(name="host", gateway=gateway.target, zenoh_port=port, state_dir=tmp_path / "agent")
    task = asyncio.create_task(run_agent(settings))
    rig = Rig(gateway)
    wanted = {"host.cpu.percent", "host.cpu.load_1m", "host.memory.percent", "host.disk.percent"}
    wanted |= {"host.network.rx_bytes_per_s", "host.network.tx_bytes_per_s"}

    def seen() -> set[str]:
        names = {series.series_id: series.name for series in rig.half.series.values()}
        return {names[row[0]] for row in rig.half.all_rows(0) if isinstance(row, tuple)}

    try:
        await wait_until_async(lambda: seen() >= wanted)
        assert rig.channel("/host/topics") is not None
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_it_finds_a_router_that_starts_later_and_one_that_restarts(gateway: FakeGateway, tmp_path: Path) -> None:
    port = free_port()
    settings = Settings(
        name="a",
        namespace="/sim_1",
        gateway=gateway.target,
        zenoh_port=port,
        host_metrics=False,
        state_dir=tmp_path / "agent",
    )
    task = asyncio.create_task(run_agent(settings))
    rig = Rig(gateway)
    endpoint = f"tcp/127.0.0.1:{port}"
    try:
        await wait_until_async(lambda: gateway.connected)
        for topic in ("first", "second"):
            with await asyncio.to_thread(open_router, port), metaros.Context(connect=endpoint) as context:
                node = metaros.Node("late", namespace="/sim_1", context=context)
                publisher = node.create_publisher(String, topic, metaros.qos_reliable_all)
                channel = await rig.wait_channel(f"/sim_1/{topic}")
                await wait_until_async(lambda p=publisher: p.events.matched)  # type: ignore[misc]
                publisher.publish(String(data=topic))
                await wait_until_async(lambda c=channel: rig.half.all_rows(c.channel_id))  # type: ignore[misc]
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


LOSSLESS = QoSProfile(history=History.KEEP_ALL)
LATCHED = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=1)
SENSOR = QoSProfile(reliability=Reliability.BEST_EFFORT)


@pytest.mark.parametrize(
    ("offered", "expected"),
    [
        ([SENSOR], (Reliability.BEST_EFFORT, Durability.VOLATILE, History.KEEP_LAST)),
        ([QoSProfile()], (Reliability.BEST_EFFORT, Durability.VOLATILE, History.KEEP_LAST)),
        ([LOSSLESS], (Reliability.RELIABLE, Durability.VOLATILE, History.KEEP_ALL)),
        ([LATCHED], (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, History.KEEP_LAST)),
        ([LOSSLESS, SENSOR], (Reliability.BEST_EFFORT, Durability.VOLATILE, History.KEEP_LAST)),
    ],
)
def test_qos_matches_every_publisher(offered: list[QoSProfile], expected: tuple[object, ...]) -> None:
    qos = matching_qos(offered)
    assert (qos.reliability, qos.durability, qos.history) == expected


def test_route_of_a_key() -> None:
    assert topic_of("0/sim_1/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_ab") == "sim_1/odom|RIHS01_ab"
