"""A whole agent and its twin: tried over a real link, confirmed, taken back, reported; parameters and lifecycle too."""

from __future__ import annotations

import asyncio
import hashlib
import json
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import metaros
from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from edge_agent.outbox import OsDisk
from edge_agent.twin.record import Pending, Record, Version
from edge_agent.twin.state import TwinFile
from metaros._proto import link_pb2
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS, Limits
from metaros.link import CHANNEL_MASK
from tests.edge_agent.conftest import Rig, Robot
from tests.support.gateways.fake_gateway import FakeGateway, fake_gateway
from tests.support.gateways.gateway_half import GatewayHalf
from tests.support.waiting import wait_until_async

QUICK = replace(LIMITS, twin_report_s=0.02, twin_settle_s=0.2, twin_window_least_s=0.3)


class WeakLink(GatewayHalf):
    """A link that breaks whenever a bulk sample is sent over it."""

    def on_batches(self, lane: int, batches: link_pb2.Batches) -> None:
        for batch in batches.batches:
            channel = self.channels.get(batch.stream_id & CHANNEL_MASK)
            if channel is not None and getattr(channel, "class") == link_pb2.DELIVERY_CLASS_BULK:
                raise ConnectionError("the link cannot carry it")
        super().on_batches(lane, batches)


class Twin:
    """An agent of /sim_1 and the gateway's side of its twin."""

    def __init__(self, gateway: FakeGateway, state: Path) -> None:
        self.gateway, self.state = gateway, state
        gateway.half.welcome.twin = True

    @property
    def last(self) -> link_pb2.TwinReport:
        return self.gateway.half.twins[-1] if self.gateway.half.twins else link_pb2.TwinReport()

    @property
    def reported(self) -> dict[str, Any]:
        return json.loads(self.last.reported or b"{}")

    @property
    def persisted(self) -> Record:
        return TwinFile(OsDisk(self.state)).load()

    def desire(self, revision: int, *, window_s: float = 20.0, **sections: object) -> None:
        document = json.dumps(sections).encode()
        frame = link_pb2.TwinDesired(
            revision=revision,
            sha256=hashlib.sha256(document).digest(),
            document=document,
            confirm_within_ms=round(window_s * 1000),
        )
        self.gateway.say(link_pb2.GatewayFrame(twin=frame))

    def confirm(self, revision: int) -> None:
        frame = link_pb2.TwinConfirmed(revision=revision)
        self.gateway.say(link_pb2.GatewayFrame(twin_confirmed=frame))

    async def comes_to(self, revision: int, state: str) -> None:
        await wait_until_async(lambda: (self.last.revision, self.last.state) == (revision, state), timeout_s=90)

    async def becomes(self, revision: int, **sections: object) -> None:
        """Desired, tried and confirmed."""
        self.desire(revision, **sections)
        await self.comes_to(revision, "confirming")
        self.confirm(revision)
        await self.comes_to(revision, "applied")


@asynccontextmanager
async def running(twin: Twin, zenoh_router: str, limits: Limits = QUICK) -> AsyncIterator[Rig]:
    settings = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=twin.gateway.target,
        zenoh_port=int(zenoh_router.rpartition(":")[2]),
        host_metrics=False,
        state_dir=twin.state,
    )
    task = asyncio.create_task(run_agent(settings, limits=limits))
    try:
        await wait_until_async(lambda: twin.gateway.connected or task.done())
        assert not task.done(), task.exception()
        yield Rig(twin.gateway)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
async def twin(gateway: FakeGateway, tmp_path: Path) -> Twin:
    return Twin(gateway, tmp_path / "agent")


async def test_topics_and_budget_change_while_the_agent_runs_and_are_confirmed(
    twin: Twin, robot: Robot, zenoh_router: str
) -> None:
    robot.node.create_publisher(String, "chat")
    async with running(twin, zenoh_router) as rig:
        await twin.comes_to(0, "applied")
        before = await rig.wait_channel("/sim_1/chat")
        assert before.max_rate_hz == 10.0
        twin.desire(1, topics={"chat": {"rate_hz": 2.0}}, budget={"bytes_per_s": 50_000})
        await twin.comes_to(1, "confirming")
        assert twin.persisted.pending is not None
        await wait_until_async(lambda: rig.half.channels[before.channel_id].max_rate_hz == 2.0)
        twin.confirm(1)
        await twin.comes_to(1, "applied")
        assert twin.reported["budget"] == {"bytes_per_s": 50_000}
        assert (twin.persisted.pending, twin.persisted.applied.revision, twin.last.applied) == (None, 1, 1)
        assert twin.last.sha256 == twin.persisted.applied.sha256
        refused = await rig.result(rig.command(set_uplink=link_pb2.SetUplink(bytes_per_s=9000)))
        assert refused.code == "twin_rules"
        await twin.becomes(2)
        assert twin.reported["budget"] == {"bytes_per_s": 0}
        await wait_until_async(lambda: rig.half.channels[before.channel_id].max_rate_hz == 10.0)


async def test_a_document_that_kills_the_link_is_taken_back_by_itself(
    tmp_path: Path, robot: Robot, zenoh_router: str
) -> None:
    publisher = robot.node.create_publisher(String, "chat")
    stop = asyncio.Event()

    async def chat() -> None:
        while not stop.is_set():
            publisher.publish(String(data="x" * 1000))
            await asyncio.sleep(0.02)

    async with fake_gateway(WeakLink()) as gateway:
        twin, talking = Twin(gateway, tmp_path / "agent"), asyncio.create_task(chat())
        try:
            async with running(twin, zenoh_router, replace(QUICK, twin_settle_s=0.5)) as rig:
                await rig.wait_channel("/sim_1/chat")
                await twin.comes_to(0, "applied")
                sessions = gateway.sessions
                twin.desire(1, window_s=2.0, topics={"chat": {"class": "bulk"}})
                await wait_until_async(lambda: twin.persisted.pending is not None)
                await wait_until_async(lambda: gateway.sessions > sessions)
                await wait_until_async(lambda: twin.persisted.undone == "reverted", timeout_s=90)
                assert twin.persisted.applied.revision == 0
                assert not any(report.state == "confirming" for report in rig.half.twins)
                gateway.half.__class__ = GatewayHalf  # the link is a better one: what waited goes, and it is told
                await twin.comes_to(1, "reverted")
                assert (twin.last.code, twin.last.applied) == ("not_confirmed", 0)
        finally:
            stop.set()
            await talking


async def test_what_nobody_confirms_is_taken_back_and_not_tried_again(twin: Twin, zenoh_router: str) -> None:
    async with running(twin, zenoh_router):
        await twin.comes_to(0, "applied")
        twin.desire(1, window_s=0.3, budget={"bytes_per_s": 50_000})
        await twin.comes_to(1, "reverted")
        told = len(twin.gateway.half.twins)
        twin.desire(1, window_s=0.3, budget={"bytes_per_s": 50_000})
        await wait_until_async(lambda: len(twin.gateway.half.twins) > told)
        assert (twin.last.state, twin.reported["budget"]) == ("reverted", {"bytes_per_s": 0})
        await twin.becomes(2, budget={"bytes_per_s": 60_000})


async def test_a_node_that_may_not_run_here_makes_the_whole_document_refused(twin: Twin, zenoh_router: str) -> None:
    async with running(twin, zenoh_router):
        await twin.comes_to(0, "applied")
        twin.desire(1, nodes={"x": {"command": ["true"]}}, budget={"bytes_per_s": 50_000})
        await twin.comes_to(1, "refused")
        assert (twin.last.code, twin.reported["budget"]) == ("node_not_allowed", {"bytes_per_s": 0})
        assert twin.persisted.applied.revision == 0


async def test_a_trial_of_an_earlier_run_of_the_system_is_over_before_the_link_is_up(
    twin: Twin, zenoh_router: str
) -> None:
    version = Version(revision=4, document=b'{"budget":{"bytes_per_s":50000}}')
    pending = Pending(version=version, until_s=1e12, boot_id="another")
    TwinFile(OsDisk(twin.state)).keep(Record(pending=pending, seen=4))
    async with running(twin, zenoh_router):
        await wait_until_async(lambda: bool(twin.gateway.half.twins))
        first = twin.gateway.half.twins[0]
        assert (first.revision, first.applied, first.state) == (4, 0, "reverted")
        assert twin.persisted.pending is None


async def test_a_confirmed_document_holds_after_a_restart_without_any_link(twin: Twin, zenoh_router: str) -> None:
    async with running(twin, zenoh_router):
        await twin.comes_to(0, "applied")
        await twin.becomes(1, budget={"bytes_per_s": 50_000})
    twin.gateway.half.twins.clear()
    async with running(twin, zenoh_router):
        await twin.comes_to(1, "applied")
        assert twin.reported["budget"] == {"bytes_per_s": 50_000}


async def test_parameters_are_set_refused_by_name_and_given_back(twin: Twin, robot: Robot, zenoh_router: str) -> None:
    robot.node.parameters.declare("speed", 1.0, maximum=5.0)
    robot.node.parameters.declare("name", "base")
    async with running(twin, zenoh_router):
        await twin.comes_to(0, "applied")
        await twin.becomes(1, parameters={"base": {"speed": 2, "name": "boss"}, "later": {"x": 1}})
        await wait_until_async(lambda: twin.reported["parameters"]["/sim_1/base"]["state"] == "applied")
        assert robot.node.parameters["speed"] == 2.0
        assert robot.node.parameters["name"] == "boss"
        assert twin.reported["parameters"]["/sim_1/later"]["state"] == "waiting"
        later = robot.other("later", "/sim_1")
        later.parameters.declare("x", 0)
        await twin.becomes(2, parameters={"base": {"speed": 99.0}, "/elsewhere/n": {"x": 1}})
        await wait_until_async(lambda: twin.reported["parameters"]["/sim_1/base"]["state"] == "refused")
        assert set(twin.reported["parameters"]["/sim_1/base"]["refused"]) == {"speed"}
        assert "outside" in twin.reported["parameters"]["/elsewhere/n"]["message"]
        await wait_until_async(lambda: robot.node.parameters["name"] == "base")
        await twin.becomes(3)
        await wait_until_async(lambda: robot.node.parameters["speed"] == 1.0)


async def test_a_managed_node_is_led_to_its_state_and_back(twin: Twin, robot: Robot, zenoh_router: str) -> None:
    executor = metaros.SingleThreadedExecutor()
    with metaros.LifecycleNode("lidar", namespace="/sim_1", context=robot.context) as lidar:
        executor.add_node(lidar)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        try:
            async with running(twin, zenoh_router):
                await twin.comes_to(0, "applied")
                await twin.becomes(1, lifecycle={"lidar": "active"})
                await wait_until_async(lambda: lidar.state.label == "active")
                await wait_until_async(lambda: twin.reported["lifecycle"]["/sim_1/lidar"]["state"] == "active")
                await twin.becomes(2)
                await wait_until_async(lambda: lidar.state.label == "unconfigured")
        finally:
            executor.shutdown()
            thread.join(60)


async def test_a_gateway_that_does_not_know_twins_hears_nothing_of_them(agent: Rig) -> None:
    result = await agent.result(agent.command(set_uplink=link_pb2.SetUplink(bytes_per_s=9000)))  # a twin reports it
    assert result.ok
    result = await agent.result(agent.command(set_uplink=link_pb2.SetUplink(bytes_per_s=8000)))
    assert (agent.half.twins, agent.gateway.sessions) == ([], 1)  # a report would have ended the first session
