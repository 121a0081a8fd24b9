"""Live samples across gateways: only what somebody looks at, as it was sent, and bounded."""

from __future__ import annotations

import asyncio

from gateway.domain.channel import Channel
from metaros.limits import LIMITS
from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.gateways.mirrored import Replica, channel, make_run, replicas
from tests.support.waiting import wait_until_async


async def known(replica: Replica, robot: str, topics: int) -> None:
    """Wait until a gateway knows so many topics of a robot."""

    def there() -> bool:
        record = replica.registry.find(robot)
        return record is not None and record.listed() == topics

    await wait_until_async(there)


async def wanted(replica: Replica, robot: str, wants: dict[str, float]) -> None:
    """Wait until a home knows that others want that."""
    await wait_until_async(lambda: replica.live.wanted(robot) == wants)


async def test_samples_of_all_classes_cross_as_they_are() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        channels = [channel("r1", n, f"/{kind}", delivery=kind) for n, kind in enumerate(("live", "bulk", "event"), 1)]
        kept = channel("r1", 4, "/kept", forward=False)
        a.link("r1", 1)
        a.announce("r1", [*channels, kept])
        await known(b, "r1", 4)
        _viewer, seen = b.look()
        _here, seen_here = a.look()
        await wanted(a, "r1", {"/live": 0.0, "/bulk": 0.0, "/event": 0.0})
        runs = list[object]()
        publish = b.hub.publish
        b.hub.publish = lambda run: (runs.append(run), publish(run))[1]  # type: ignore[method-assign]
        for one in channels:
            a.publish(make_run(one, [one.topic.encode(), b"", b"\0" * 70_000], first_seq=40, stamp_ns=500, step_ns=9))
        await wait_until_async(lambda: len(seen.payloads) == 9)
        assert sorted(seen.payloads) == sorted(seen_here.payloads)
        for run, one in zip(runs, channels, strict=True):
            assert run.channel == one  # type: ignore[attr-defined]
            assert run.channel.identity == one.identity  # type: ignore[attr-defined]
            assert run.receive_ns == 99  # type: ignore[attr-defined]
            assert run.columns.epoch == 7  # type: ignore[attr-defined]
            stamps = [(seq, stamp) for seq, stamp, _ in run.columns.samples()]  # type: ignore[attr-defined]
            assert stamps == [(40, 500), (41, 509), (42, 518)]
        assert (a.live.sent_samples, b.live.received_samples, b.live.stale_samples) == (9, 9, 0)


async def test_nothing_crosses_that_nobody_looks_at() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        scan, odom = channel("r1", 1, "/scan"), channel("r1", 2, "/odom")
        a.link("r1", 1)
        a.announce("r1", [scan, odom])
        await known(b, "r1", 2)
        await known(c, "r1", 2)
        a.publish(make_run(scan, [b"x"]))
        assert a.live.waiting_bytes == 0
        viewer, seen = b.look("/scan")
        await wanted(a, "r1", {"/scan": 0.0})
        a.publish(make_run(odom, [b"o"]))
        a.publish(make_run(scan, [b"s"]))
        await wait_until_async(lambda: seen.payloads == [b"s"])
        assert (b.live.received_samples, c.live.received_samples) == (1, 0)
        viewer.close()
        await wanted(a, "r1", {})
        a.publish(make_run(scan, [b"x"]))
        assert a.live.sent_samples == 1


async def test_the_highest_rate_is_wanted_and_the_home_thins() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        scan = channel("r1", 1, "/scan")
        reported = list[str]()
        a.live.on_wanted(reported.append)
        a.link("r1", 1)
        a.announce("r1", [scan])
        await known(b, "r1", 1)
        await known(c, "r1", 1)
        _one, seen = b.look("/scan", rate_hz=10.0)
        await wanted(a, "r1", {"/scan": 10.0})
        assert reported == ["r1"]
        samples = [bytes([number]) for number in range(100)]
        a.publish(make_run(scan, samples, stamp_ns=0, step_ns=10_000_000))
        await wait_until_async(lambda: len(seen.payloads) == 10)
        assert seen.payloads == [bytes([number]) for number in range(0, 100, 10)]
        assert a.live.sent_samples == 10
        other, seen_c = c.look("/scan")
        await wanted(a, "r1", {"/scan": 0.0})
        a.publish(make_run(scan, [b"x", b"y"], stamp_ns=2 * 10**9))
        await wait_until_async(lambda: seen_c.payloads == [b"x", b"y"] and seen.payloads[-1] == b"x")
        other.close()
        await wanted(a, "r1", {"/scan": 10.0})


async def test_interest_follows_the_robot_to_another_home() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        scan = channel("r1", 1, "/scan")
        _viewer, seen = c.look("/scan", robot="r1")
        for home, number in ((a, 1), (b, 2)):
            home.link("r1", number)
            home.announce("r1", [scan])
            await wanted(home, "r1", {"/scan": 0.0})
            home.publish(make_run(scan, [home.mesh.gateway_id.encode()]))
            await wait_until_async(lambda name=home.mesh.gateway_id: seen.payloads[-1:] == [name.encode()])
            if home is a:
                a.unlink("r1")
        await wanted(a, "r1", {})
        assert seen.payloads == [b"a", b"b"]


async def test_interest_outlives_a_lost_link_and_ends_where_the_viewers_gateway_has_the_robot() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        scan = channel("r1", 1, "/scan")
        a.link("r1", 1)
        a.announce("r1", [scan])
        _viewer, seen = b.look("/scan")
        await wanted(a, "r1", {"/scan": 0.0})
        a.unlink("r1")
        await wait_until_async(lambda: not b.registry.get("r1").online)
        for _ in range(10):
            await asyncio.sleep(0.005)
        assert a.live.wanted("r1") == {"/scan": 0.0}  # it may be back at once
        b.link("r1", 2)
        b.announce("r1", [scan])
        await wanted(a, "r1", {})
        b.publish(make_run(scan, [b"here"]))
        await wait_until_async(lambda: seen.payloads == [b"here"])
        assert b.live.received_samples == 0


async def test_a_gateway_that_comes_back_is_reported_anew() -> None:
    meshes = FakeMeshes()
    async with replicas(meshes, "b") as (b,):
        _viewer, seen = b.look("/scan")
        for payload in (b"first", b"second"):
            async with replicas(meshes, "a") as (a,):
                scan = channel("r1", 1, "/scan")
                a.link("r1", 1)
                a.announce("r1", [scan])
                await wanted(a, "r1", {"/scan": 0.0})
                a.publish(make_run(scan, [payload]))
                await wait_until_async(lambda said=payload: seen.payloads[-1:] == [said])
                meshes.leave("a")
                await wait_until_async(lambda: not b.registry.get("r1").online)


async def test_the_oldest_is_dropped_when_a_gateway_takes_no_more() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        scan = channel("r1", 1, "/scan")
        a.link("r1", 1)
        a.announce("r1", [scan])
        await known(b, "r1", 1)
        _viewer, seen = b.look("/scan")
        await wanted(a, "r1", {"/scan": 0.0})
        a.mesh.full.add("b")
        for number in range(12):
            a.publish(make_run(scan, [bytes([number]) * 1_000_000], first_seq=number + 1))
            await asyncio.sleep(0)
        assert LIMITS.cluster_live_bytes - 2_000_000 < a.live.waiting_bytes <= LIMITS.cluster_live_bytes
        assert a.live.dropped_samples == 4
        a.mesh.full.clear()
        await wait_until_async(lambda: len(seen.payloads) == 8)
        assert [payload[0] for payload in seen.payloads] == list(range(4, 12))


async def test_samples_of_a_former_process_are_not_taken_for_the_new_ones() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        old, new = channel("r1", 1, "/scan"), channel("r1", 1, "/other")
        a.link("r1", 1, process=b"one")
        a.announce("r1", [old])
        await known(b, "r1", 1)
        _viewer, seen = b.look()
        await wanted(a, "r1", {"/scan": 0.0})
        a.mesh.full.add("b")
        a.publish(make_run(old, [b"late"]))
        await asyncio.sleep(0.01)
        a.unlink("r1")
        a.link("r1", 2, process=b"two")
        a.announce("r1", [new])
        b.registry.get("r1").start_channels(a.registry.get("r1").generation)  # what it will hear
        b.registry.get("r1").announce([new], [])
        a.mesh.full.clear()
        await wait_until_async(lambda: b.live.stale_samples == 1)
        assert seen.payloads == []


async def test_many_robots_are_asked_for_at_once() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        channels: list[Channel] = []
        for number in range(300):
            name = f"r{number}"
            a.link(name, 1)
            channels.append(channel(name, 1, "/scan"))
            a.announce(name, channels[-1:])
        await wait_until_async(lambda: b.mirror.mirrored == 300)
        _viewer, seen = b.look("/scan")
        await wait_until_async(lambda: all(a.live.wanted(one.robot) for one in channels))
        for one in channels:
            a.publish(make_run(one, [one.robot.encode()]))
        await wait_until_async(lambda: len(seen.payloads) == 300)
        assert {payload.decode() for payload in seen.payloads} == {one.robot for one in channels}
