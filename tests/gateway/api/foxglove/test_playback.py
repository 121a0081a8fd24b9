"""Time travel in an unmodified protocol: pause, seek, speed over what is stored, and back to live."""

from __future__ import annotations

import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from gateway.api.foxglove.playback import FASTEST, SLOWEST, clamped_speed
from gateway.domain.principal import Role
from gateway.main import Ready
from metaros.clock import SystemClock
from tests.gateway.api.foxglove.robot import STRING, text
from tests.gateway.api.foxglove.viewer import Viewer, viewing
from tests.gateway.harness import DATA, RING, ScriptedAgent, channel, running_gateway

SECOND_NS = 10**9
STEP_NS = 50_000_000
COUNT = 20
AGO_S = 20


def control(*, play: bool, speed: float = 1.0, seek_ns: int | None = None, request: str = "r") -> bytes:
    """A PlaybackControlRequest."""
    head = struct.pack("<BBfBQI", 3, not play, speed, seek_ns is not None, seek_ns or 0, len(request))
    return head + request.encode()


async def state(viewer: Viewer) -> tuple[int, int, float, bool, str]:
    """The next PlaybackState: status, time, speed, whether it sought, the request."""
    said = await viewer.binary(5)
    status, now_ns, speed, did_seek, size = struct.unpack_from("<BQfBI", said)
    return status, now_ns, speed, bool(did_seek), said[18 : 18 + size].decode()


@asynccontextmanager
async def with_history(folder: Path) -> AsyncIterator[tuple[Ready, ScriptedAgent, int]]:
    """A gateway that has stored twenty samples of a while ago, 50 ms apart, and a robot that is linked."""
    async with running_gateway(folder) as ready, ScriptedAgent(ready) as agent:
        first_ns = SystemClock().wall_ns() - AGO_S * SECOND_NS
        await agent.announce(channel(1, "/sim_1/chatter", STRING))
        await agent.samples(1, 1, [text(str(index)) for index in range(COUNT)], stamp_ns=first_ns, step_ns=STEP_NS)
        await agent.next("ack", DATA)
        yield ready, agent, first_ns


async def test_pause_seek_play_and_back_to_live(tmp_path: Path) -> None:
    async with with_history(tmp_path) as (ready, agent, first_ns), viewing(ready, "/sim_1") as viewer:
        info = await viewer.hear("serverInfo")
        assert "playbackControl" in info["capabilities"]
        start = info["dataStartTime"]
        assert start["sec"] * SECOND_NS + start["nsec"] == first_ns
        await viewer.subscribe(1, "/sim_1/chatter")

        seen_ns = first_ns + 10 * STEP_NS
        await viewer.socket.send(control(play=False, seek_ns=seen_ns + 1, request="seek"))
        assert await state(viewer) == (1, seen_ns + 1, 1.0, True, "seek")
        assert await viewer.data() == (1, seen_ns, text("10"))
        await agent.samples(1, COUNT + 1, [text("live, and not for who looks back")])
        await agent.next("ack", DATA)

        await viewer.socket.send(control(play=True, speed=2.0, request="play"))
        assert await state(viewer) == (0, seen_ns + 1, 2.0, False, "play")
        played = [await viewer.data() for _ in range(COUNT - 11)]
        assert [payload for _, _, payload in played] == [text(str(index)) for index in range(11, COUNT)]
        assert [stamp_ns for _, stamp_ns, _ in played] == [first_ns + index * STEP_NS for index in range(11, COUNT)]

        await viewer.socket.send(control(play=True, seek_ns=2**63 - 1, request="now"))
        status, now_ns, speed, did_seek, request = await state(viewer)
        assert (status, speed, did_seek, request) == (0, 1.0, True, "now")
        assert now_ns > seen_ns + AGO_S // 2 * SECOND_NS
        await viewer.say("getParameters", parameterNames=["none"], id="live")
        await viewer.hear("parameterValues")
        await agent.samples(1, COUNT + 2, [text("live")])
        assert (await viewer.data())[2] == text("live")


async def test_whoever_plays_until_the_present_is_live_again(tmp_path: Path) -> None:
    async with with_history(tmp_path) as (ready, agent, first_ns), viewing(ready, "/sim_1") as viewer:
        await viewer.subscribe(1, "/sim_1/chatter")
        await viewer.socket.send(control(play=True, speed=100.0, seek_ns=first_ns + 18 * STEP_NS, request="fast"))
        assert (await state(viewer))[2:] == (100.0, True, "fast")
        assert [(await viewer.data())[2] for _ in range(2)] == [text("18"), text("19")]
        status, now_ns, speed, _, _ = await state(viewer)
        assert (status, speed) == (0, 1.0)
        assert now_ns >= first_ns + (AGO_S - 1) * SECOND_NS
        await agent.samples(1, COUNT + 1, [text("live")])
        assert (await viewer.data())[2] == text("live")


async def test_a_topic_that_is_chosen_while_paused_is_shown_as_of_then(tmp_path: Path) -> None:
    async with with_history(tmp_path) as (ready, _, first_ns), viewing(ready, "/sim_1") as viewer:
        await viewer.channel("/sim_1/chatter")
        await viewer.socket.send(control(play=False, seek_ns=first_ns + 3 * STEP_NS))
        await state(viewer)
        await viewer.subscribe(5, "/sim_1/chatter")
        assert await viewer.data() == (5, first_ns + 3 * STEP_NS, text("3"))
        await viewer.say("unsubscribe", subscriptionIds=[5])
        await viewer.socket.send(control(play=False, seek_ns=first_ns - 10 * SECOND_NS))  # before all there is
        assert (await state(viewer))[1] == first_ns


async def test_a_robot_that_is_away_since_the_gateway_began_is_played(tmp_path: Path) -> None:
    async with with_history(tmp_path) as (_, _, first_ns):
        pass
    async with running_gateway(tmp_path) as ready:
        for path in ("/sim_1", "/?robot=sim_1", "/"):
            async with viewing(ready, path) as viewer:
                assert (await viewer.channel("/sim_1/chatter"))["schemaName"] == STRING
                await viewer.subscribe(1, "/sim_1/chatter")
                await viewer.socket.send(control(play=False, seek_ns=first_ns + 3 * STEP_NS))
                assert await viewer.data() == (1, first_ns + 3 * STEP_NS, text("3"))
        async with viewing(ready, "/sim_1") as viewer:
            await viewer.subscribe(1, "/sim_1/chatter")
            async with ScriptedAgent(ready) as agent:  # it is back: the subscription holds
                await agent.announce(channel(1, "/sim_1/chatter", STRING))
                await agent.samples(1, COUNT + 1, [text("live")])
                assert (await viewer.data())[2] == text("live")


async def test_time_does_not_go_where_nobody_may_look(tmp_path: Path) -> None:
    scoped = RING.add(role=Role.VIEWER, robots=("other",))
    async with with_history(tmp_path) as (ready, _, first_ns):
        for path, key in (("/", scoped), ("/sim_1?history=off", RING.add(role=Role.VIEWER))):
            async with viewing(ready, path, key=key) as viewer:
                assert "playbackControl" not in (await viewer.hear("serverInfo"))["capabilities"]
                await viewer.socket.send(control(play=False, seek_ns=first_ns))
                assert "no history" in (await viewer.hear("status"))["message"]


@pytest.mark.parametrize(
    ("asked", "played"),
    [(1.0, 1.0), (0.0, 1.0), (-2.0, 1.0), (1e9, FASTEST), (1e-9, SLOWEST), (float("nan"), 1.0), (float("inf"), 1.0)],
)
def test_a_speed_is_one_that_can_be_played(asked: float, played: float) -> None:
    assert clamped_speed(asked) == played


async def test_a_latched_topic_is_shown_to_whoever_comes_later(tmp_path: Path) -> None:
    latched = channel(1, "/sim_1/map", STRING)
    latched.qos = ":1:,1:,:,:,,"
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(latched, channel(2, "/sim_1/chatter", STRING))
        for number in (1, 2):
            await agent.samples(number, 1, [text("old"), text("held")], stamp_ns=SystemClock().wall_ns())
            await agent.next("ack", DATA)
        async with viewing(ready, "/sim_1") as viewer:
            await viewer.subscribe(2, "/sim_1/chatter")  # which is not latched
            await viewer.subscribe(1, "/sim_1/map")
            number, _, payload = await viewer.data()
            assert (number, payload) == (1, text("held"))
            await agent.samples(1, 3, [text("new")])
            assert (await viewer.data())[::2] == (1, text("new"))
