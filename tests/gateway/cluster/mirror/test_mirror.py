"""Robots of other gateways: every registry shows the whole fleet, and a robot is where its newest session is."""

from __future__ import annotations

import pytest

from gateway.cluster.mirror.receiver import ORPHAN_S
from gateway.cluster.mirror.sender import MIRROR
from gateway.live.feeds import Feeds, MetricSubscription
from metaros._proto import cluster_pb2, link_pb2
from metaros.clock import ManualClock
from metaros.idl.globs import Glob
from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.gateways.mirrored import Replica, channel, make_run, replicas
from tests.support.waiting import wait_until_async


async def shows(replica: Replica, robot: str, home: str) -> None:
    """Wait until a gateway has the robot online with that home."""

    def there() -> bool:
        record = replica.registry.find(robot)
        return record is not None and record.online and record.owner_gateway == home

    await wait_until_async(there)


async def gone(replica: Replica, robot: str) -> None:
    """Wait until a gateway has the robot offline."""
    await wait_until_async(lambda: not replica.registry.get(robot).online)


async def test_a_gateway_that_comes_is_reported_everything() -> None:
    meshes = FakeMeshes()
    async with replicas(meshes, "a") as (a,):
        reported = a.link("r1", 5, labels={"site": "hall"})
        both = [channel("r1", 1, "/scan"), channel("r1", 2, "/map", delivery="bulk", forward=False)]
        a.announce("r1", both, ["speed"])
        a.values("r1", speed=1.5, volts=12.0)
        a.publish(make_run(both[0], [b"one", b"two"], stamp_ns=50))
        reported.report(
            link_pb2.TopicStatistics(outbox_bytes=11, topics=[link_pb2.TopicRate(channel_id=1, rate_hz=10)])
        )
        reported.rtt_s = 0.25
        async with replicas(meshes, "b") as (b,):
            await shows(b, "r1", "a")
            await wait_until_async(lambda: b.registry.get("r1").shown_counts.samples == 4)
            await wait_until_async(lambda: b.registry.get("r1").statistics.outbox_bytes == 11)
            record = b.registry.get("r1")
            assert (record.here, record.online, record.owner_session, record.session_number) == (False, True, 5, 5)
            assert record.robot == reported.robot
            assert record.since_ns == reported.since_ns
            assert [state.channel for state in record.topics()] == [state.channel for state in reported.topics()]
            assert record.newest() == reported.newest() == {"speed": (1000, 1.5), "volts": (1000, 12.0)}
            assert record.series["speed"].series == reported.series["speed"].series
            assert record.rtt_s == 0.25
            assert record.lag_ns == reported.lag_ns
            state = record.channels[1]
            assert (state.received, state.received_bytes, state.last_stamp_ns) == (2, 6, 51)
            assert state.rate.rate_hz == 10
            assert record.counts.samples == 0  # nothing arrived here
            assert b.mirror.mirrored == 1
            assert b.mirror.of("a") == ["r1"]
            assert a.mirror.mirrored == 0


async def test_news_are_reported_to_everybody() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        a.link("r1", 1)
        await shows(b, "r1", "a")
        await shows(c, "r1", "a")
        changes = list[str]()
        stop = b.hub.watch_channels(changes.append)
        a.announce("r1", [channel("r1", 1, "/scan")], ["speed"])
        await wait_until_async(lambda: b.registry.get("r1").listed() == c.registry.get("r1").listed() == 1)
        assert changes == ["r1"]
        stop()
        a.values("r1", speed=2.0)
        await wait_until_async(lambda: b.registry.get("r1").newest() == {"speed": (1000, 2.0)})
        a.values("r1", volts=3.0)  # nobody announced it
        await wait_until_async(lambda: c.registry.get("r1").newest() == {"speed": (1000, 2.0), "volts": (1000, 3.0)})
        a.unlink("r1")
        await gone(b, "r1")
        await gone(c, "r1")
        assert b.registry.get("r1").newest() == {"speed": (1000, 2.0), "volts": (1000, 3.0)}


async def test_values_come_to_who_looks_at_them() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        a.link("r1", 1)
        a.announce("r1", [], ["speed"])
        await wait_until_async(lambda: "speed" in b.registry.get("r1").series if b.registry.find("r1") else False)
        feeds, woken = Feeds(), list[int]()
        feeds.add(MetricSubscription(1, Glob("*"), [Glob("*")], max_rate_hz=1000.0))
        b.hub.feed(feeds, lambda: woken.append(1))
        a.values("r1", speed=4.5)
        await wait_until_async(lambda: woken)
        (message,) = feeds.take(0.0)
        assert (message["robot"], message["values"]) == ("r1", {"speed": 4.5})


async def test_a_new_process_of_the_agent_has_its_channels_alone() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        a.link("r1", 1, process=b"one")
        a.announce("r1", [channel("r1", 1, "/old")])
        await wait_until_async(lambda: b.registry.find("r1") and b.registry.get("r1").listed())
        a.unlink("r1")
        a.link("r1", 2, process=b"two")
        a.announce("r1", [channel("r1", 1, "/new")])
        await wait_until_async(lambda: [s.channel.topic for s in b.registry.get("r1").topics()] == ["/new"])
        assert b.registry.get("r1").channels[1].channel == a.registry.get("r1").channels[1].channel


async def test_a_gateway_that_dies_takes_its_robots_along() -> None:
    meshes, clock = FakeMeshes(), ManualClock()
    async with replicas(meshes, "a", "b", "c", clock=clock) as (a, b, c):
        orphans: dict[str, list[str]] = {"b": [], "c": []}
        b.mirror.on_orphan(orphans["b"].append)
        c.mirror.on_orphan(orphans["c"].append)
        for name in ("r1", "r2"):
            a.link(name, 1)
        await shows(b, "r2", "a")
        await shows(c, "r2", "a")
        meshes.leave("a")
        await gone(b, "r1")
        await gone(c, "r2")
        b.link("r2", 2)  # it was quick
        await shows(c, "r2", "b")
        assert orphans == {"b": [], "c": []}
        clock.advance(ORPHAN_S)
        await wait_until_async(lambda: orphans["b"])
        assert orphans == {"b": ["r1"], "c": []}  # one of them speaks


async def test_a_robot_moves_and_its_former_home_is_late() -> None:
    meshes = FakeMeshes()
    async with replicas(meshes, "a", "b", "c") as (a, b, c):
        ended = list[tuple[str, str, int]]()
        a.mirror.on_remote_session(lambda *facts: ended.append(facts))
        a.link("r1", 7)
        await shows(c, "r1", "a")
        states = list[tuple[bool, str]]()
        c.mirror.watch(lambda robot: states.append((c.registry.get(robot).online, c.registry.get(robot).owner_gateway)))
        b.link("r1", 8)
        await wait_until_async(lambda: ended)
        assert ended == [("r1", "b", 8)]
        assert (a.registry.get("r1").here, a.registry.get("r1").owner_gateway) == (True, "b")
        a.unlink("r1")  # as whoever has its links does when it hears that
        assert (a.registry.get("r1").online, a.registry.get("r1").owner_gateway) == (True, "b")
        a.values("r1", speed=1.0)
        await shows(c, "r1", "b")
        b.announce("r1", [channel("r1", 1, "/scan")])  # comes behind all that a said late
        await wait_until_async(lambda: c.registry.get("r1").listed())
        assert states[0] == (True, "b")
        assert all(online for online, _ in states)
        assert c.registry.get("r1").newest() == {}
        assert b.registry.get("r1").owner_gateway == ""
        assert (c.mirror.of("a"), c.mirror.of("b")) == ([], ["r1"])


async def test_an_older_session_remote_changes_nothing_until_the_newer_one_ends() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        a.link("r1", 9)
        await shows(b, "r1", "a")
        await shows(c, "r1", "a")
        ended = list[object]()
        a.mirror.on_remote_session(lambda *facts: ended.append(facts))
        b.link("r1", 3)  # the robot's clock was set back, and nobody keeps it from this here
        b.announce("r1", [channel("r1", 1, "/scan")])
        b.link("r2", 1)
        await shows(a, "r2", "b")
        await shows(c, "r2", "b")
        assert not ended
        assert c.registry.get("r1").owner_gateway == "a"
        a.unlink("r1")
        await shows(a, "r1", "b")
        await shows(c, "r1", "b")
        await wait_until_async(lambda: c.registry.get("r1").listed())
        assert c.registry.get("r1").session_number == 3


async def test_a_gateway_that_takes_no_more_is_reported_all_of_it_later() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        a.link("r1", 1)
        a.link("r2", 1)
        await shows(b, "r2", "a")
        a.mesh.full.add("b")
        a.announce("r1", [channel("r1", 1, "/scan")], ["speed"])
        a.unlink("r2")
        a.values("r1", speed=1.0)
        a.link("r3", 1)
        for _ in range(20):
            await wait_until_async(lambda: True)
        assert b.registry.find("r3") is None
        a.mesh.full.clear()
        await shows(b, "r3", "a")
        await gone(b, "r2")
        await wait_until_async(lambda: b.registry.get("r1").newest() == {"speed": (1000, 1.0)})
        assert b.registry.get("r1").listed() == 1


async def test_schemas_cross_once() -> None:
    meshes = FakeMeshes()
    async with replicas(meshes, "a", "b") as (a, b):
        reported = list[bytes]()
        send = a.mesh.send

        def noted(gateway: str, topic: str, payload: bytes) -> bool:
            reported.extend([payload] * (topic == MIRROR))
            return send(gateway, topic, payload)

        a.mesh.send = noted  # type: ignore[method-assign]
        await wait_until_async(lambda: any(cluster_pb2.Mirror.FromString(payload).whole for payload in reported))
        text = b"int8 x\n" * 10_000
        for number in range(50):
            name = f"r{number}"
            a.link(name, 1)
            one = channel(name, 1, "/scan")
            a.announce(name, [type(one)(**{**vars_of(one), "schema": text})])
        await wait_until_async(
            lambda: all((found := b.registry.find(f"r{number}")) and found.listed() for number in range(50))
        )
        assert b.registry.get("r49").channels[1].channel.schema == text
        assert sum(map(len, reported)) < 2 * len(text)


def vars_of(item: object) -> dict[str, object]:
    """The fields of a slotted dataclass."""
    return {name: getattr(item, name) for name in type(item).__slots__}  # type: ignore[attr-defined]


@pytest.mark.parametrize("payload", [b"\xff\xff\xff", b""])
async def test_what_cannot_be_read_changes_nothing(payload: bytes) -> None:
    meshes = FakeMeshes()
    async with replicas(meshes, "a", "b") as (a, b):
        a.mesh.send("b", "mirror", payload)
        a.mesh.send("b", "live", payload)
        a.link("r1", 1)
        await shows(b, "r1", "a")
