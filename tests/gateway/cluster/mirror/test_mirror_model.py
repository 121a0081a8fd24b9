"""Whatever happens to links, gateways and queues: in the end every gateway shows each robot where it is."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.gateways.mirrored import Replica, channel, replicas
from tests.support.waiting import wait_until_async

NAMES, ROBOTS = ("a", "b", "c"), ("r1", "r2")
STEPS = st.one_of(
    st.tuples(st.just("link"), st.sampled_from(NAMES), st.sampled_from(ROBOTS)),
    st.tuples(st.just("unlink"), st.sampled_from(NAMES), st.sampled_from(ROBOTS)),
    st.tuples(st.just("announce"), st.sampled_from(NAMES), st.sampled_from(ROBOTS)),
    st.tuples(st.just("die"), st.sampled_from(NAMES), st.just("")),
    st.tuples(st.just("full"), st.sampled_from(NAMES), st.sampled_from(NAMES)),
    st.tuples(st.just("wait"), st.integers(1, 20).map(str), st.just("")),
)


class World:
    """Three gateways, each of which may die and come back, and robots whose sessions count up."""

    def __init__(self) -> None:
        self.meshes = FakeMeshes()
        self.alive: dict[str, tuple[Replica, AsyncExitStack]] = {}
        self.sessions = self.topics = 0

    async def start(self, name: str) -> None:
        """A gateway comes, knowing nothing."""
        stack = AsyncExitStack()
        (replica,) = await stack.enter_async_context(replicas(self.meshes, name))
        replica.mirror.on_remote_session(lambda robot, _home, _number: replica.unlink(robot))
        self.alive[name] = replica, stack

    async def die(self, name: str) -> None:
        """It is killed."""
        _, stack = self.alive.pop(name)
        self.meshes.leave(name)
        await stack.aclose()

    async def step(self, what: str, name: str, about: str) -> None:
        """One thing happens."""
        if what == "wait":
            for _ in range(int(name)):
                await asyncio.sleep(0)
            return
        if name not in self.alive:
            await self.start(name)
        replica = self.alive[name][0]
        record = replica.registry.find(about)
        if what == "link":
            self.sessions += 1
            if record is not None and record.here:
                replica.unlink(about)
            replica.link(about, self.sessions, process=str(self.sessions).encode())
        elif what == "unlink" and record is not None and record.here:
            replica.unlink(about)
        elif what == "announce" and record is not None and record.here:
            self.topics += 1
            replica.announce(about, [channel(about, self.topics, f"/topic{self.topics}")])
        elif what == "die":
            await self.die(name)
        elif what == "full":
            replica.mesh.full ^= {about}

    def agree(self) -> bool:
        """Whether everybody shows the truth."""
        return all(self.shown(replica, robot) for replica, _ in self.alive.values() for robot in ROBOTS)

    def shown(self, replica: Replica, robot: str) -> bool:
        """Whether a gateway has a robot where it is, with its channels there."""
        here = [other for other, _ in self.alive.values() if (r := other.registry.find(robot)) is not None and r.here]
        if len(here) > 1:
            return False
        record = replica.registry.find(robot)
        if not here or record is None:
            return not here and (record is None or not record.online)
        home, truth = here[0], here[0].registry.get(robot)
        return (
            record.online
            and record.owner_gateway == ("" if home is replica else home.mesh.gateway_id)
            and record.session_number == truth.session_number
            and {state.channel for state in record.channels.values()}
            == {state.channel for state in truth.channels.values()}
        )


async def play(steps: list[tuple[str, str, str]]) -> None:
    """All of it, and then the truth."""
    world = World()
    for name in NAMES:
        await world.start(name)
    try:
        for step in steps:
            await world.step(*step)
        for replica, _ in world.alive.values():
            replica.mesh.full.clear()
        await wait_until_async(world.agree, timeout_s=20.0)
    finally:
        for name in list(world.alive):
            await world.die(name)


@settings(max_examples=30)
@given(st.lists(STEPS, min_size=30, max_size=40))
def test_everybody_agrees_in_the_end(steps: list[tuple[str, str, str]]) -> None:
    asyncio.run(play(steps))
